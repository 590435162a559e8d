// What commits in float and in double share: meshes -> trees, each built, refitted or kept;
// instances -> numbers of paths; how far the commit is.
#pragma once

#include <raydix/error.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
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
        keeps_trees_ = state.tree != nullptr && options.quality == state.tree->quality &&
                       options.compact == state.tree->compact;
    }

    /// The trees. `parts`: how many other parts the tree over all of them has, for what is told of
    /// progress: a part counts as a triangle.
    std::vector<std::shared_ptr<const MeshTree>> run(double parts) {
        const std::vector<Group> groups = groups_of(options_.usage);
        double work = static_cast<double>(groups.size()) + parts, done = 0, small_work = 0;
        for (const Group& group : groups) work += work_of(group);
        // Threads share the work within a mesh. Of few triangles it is too little, but not if there
        // are many such meshes.
        const auto is_small = [](const Group& group) { return work_of(group) <= few_to_share; };
        const bool side_by_side = std::ranges::count_if(groups, is_small) >= many_to_share;
        std::vector<std::size_t> large, small;
        for (std::size_t k = 0; k < groups.size(); ++k) {
            const bool with_others = side_by_side && is_small(groups[k]);
            if (with_others) small_work += work_of(groups[k]);
            (with_others ? small : large).push_back(k);
        }
        std::vector<Made> made(groups.size());
        for (const std::size_t k : large) {
            const double after = done + work_of(groups[k]);
            const ProgressStage stage(done / work, after / work);
            made[k] = tree_of(groups[k]);
            progress_at(1);
            done = after;
        }
        if (!small.empty()) {
            const double after = done + small_work;
            const bool all_have_some = small.size() >= static_cast<std::size_t>(thread_count());
            const ProgressCounter counter(small_work, done / work, after / work);
            for_each_index(
                small.size(),
                [&](std::size_t k) {
                    const ProgressStage silent(ProgressSpan{});
                    std::optional<LoopsStayHere> alone;
                    if (all_have_some) alone.emplace();
                    const Group& group = groups[small[k]];
                    made[small[k]] = tree_of(group);
                    counter.add(work_of(group));
                },
                1);
            done = after;
        }
        done_ = work > 0 ? done / work : 1;
        std::vector<std::shared_ptr<const MeshTree>> trees;
        trees.reserve(groups.size());
        for (const Made& one : made) {
            const MeshTree& tree = *one.tree;
            report_.meshes += tree.ids.size();
            report_.triangles += tree.triangles;
            report_.left_out += tree.left_out;
            report_.trees_built += one.built;
            report_.trees_refitted += one.refitted;
            report_.sah_ratio = std::max(report_.sah_ratio, one.sah_ratio);
            if (options_.strict && tree.left_out != 0) refuse(tree);
            trees.push_back(one.tree);
        }
        return trees;
    }
    /// Of the whole commit, after `run`.
    [[nodiscard]] double part_done() const { return done_; }

