// Mesh -> trees, when they are needed.
#include "scene_trees.h"

#include <raydix/error.h>

#include <span>
#include <string>
#include <utility>

#include "batch.h"

namespace raydix::python {

namespace {

std::mutex& unless_reading(std::mutex& queue) {
    if (Reading::held() != 0)
        throw InputError("refit: this thread is within a query of a scene, in a signal handler");
    return queue;
}

}  // namespace

Writing::Writing(std::mutex& queue, std::shared_mutex& use)
    : queue_(unless_reading(queue)), use_(use) {}

template <class Names>
MeshTrees<Names>::MeshTrees(typename Types::Mesh mesh, const BuildOptions& options)
    : mesh_(std::move(mesh)), options_(options) {}

template <class Names>
Reading MeshTrees<Names>::read() const {
    // Who reads already must not queue up behind a refit that waits for the end of that.
    if (Reading::held() != 0) return Reading(use_);
    const std::lock_guard queue(queue_);
    return Reading(use_);
}

template <class Names>
const typename Names::Bvh& MeshTrees<Names>::bvh_locked() {
    if (!bvh_) {
        BuildOptions options = options_;
        options.threads = threads_for(options.threads);
        using Points = std::span<const typename Types::Point>;
        // Without triangles build_bvh would take the vertices as points, and a scene has none.
        bvh_ = build_bvh(
            typename Types::MeshView(mesh_.triangles.empty() ? Points() : Points(mesh_.vertices),
                                     mesh_.triangles),
            options);
    }
    return *bvh_;
}

template <class Names>
const typename Names::Bvh& MeshTrees<Names>::bvh() {
    const std::lock_guard lock(build_);
    return bvh_locked();
}

template <class Names>
const typename Names::Solid& MeshTrees<Names>::solid(InsideRule rule) {
    const std::lock_guard lock(build_);
    std::optional<typename Types::Solid>& kept = solids_[static_cast<std::size_t>(rule)];
    if (!kept)
        kept.emplace(bvh_locked(),
                     SolidOptions{.rule = rule, .threads = threads_for(options_.threads)});
    return *kept;
}

template <class Names>
std::shared_ptr<const void> MeshTrees<Names>::keep_vertices() {
    const std::lock_guard lock(build_);
    if (!old_vertices_) old_vertices_ = std::make_shared<Vertices>();
    return old_vertices_;
}

template <class Names>
void MeshTrees<Names>::take_vertices(Vertices vertices) {
    if (old_vertices_ && old_vertices_.use_count() > 1) *old_vertices_ = std::move(mesh_.vertices);
    old_vertices_.reset();
    mesh_.vertices = std::move(vertices);
    for (auto& solid : solids_) solid.reset();
}

template <class Names>
void MeshTrees<Names>::drop_trees() {
    for (auto& solid : solids_) solid.reset();
    bvh_.reset();
}

template class MeshTrees<InFloat>;
template class MeshTrees<InDouble>;

SceneTrees::SceneTrees(Mesh mesh, const BuildOptions& options)
    : MeshTrees(std::move(mesh), options) {
    static_cast<void>(inspect(mesh_));
}

const WideBvh& SceneTrees::wide() {
    const std::lock_guard lock(build_);
    if (!wide_) {
        BuildOptions options = options_;
        options.threads = threads_for(options.threads);
        if (bvh_)  // the same bits as from the mesh, and after a refit the only way
            wide_.emplace(*bvh_, WideBvhOptions{.threads = options.threads});
        else if (mesh_.triangles.empty())
            wide_.emplace();
        else
            wide_.emplace(build_wide_bvh(mesh_, options));
    }
    return *wide_;
}

RefitQuality SceneTrees::refit(std::vector<Vec3> vertices, int threads) {
    const Writing lock(queue_, use_);
    if (mesh_.triangles.empty()) {
        take_vertices(std::move(vertices));
        return {};
    }
    if (!refitter_) refitter_.emplace(bvh_locked());
    const bool had_nodes = !bvh_locked().empty();
    ++version_;
    RefitQuality quality;
    try {
        quality =
            refitter_->refit(*bvh_, MeshView(vertices, mesh_.triangles), threads_for(threads));
    } catch (const InputError&) {
        // Found late, the tree is gone: the mesh is still there, and makes it again.
        if (had_nodes && bvh_->empty()) {
            drop_trees();
            wide_.reset();
            refitter_.reset();
        }
        throw;
    }
    take_vertices(std::move(vertices));
    wide_.reset();
    return quality;
}

SceneTreesD::SceneTreesD(MeshD mesh, const BuildOptions& options)
    : MeshTrees(std::move(mesh), options) {
    for (std::size_t i = 0; i < mesh_.triangles.size(); ++i)
        for (const std::uint32_t corner : mesh_.triangles[i])
            if (corner >= mesh_.vertices.size())
                throw InputError("triangle " + std::to_string(i) + " refers to vertex " +
                                 std::to_string(corner) + ", but there are " +
                                 std::to_string(mesh_.vertices.size()));
}

RefitQuality SceneTreesD::refit(std::vector<Vec3d> vertices, int threads) {
    const Writing lock(queue_, use_);
    if (mesh_.triangles.empty()) {
        take_vertices(std::move(vertices));
        return {};
    }
    const bool had_nodes = !bvh_locked().empty();
    ++version_;
    RefitQuality quality;
    try {
        quality = raydix::refit(*bvh_, MeshViewD(vertices, mesh_.triangles), threads_for(threads));
    } catch (const InputError&) {
        if (had_nodes && bvh_->empty()) {  // as in float32
            drop_trees();
            sah_at_build_.reset();
        }
        throw;
    }
    take_vertices(std::move(vertices));
    // Each refit tells of the tree before it; that before the first is the one that was built.
    if (!sah_at_build_) sah_at_build_ = quality.sah_at_build;
    quality.sah_at_build = *sah_at_build_;
    quality.ratio = quality.sah > 0 && *sah_at_build_ > 0 ? quality.sah / *sah_at_build_ : 1.0;
    return quality;
}

}  // namespace raydix::python
