// What commits in float and in double share: meshes -> trees, each built, refitted or kept;
// instances -> numbers of paths; how far the commit is.
#pragma once

#include <raydix/error.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "engine/left_out.h"
#include "engine/merge.h"
#include "engine/own_geometries.h"
#include "engine/scene_state.h"
#include "exec/parallel.h"
#include "exec/progress.h"

namespace raydix {

/// Maker says how trees of triangles come about, `build` with what one of them keeps, MeshTree and
/// MeshView being those of the type:
///   build(mesh, options, last, out)   a new one: tree and sah_at_build, 0 if it is not known;
///                                     `last`: the tree of the same meshes so far, or null
///   left_out(out)                     how many of its triangles are invalid
///   keep(old, out)                    the same tree
///   share_rates(old, out)             which ways rays go is known from the old tree on
///   refit(old, mesh, options, out)    the old one around moved vertices, and its SAH; or none
template <class Scalar, class Maker>
class MeshCommit {
public:
    using State = typename BasicSceneInternals<Scalar>::State;
    using Geometry = typename State::Geometry;
    using Mesh = BasicMesh<Scalar>;
    using MeshView = BasicMeshView<Scalar>;
    using MeshTree = typename SceneKind<Scalar>::MeshTree;

    MeshCommit(const State& state, const OwnGeometries<Scalar>& own, const SceneOptions& options,
               CommitReport& report, Maker maker = {})
        : state_(state), own_(own), options_(options), report_(report), maker_(std::move(maker)) {
        if (state.tree == nullptr || options.quality != state.tree->quality ||
            options.compact != state.tree->compact)
            return;
        for (const auto& mesh : state.tree->meshes) last_[mesh->ids.front()] = mesh.get();
    }

    /// The trees. `parts`: how many other parts the tree over all of them has, for what is told of
    /// progress: a part counts as a triangle.
    std::vector<std::shared_ptr<const MeshTree>> run(double parts) {
        std::vector<std::shared_ptr<const MeshTree>> trees;
        const std::vector<Group> groups = groups_of(options_.usage);
        double work = static_cast<double>(groups.size()) + parts, done = 0;
        for (const Group& group : groups) work += work_of(group);
        for (const Group& group : groups) {
            const double after = done + work_of(group);
            const ProgressStage stage(done / work, after / work);
            trees.push_back(tree_of(group));
            progress_at(1);
            done = after;
        }
        done_ = work > 0 ? done / work : 1;
        for (const auto& tree : trees) {
            report_.meshes += tree->ids.size();
            report_.triangles += tree->triangles;
            report_.left_out += tree->left_out;
            if (options_.strict && tree->left_out != 0) refuse(*tree);
        }
        return trees;
    }
    /// Of the whole commit, after `run`.
    [[nodiscard]] double part_done() const { return done_; }

private:
    /// Meshes that one tree holds.
    struct Group {
        std::uint32_t mask;
        std::vector<std::uint32_t> ids;
    };

    [[nodiscard]] std::vector<Group> groups_of(Usage usage) const {
        std::vector<Group> groups;
        std::map<std::uint32_t, std::size_t> by_mask;
        for (const auto& [id, geometry] : own_) {
            if (!geometry->is_mesh() || geometry->mesh.triangles.empty()) continue;
            const auto found = by_mask.find(geometry->mask);
            if (usage == Usage::fixed && found != by_mask.end()) {
                groups[found->second].ids.push_back(id);
            } else {
                by_mask[geometry->mask] = groups.size();
                groups.push_back({geometry->mask, {id}});
            }
        }
        return groups;
    }

    [[nodiscard]] const MeshView& mesh_of(std::uint32_t id) const {
        return state_.geometries.at(id).mesh;
    }

    /// In triangles.
    [[nodiscard]] double work_of(const Group& group) const {
        if (kept(group) != nullptr) return 0;
        std::size_t triangles = 0;
        for (const std::uint32_t id : group.ids) triangles += mesh_of(id).triangles.size();
        return static_cast<double>(triangles);
    }

    /// The tree that the last commit made of the same meshes in the same way.
    [[nodiscard]] const MeshTree* last_of(const Group& group) const {
        const auto found = last_.find(group.ids.front());
        return found != last_.end() && found->second->ids == group.ids ? found->second : nullptr;
    }
    /// The same if nothing of them changed.
    [[nodiscard]] const MeshTree* kept(const Group& group) const {
        for (const std::uint32_t id : group.ids)
            if (state_.geometries.at(id).changed) return nullptr;
        return last_of(group);
    }