private:
    using Member = typename OwnGeometries<Scalar>::value_type;

    /// Meshes that one tree holds.
    struct Group {
        std::span<const Member> members;  // by ascending id
        /// The tree that the last commit made of the same meshes in the same way; or null.
        std::shared_ptr<const MeshTree> last = {};
        bool changed = true;  // since then

        [[nodiscard]] std::uint32_t mask() const { return members.front().second->mask; }
        [[nodiscard]] std::uint32_t first_id() const { return members.front().first; }
    };

    /// What became of a group. Groups are at work on several threads at once.
    struct Made {
        std::shared_ptr<const MeshTree> tree = {};
        bool built = false, refitted = false;
        double sah_ratio = 0;  // 0: no refit was tried
    };
    static constexpr double few_to_share = 4096;         // triangles
    static constexpr std::ptrdiff_t many_to_share = 64;  // meshes

    /// By ascending id of their first mesh.
    std::vector<Group> groups_of(Usage usage) {
        members_.reserve(own_.size());
        for (const Member& member : own_)
            if (member.second->is_mesh() && !member.second->mesh.triangles.empty())
                members_.push_back(member);
        std::vector<std::size_t> sizes;
        if (usage == Usage::fixed)
            sizes = sort_by_mask();
        else
            sizes.assign(members_.size(), 1);
        std::vector<Group> groups;
        groups.reserve(sizes.size());
        std::size_t done = 0, old = 0;
        for (const std::size_t size : sizes) {
            Group group{std::span(members_).subspan(done, size)};
            find_last(old, group);
            groups.push_back(std::move(group));
            done += size;
        }
        return groups;
    }

    /// Brings meshes of the same mask together, where the first of them stands; how many each.
    std::vector<std::size_t> sort_by_mask() {
        std::map<std::uint32_t, std::size_t> by_mask;
        std::vector<std::vector<Member>> groups;
        for (const Member& member : members_) {
            const auto [found, is_new] = by_mask.try_emplace(member.second->mask, groups.size());
            if (is_new) groups.emplace_back();
            groups[found->second].push_back(member);
        }
        members_.clear();
        std::vector<std::size_t> sizes;
        for (const auto& group : groups) {
            members_.insert(members_.end(), group.begin(), group.end());
            sizes.push_back(group.size());
        }
        return sizes;
    }

    /// Trees of the last commit lie by ascending id of their first mesh, too. `old`: all before it
    /// begin with a lower id than the group.
    void find_last(std::size_t& old, Group& group) const {
        if (!keeps_trees_) return;
        const auto& trees = state_.tree->meshes;
        while (old < trees.size() && trees[old]->ids.front() < group.first_id()) ++old;
        if (old == trees.size() ||
            !std::ranges::equal(trees[old]->ids, group.members, {}, {}, &Member::first))
            return;
        group.last = trees[old];
        group.changed = std::ranges::any_of(
            group.members, [](const Member& member) { return member.second->changed; });
    }

    /// In triangles.
    [[nodiscard]] static double work_of(const Group& group) {
        if (!group.changed) return 0;
        std::size_t triangles = 0;
        for (const auto& [id, geometry] : group.members)
            triangles += geometry->mesh.triangles.size();
        return static_cast<double>(triangles);
    }

    Made tree_of(const Group& group) {
        if (!group.changed && group.last->mask == group.mask()) return {group.last};
        Made made;
        std::shared_ptr<MeshTree> out;
        if (!group.changed) {
            out = std::make_shared<MeshTree>(*group.last);
        } else {
            out = std::make_shared<MeshTree>();
            for (const auto& [id, geometry] : group.members) out->ids.push_back(id);
            made.refitted = refit(group, *out, made.sah_ratio);
            made.built = !made.refitted;
            if (made.built) build(group, *out);
            if (options_.usage == Usage::moving && group.last != nullptr)
                Maker::share_rates(*group.last, *out);
            out->left_out = Maker::left_out(*out);
            out->make_buckets();
        }
        out->mask = group.mask();
        made.tree = std::move(out);
        return made;
    }

    void build(const Group& group, MeshTree& out) {
        if (group.members.size() == 1) {
            const MeshView& mesh = group.members.front().second->mesh;
            out.first = {0};
            out.triangles = mesh.triangles.size();
            maker_.build(mesh, options_, group.last.get(), out);
            return;
        }
        std::vector<MeshView> meshes;
        for (const auto& [id, geometry] : group.members) meshes.push_back(geometry->mesh);
        const Mesh mesh = merged<Mesh, MeshView>(meshes, out.first);
        out.triangles = mesh.triangles.size();
        maker_.build(mesh, options_, group.last.get(), out);
    }

    void refuse(const MeshTree& tree) const {
        using Box = BasicAabb<Scalar>;
        for (const std::uint32_t id : tree.ids) {
            const MeshView& mesh = state_.geometries.at(id).mesh;
            refuse_left_out<Box>(id, "triangle", source_of(mesh), mesh.triangles.size());
        }
    }

    /// The last tree around one mesh whose vertices moved, if it is still good enough. `ratio`: of
    /// its SAH to that at its build.
    bool refit(const Group& group, MeshTree& out, double& ratio) {
        if (options_.usage != Usage::moving || options_.refit_limit < 1 ||
            group.members.size() != 1)
            return false;
        const MeshTree* const old = group.last.get();
        if (old == nullptr) return false;
        const MeshView& mesh = group.members.front().second->mesh;
        out.sah_at_build = old->sah_at_build;
        const std::optional<double> now = Maker::refit(*old, mesh, options_, out);
        if (!now) return false;
        const double then = out.sah_at_build;
        ratio = *now > 0 && then > 0 ? *now / then : 1.0;
        if (ratio > options_.refit_limit) return false;
        out.first = {0};
        out.triangles = mesh.triangles.size();
        return true;
    }

    const State& state_;
    const OwnGeometries<Scalar>& own_;
    const SceneOptions& options_;
    CommitReport& report_;
    Maker maker_;
    bool keeps_trees_ = false;     // those of the last commit are made in the same way
    std::vector<Member> members_;  // meshes that have triangles, those of a group in a row
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
