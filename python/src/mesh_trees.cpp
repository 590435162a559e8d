// A mesh -> what answers closest points, inside tests, overlaps: when it is needed.
#include <raydix/error.h>

#include <string>
#include <utility>

#include "batch.h"
#include "scene_trees.h"

namespace raydix::python {

template <class Names>
Reading MeshTrees<Names>::read() const {
    Writing::require_none("scene");
    return Reading::in_turn("scene", locks_);
}

template <class Names>
const MeshArrays<Names>& MeshTrees<Names>::mesh(const char* call) const {
    if (!why_no_mesh_.empty()) throw InputError(std::string(call) + ": " + why_no_mesh_);
    return mesh_;
}

template <class Names>
const typename Names::Bvh& MeshTrees<Names>::bvh_locked() {
    if (!bvh_) {
        BuildOptions options = options_;
        options.threads = threads_for(options.threads);
        bvh_ = build_bvh(mesh_.view(), options);
    }
    return *bvh_;
}

template <class Names>
const typename Names::Bvh& MeshTrees<Names>::bvh(const char* call) {
    static_cast<void>(mesh(call));
    const std::lock_guard lock(locks_.build());
    return bvh_locked();
}

template <class Names>
const typename Names::Solid& MeshTrees<Names>::solid(InsideRule rule, const char* call) {
    static_cast<void>(mesh(call));
    const std::lock_guard lock(locks_.build());
    std::optional<typename Types::Solid>& kept = solids_[static_cast<std::size_t>(rule)];
    if (!kept)
        kept.emplace(bvh_locked(),
                     SolidOptions{.rule = rule, .threads = threads_for(options_.threads)});
    return *kept;
}

template <class Names>
void MeshTrees<Names>::set_mesh(Arrays mesh) {
    drop_trees();
    mesh_ = std::move(mesh);
}

template <class Names>
void MeshTrees<Names>::move_mesh(Arrays mesh) {
    mesh_ = std::move(mesh);
    for (auto& solid : solids_) solid.reset();
}

template <class Names>
void MeshTrees<Names>::drop_trees() {
    for (auto& solid : solids_) solid.reset();
    bvh_.reset();
}

template class MeshTrees<InFloat>;
template class MeshTrees<InDouble>;

RefitQuality RefitterD::refit(BvhD& bvh, const MeshViewD& mesh, int threads) {
    RefitQuality quality = raydix::refit(bvh, mesh, threads);
    // Each refit tells of the tree before it; that before the first is the one that was built.
    if (!sah_at_build_) sah_at_build_ = quality.sah_at_build;
    quality.sah_at_build = *sah_at_build_;
    quality.ratio = quality.sah > 0 && *sah_at_build_ > 0 ? quality.sah / *sah_at_build_ : 1.0;
    return quality;
}

}  // namespace raydix::python
