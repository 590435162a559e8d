// Commits in double: as commit.cpp, with trees of doubles and one over the parts.
#include <raydix/error.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "engine/commit.h"
#include "engine/mesh_commit.h"
#include "engine/part_tree.h"

namespace raydix {
namespace {

/// Trees of triangles in double (mesh_commit.h).
struct WideMakerD {
    static void build(const MeshViewD& mesh, const SceneOptions& options, MeshTreeD& out) {
        BuildOptions build = build_options_for(options.quality);
        build.threads = options.threads;
        out.tree = build_wide_tree(mesh, build);
        out.sah_at_build = out.tree->arrays.stats.sah;
    }
    static void keep(const MeshTreeD& old, MeshTreeD& out) { out.tree = old.tree; }
    static std::optional<double> refit(const MeshTreeD& old, const MeshViewD& mesh,
                                       const SceneOptions&, MeshTreeD& out) {
        out.tree = refit_wide_tree(*old.tree, mesh);
        if (out.tree == nullptr) return {};
        return out.tree->arrays.stats.sah;
    }
};

void unite_with(AabbD& box, const AabbD& other) {
    box = {min_of(box.lo, other.lo), max_of(box.hi, other.hi)};
}

class CommitD {
public:
    CommitD(const SceneAccessD::State& state, const SceneOptions& options, CommitReport& report)
        : state_(state), options_(options), report_(report) {
        tree_->quality = options.quality;
        tree_->compact = options.compact;
    }

    std::shared_ptr<const SceneTreeD> run() {
        std::size_t instances = 0;
        for (const auto& [id, geometry] : state_.geometries)
            if (geometry.is_instance())
                ++instances;
            else
                tree_->mesh_names.push_back({id, geometry.mask, geometry.mesh, geometry.own});
        MeshCommit<double, WideMakerD> meshes(state_, options_, report_);
        tree_->meshes = meshes.run(static_cast<double>(instances));
        for (const auto& mesh : tree_->meshes) add_extent(*mesh->tree);
        place_instances();
        const ProgressStage top(meshes.part_done(), 1);
        progress_at(0);
        build_top();
        report_.instances = tree_->instances.size();
        report_.paths = tree_->paths;
        return std::move(tree_);
    }

private:
    void add_extent(const WideTreeD& mesh) {
        extents_.push_back(extent_of_triangles(mesh.empty() ? nothing_d : mesh.bounds));
        report_.bytes += mesh.bytes();
        tree_->stack_size =
            std::max(tree_->stack_size, wide_stack_capacity(mesh.arrays.stats.max_depth));
        if (!mesh.empty()) unite_with(tree_->bounds, mesh.bounds);
    }

    void place_instances() {
        for (const auto& [id, geometry] : state_.geometries) {
            if (!geometry.is_instance()) continue;
            const auto& inner = geometry.scene->tree;
            const std::uint32_t number = number_instance(*tree_, id, inner);
            tree_->instances.push_back(
                {id, number, geometry.mask, geometry.inverse, geometry.transform, inner});
            const ExtentD& around = inner->parts.around;
            ExtentD extent{nothing_d, 0.0};
            if (!is_empty(around))
                extent = image_of(affine_of(geometry.transform), geometry.inverse, around);
            extents_.push_back(extent);
            tree_->stack_size = std::max(tree_->stack_size, inner->stack_size);
            if (is_empty(around)) continue;
            if (!in_range(extent)) refuse_reach(id);
            unite_with(tree_->bounds, extent.box);
        }
    }

    void build_top() {
        build_part_tree(extents_, quality_of_parts(options_), tree_->parts);
        tree_->stack_size += wide_stack_capacity(tree_->parts.arrays.stats.max_depth);
        if (tree_->only_mesh() == nullptr)
            report_.bytes += tree_->parts.arrays.nodes.size() * sizeof(WideNode) +
                             tree_->instances.size() * sizeof(PlacedSceneD);
    }

    const SceneAccessD::State& state_;
    const SceneOptions& options_;
    CommitReport& report_;
    std::vector<ExtentD> extents_;  // [parts]
    std::shared_ptr<SceneTreeD> tree_ = std::make_shared<SceneTreeD>();
};

}  // namespace

std::shared_ptr<const SceneTreeD> make_scene_tree(const SceneAccessD::State& state,
                                                  const SceneOptions& options,
                                                  CommitReport& report) {
    return run_commit(options, [&] { return CommitD(state, options, report).run(); });
}

}  // namespace raydix
