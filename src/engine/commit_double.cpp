// Commits in double: as commit.cpp, with trees of doubles and one over the parts.
#include <raydix/error.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "engine/commit.h"
#include "engine/mesh_commit.h"
#include "engine/part_tree.h"
#include "engine/settled.h"
#include "engine/shape_commit.h"
#include "tree/build_by_quality.h"

namespace raydix {
namespace {

/// Trees of triangles in double (mesh_commit.h).
struct WideMakerD {
    static void build(const MeshViewD& mesh, const SceneOptions& options, const MeshTreeD*,
                      MeshTreeD& out) {
        out.tree = build_by_quality(
            options.quality, options.threads, mesh.triangles.size(),
            [&](const BuildOptions& build) { return build_wide_tree(mesh, build); },
            [](const auto& tree) { return tree->arrays.stats.sah; });
        out.sah_at_build = out.tree->arrays.stats.sah;
    }
    static std::uint64_t left_out(const MeshTreeD& made) {
        return made.tree->arrays.stats.left_out;
    }
    static void share_rates(const MeshTreeD&, MeshTreeD&) {}  // a scene has them
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
    using Geometry = SceneInternalsD::State::Geometry;

public:
    CommitD(const SceneInternalsD::State& state, const SceneOptions& options, CommitReport& report,
            std::size_t most_placed)
        : state_(state), options_(options), report_(report), most_placed_(most_placed) {
        tree_->quality = options.quality;
        tree_->usage = options.usage;
        tree_->compact = options.compact;
    }

    std::shared_ptr<const SceneTreeD> run() {
        OwnGeometries<double> own;
        state_.for_each([&](std::uint32_t id, const Geometry& geometry) {
            if (geometry.is_instance()) return;
            own.emplace_back(id, &geometry);
            if (geometry.is_mesh())
                tree_->mesh_names.push_back({id, geometry.mask, geometry.mesh, geometry.own});
        });
        const std::size_t instances = state_.geometries.size() - own.size();
        MeshCommit<double, WideMakerD> meshes(state_, own, options_, report_);
        ShapeCommit<double> shapes(state_, own, options_, report_);
        const double other_work = shapes.work() + static_cast<double>(instances);
        tree_->meshes = meshes.run(other_work);
        for (const auto& mesh : tree_->meshes) add_extent(*mesh->tree);
        const ProgressStage others(meshes.part_done(), 1);
        progress_at(0);
        const double made = shapes.run(other_work, [&](const auto& tree) {
            tree_->shapes.push_back(tree);
            tree_->extents.push_back(tree->around);
            unite_with(tree_->bounds, tree->bounds);
        });
        place_instances();
        const ProgressStage top(made, 1);
        progress_at(0);
        build_top(*tree_);
        if (options_.usage == Usage::moving && state_.tree != nullptr)
            tree_->rates.share(state_.tree->rates);
        keep_own_parts();
        if (tree_->only_mesh() == nullptr)
            report_.bytes += tree_->parts.arrays.nodes.size() * sizeof(WideNode) +
                             tree_->placed.size() * sizeof(PlacedSceneD) +
                             tree_->ways.size() * sizeof(WayInD);
        list_masks();
        report_.instances = tree_->instances.size();
        report_.paths = tree_->paths;
        return std::move(tree_);
    }

private:
    void add_extent(const WideTreeD& mesh) {
        tree_->extents.push_back(extent_of_triangles(mesh.empty() ? nothing_d : mesh.bounds));
        report_.bytes += mesh.bytes();
        if (!mesh.empty()) unite_with(tree_->bounds, mesh.bounds);
    }

    void place_instances() {
        state_.for_each([&](std::uint32_t id, const Geometry& geometry) {
            if (!geometry.is_instance()) return;
            const auto& inner = geometry.scene->tree;
            const std::uint32_t number = number_instance(*tree_, id, inner);
            tree_->instances.push_back(
                {id, geometry.mask, number, geometry.transform, geometry.inverse, inner});
            place({{geometry.inverse, geometry.mask}, number, 0, 0, inner.get()},
                  {id, affine_of(geometry.transform), geometry.inverse});
        });
    }

    /// An instance of this scene.
    struct Outermost {
        std::uint32_t id;
        AffineD map;
        const InverseD& inverse;
    };