    std::shared_ptr<const MeshTree> tree_of(const Group& group) {
        auto out = std::make_shared<MeshTree>();
        out->ids = group.ids;
        out->mask = group.mask;
        if (const MeshTree* const old = kept(group)) {
            out->first = old->first;
            out->triangles = old->triangles;
            out->sah_at_build = old->sah_at_build;
            Maker::keep(*old, *out);
        } else if (!refit(group, *out)) {
            if (group.ids.size() == 1) {
                const MeshView& mesh = mesh_of(group.ids.front());
                out->first = {0};
                out->triangles = mesh.triangles.size();
                maker_.build(mesh, options_, last_of(group), *out);
            } else {
                std::vector<MeshView> meshes;
                for (const std::uint32_t id : group.ids) meshes.push_back(mesh_of(id));
                const Mesh mesh = merged<Mesh, MeshView>(meshes, out->first);
                out->triangles = mesh.triangles.size();
                maker_.build(mesh, options_, last_of(group), *out);
            }
            ++report_.trees_built;
        }
        if (options_.usage == Usage::moving)
            if (const MeshTree* const old = last_of(group)) Maker::share_rates(*old, *out);
        out->left_out = Maker::left_out(*out);
        out->make_buckets();
        return out;
    }

    void refuse(const MeshTree& tree) const {
        using Box = BasicAabb<Scalar>;
        for (const std::uint32_t id : tree.ids) {
            const MeshView& mesh = mesh_of(id);
            refuse_left_out<Box>(id, "triangle", source_of(mesh), mesh.triangles.size());
        }
    }

    /// The last tree around one mesh whose vertices moved, if it is still good enough.
    bool refit(const Group& group, MeshTree& out) {
        if (options_.usage != Usage::moving || options_.refit_limit < 1 || group.ids.size() != 1)
            return false;
        const MeshTree* const old = last_of(group);
        if (old == nullptr) return false;
        const MeshView& mesh = mesh_of(group.ids.front());
        out.sah_at_build = old->sah_at_build;
        const std::optional<double> now = Maker::refit(*old, mesh, options_, out);
        if (!now) return false;
        const double then = out.sah_at_build, ratio = *now > 0 && then > 0 ? *now / then : 1.0;
        report_.sah_ratio = std::max(report_.sah_ratio, ratio);
        if (ratio > options_.refit_limit) return false;
        ++report_.trees_refitted;
        out.first = {0};
        out.triangles = mesh.triangles.size();
        return true;
    }

    const State& state_;
    const OwnGeometries<Scalar>& own_;
    const SceneOptions& options_;
    CommitReport& report_;
    Maker maker_;
    std::unordered_map<std::uint32_t, const MeshTree*> last_;  // by their first mesh
    double done_ = 0;
};

/// Counts an instance of `inner` in `tree`; the number of its path. Throws InputError: never
/// committed, too many levels or paths.
template <class Tree>
std::uint32_t number_instance(Tree& tree, std::uint32_t id,
                              const std::shared_ptr<const Tree>& inner) {
    const auto name = [id] { return "instance " + std::to_string(id); };
    if (inner == nullptr)
        throw InputError(name() + ": the scene that it places was never committed");
    if (inner->levels >= Scene::max_levels)
        throw InputError(name() + ": more than " + std::to_string(Scene::max_levels) +
                         " levels of instances");
    tree.levels = std::max(tree.levels, inner->levels + 1);
    const auto number = static_cast<std::uint32_t>(tree.paths + 1);
    tree.paths += 1 + inner->paths;
    if (tree.paths > no_primitive - 1)
        throw InputError(name() + ": more than 2^32 - 2 paths through instances");
    return number;
}

[[noreturn]] inline void refuse_reach(std::uint32_t id) {
    throw InputError("instance " + std::to_string(id) +
                     ": it reaches beyond 1e12, or is not finite");
}

/// What trees over parts are built with: boxes cannot be split.
inline Quality quality_of_parts(const SceneOptions& options) {
    return options.usage == Usage::moving || options.quality == Quality::fast ? Quality::fast
                                                                              : Quality::balanced;
}

/// Runs make(), which makes a scene's tree, with the threads and the listener of the options.
template <class Make>
auto run_commit(const SceneOptions& options, const Make& make) {
    decltype(make()) out;
    ProgressListener listener(options.progress);
    const ProgressStage stage({options.progress ? &listener : nullptr, 0, 1});
    with_threads(options.threads, [&] { out = make(); });
    listener.finish();
    return out;
}

}  // namespace raydix