    /// All that one instance places, nested instances opened.
    void place(const PlacedSceneD& whole, const Outermost& by) {
        const SceneTreeD& inner = *whole.scene;
        if (inner.instances.empty() ||
            tree_->placed.size() + inner.placed.size() + 1 > most_placed_) {
            add(whole, ImageD(inner.parts.around), by);
            return;
        }
        PlacedSceneD part = whole;
        if (inner.own_parts != nullptr) {
            part.scene = inner.own_parts.get();
            add(part, ImageD(part.scene->parts.around), by);
        }
        for (std::size_t k = 0; k < inner.placed.size(); ++k) {
            const PlacedSceneD& below = inner.placed[k];
            part.number = whole.number + below.number;
            part.first = static_cast<std::uint32_t>(tree_->ways.size());
            part.more = below.more + 1;
            part.scene = below.scene;
            tree_->ways.push_back(below.way);
            for (std::uint32_t w = 0; w < below.more; ++w)
                tree_->ways.push_back(inner.ways[below.first + w]);
            add(part, inner.images[k], by);
        }
    }
    /// `image`: in the instance's scene.
    void add(const PlacedSceneD& part, ImageD image, const Outermost& by) {
        image.go_through(by.map, by.inverse);
        tree_->placed.push_back(part);
        tree_->images.push_back(image);
        tree_->stack_size = std::max(tree_->stack_size, part.scene->stack_size);
        const ExtentD& own = part.scene->parts.around;
        tree_->extents.push_back(is_empty(own) ? ExtentD{nothing_d, 0.0} : image.extent(own));
        if (is_empty(own)) return;
        const ExtentD& extent = tree_->extents.back();
        if (!in_range(extent)) refuse_reach(by.id);
        unite_with(tree_->bounds, extent.box);
    }

    void list_masks() {
        std::vector<std::uint32_t>& all = tree_->masks;
        const SceneTreeD* last = nullptr;
        state_.for_each([&](std::uint32_t, const Geometry& one) { all.push_back(one.mask); });
        for (const InstanceNameD& instance : tree_->instances) {
            if (instance.scene.get() == last) continue;  // most place what the one before them does
            last = instance.scene.get();
            all.insert(all.end(), last->masks.begin(), last->masks.end());
        }
        std::ranges::sort(all);
        all.erase(std::unique(all.begin(), all.end()), all.end());
    }

    /// The meshes and shapes alone, for scenes that place this one.
    void keep_own_parts() {
        const std::size_t count = tree_->own_part_count();
        if (tree_->instances.empty() || count == 0) return;
        auto own = std::make_shared<SceneTreeD>();
        own->meshes = tree_->meshes;
        own->shapes = tree_->shapes;
        own->extents.assign(tree_->extents.begin(),
                            tree_->extents.begin() + static_cast<std::ptrdiff_t>(count));
        build_top(*own);
        tree_->own_parts = std::move(own);
    }

    void build_top(SceneTreeD& tree) {
        for (const auto& mesh : tree.meshes)
            tree.stack_size =
                std::max(tree.stack_size, wide_stack_capacity(mesh->tree->arrays.stats.max_depth));
        for (const auto& shapes : tree.shapes)
            tree.stack_size =
                std::max(tree.stack_size, wide_stack_capacity(shapes->arrays.stats.max_depth));
        build_part_tree(tree.extents, quality_of_parts(options_), tree.parts);
        tree.stack_size += wide_stack_capacity(tree.parts.arrays.stats.max_depth);
    }

    const SceneInternalsD::State& state_;
    const SceneOptions& options_;
    CommitReport& report_;
    std::size_t most_placed_;
    std::shared_ptr<SceneTreeD> tree_ = std::make_shared<SceneTreeD>();
};

}  // namespace

std::shared_ptr<const SceneTreeD> make_scene_tree(const SceneInternalsD::State& state,
                                                  const SceneOptions& options, CommitReport& report,
                                                  std::size_t most_placed) {
    return run_commit(options, [&] {
        if (!is_settled(state, options)) return CommitD(state, options, report, most_placed).run();
        report = report_of_no_change(*state.report);
        return state.tree;
    });
}

}  // namespace raydix
