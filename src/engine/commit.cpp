#include "engine/commit.h"

#include <memory>
#include <optional>
#include <utility>

#include "engine/mesh_commit.h"
#include "engine/part_tree.h"
#include "engine/settled.h"
#include "engine/shape_commit.h"
#include "engine/shape_tree.h"
#include "exec/parallel.h"
#include "exec/recycler.h"
#include "exec/thread_own.h"
#include "layout/wide_refit.h"
#include "tree/build_by_quality.h"

namespace raydix {
namespace {

using Geometry = SceneInternals::State::Geometry;

/// Trees of triangles in float (mesh_commit.h).
struct WideMaker {
    Recycler<WideBvhBuilder> builders;  // copies share what is kept

    /// A second build of the same meshes tells that more may come: from then on memory is kept. Of
    /// few triangles it is little, and there may be many such meshes: threads keep it.
    void build(const MeshView& mesh, const SceneOptions& options, const MeshTree* last,
               MeshTree& out) {
        out.memory = last != nullptr && last->memory ? *last->memory : Recycler<WideBvh>();
        std::unique_ptr<WideBvh> built = build_by_quality(
            options.quality, options.threads, mesh.triangles.size(),
            [&](const BuildOptions& build) {
                std::unique_ptr<WideBvh> tree = taken_or_new(*out.memory);
                if (mesh.triangles.size() <= few_triangles) {
                    const ThreadOwn<WideBvhBuilder> builder;
                    builder->build(mesh, build, *tree, {.compact = options.compact});
                    return tree;
                }
                std::unique_ptr<WideBvhBuilder> builder = taken_or_new(builders);
                builder->build(mesh, build, *tree, {.compact = options.compact});
                if (last != nullptr) builders.give(std::move(builder));
                return tree;
            },
            [](const auto& tree) { return tree->stats().sah; });
        out.sah_at_build = built->stats().sah;
        out.refitter = nullptr;  // a refit that was tried had other links
        finish(out.memory->share(std::move(built)), out);
    }
    static std::uint64_t left_out(const MeshTree& made) { return made.tree->stats().left_out; }
    static void share_rates(const MeshTree& old, MeshTree& out) {
        out.tree->arrays().rates.share(old.tree->arrays().rates);
    }
    static std::optional<double> refit(const MeshTree& old, const MeshView& mesh,
                                       const SceneOptions&, MeshTree& out) {
        out.refitter = old.refitter != nullptr ? old.refitter : WideRefitter::of(*old.tree);
        if (out.refitter == nullptr) return {};
        std::shared_ptr<const WideBvh> tree = out.refitter->refit(*old.tree, mesh);
        if (tree == nullptr) return {};
        const double sah = tree->stats().sah;
        finish(std::move(tree), out);
        return sah;
    }

private:
    template <class T>
    static std::unique_ptr<T> taken_or_new(Recycler<T>& kept) {
        std::unique_ptr<T> taken = kept.take();
        return taken != nullptr ? std::move(taken) : std::make_unique<T>();
    }
    static void finish(std::shared_ptr<const WideBvh> tree, MeshTree& out) {
        out.set_tree(std::move(tree));
    }
};

class Commit {
public:
    Commit(const SceneInternals::State& state, const SceneOptions& options, CommitReport& report,
           std::size_t most_placed)
        : state_(state), options_(options), report_(report), most_placed_(most_placed) {
        tree_->quality = options.quality;
        tree_->usage = options.usage;
        tree_->compact = options.compact;
    }

    std::shared_ptr<const SceneTree> run() {
        state_.for_each([&](std::uint32_t id, const Geometry& geometry) {
            (geometry.is_instance() ? instances_ : own_).emplace_back(id, &geometry);
        });
        for (const auto& [id, geometry] : own_)
            if (geometry->is_mesh())
                tree_->mesh_names.push_back({id, geometry->mask, geometry->mesh, geometry->own});
        if (state_.tree != nullptr) tree_->builders = state_.tree->builders;
        MeshCommit<float, WideMaker> meshes(state_, own_, options_, report_, {tree_->builders});
        ShapeCommit<float> shapes(state_, own_, options_, report_);
        const double other_work = shapes.work() + parts_of_instances();
        tree_->meshes = meshes.run(other_work);
        if (tree_->meshes.empty()) tree_->builders = {};
        for (const auto& mesh : tree_->meshes) {
            report_.bytes += mesh->tree->stats().bytes;
            tree_->extents.emplace_back();
            if (mesh->tree->empty()) continue;  // its bounds are zeros
            const Aabb& bounds = mesh->tree->arrays().bounds;
            tree_->extents.back() = extent_of_mesh(bounds);
            tree_->bounds = unite(tree_->bounds, bounds);
        }
        const ProgressStage others(meshes.part_done(), 1);
        progress_at(0);
        const double made = shapes.run(other_work, [&](const auto& tree) {
            tree_->shapes.push_back(tree);
            tree_->extents.push_back(tree->extent);
            tree_->bounds = unite(tree_->bounds, tree->bounds);
        });
        const ProgressStage top(made, 1);
        place_instances();
        const bool may_refit = options_.usage == Usage::moving && options_.refit_limit >= 1 &&
                               state_.tree != nullptr && state_.tree->quality == options_.quality &&
                               state_.tree->usage == options_.usage;
        build_tops(*tree_, may_refit ? state_.tree.get() : nullptr);
        if (options_.usage == Usage::moving && state_.tree != nullptr)
            tree_->rates.share(state_.tree->rates);
        keep_own_parts();
        report_.instances = tree_->instances.size();
        report_.paths = tree_->paths;
        return std::move(tree_);
    }

private:
    /// Parts that instances become.
    [[nodiscard]] double parts_of_instances() const {
        double parts = 0;
        for (const auto& [id, geometry] : instances_)
            if (geometry->scene->tree != nullptr)
                parts += 1 + static_cast<double>(geometry->scene->tree->placed.size());
        return parts;
    }

    /// A scene to place, and what leads to it.
    struct Source {
        const Geometry* geometry;
        std::uint32_t id;
        std::uint32_t number;       // of the path that ends there
        std::uint32_t first, more;  // further ways in SceneTree::ways
        const SceneTree* scene;
        const Image* inner;      // in the scene of the outermost instance; null: that is it
        const Support* support;  // of the scene; null if it is empty
    };

    void place_instances() {
        tree_->instances.reserve(instances_.size());
        sources_.reserve(instances_.size());
        for (const auto& [id, geometry] : instances_) {
            const auto& inner = geometry->scene->tree;
            const std::uint32_t number = number_instance(*tree_, id, inner);
            tree_->instances.push_back({id, geometry->mask, number, geometry->transform, inner});
            add_sources({geometry, id, number, 0, 0, inner.get(), nullptr, nullptr});
        }
        place_sources();
    }

    /// All that one instance places, nested instances opened.
    void add_sources(const Source& whole) {
        const SceneTree& inner = *whole.scene;
        if (inner.instances.empty() || sources_.size() + inner.placed.size() + 1 > most_placed_) {
            add_source(whole);
            return;
        }
        Source part = whole;
        if (inner.own_parts != nullptr) {
            part.scene = inner.own_parts.get();
            add_source(part);
        }
        for (std::size_t k = 0; k < inner.placed.size(); ++k) {
            const PlacedScene& below = inner.placed[k];
            part.number = whole.number + below.number;
            part.first = static_cast<std::uint32_t>(tree_->ways.size());
            part.more = below.more + 1;
            part.scene = below.scene;
            part.inner = &inner.images[k];
            tree_->ways.push_back(below.way);
            for (std::uint32_t w = 0; w < below.more; ++w)
                tree_->ways.push_back(inner.ways[below.first + w]);
            add_source(part);
        }
    }
    void add_source(Source source) {
        // Most instances place what the one before them places.
        if (!sources_.empty() && sources_.back().scene == source.scene) {
            source.support = sources_.back().support;
        } else {
            source.support = source.scene->extent.empty() ? nullptr : &source.scene->support();
            tree_->stack_size = std::max(tree_->stack_size, source.scene->stack_size);
        }
        sources_.push_back(source);
    }

    void place_sources() {
        const std::size_t own = tree_->extents.size();
        tree_->extents.resize(own + sources_.size());
        tree_->images.reset(sources_.size());
        tree_->placed.reset(sources_.size());
        for_each_index(
            sources_.size(),
            [&](std::size_t i) {
                const Source& source = sources_[i];
                const Geometry& geometry = *source.geometry;
                const bool empty = source.support == nullptr;
                tree_->placed[i] = {WayIn(geometry.inverse, geometry.mask),
                                    source.number,
                                    source.first,
                                    source.more,
                                    source.scene,
                                    empty ? nullptr : source.scene->only_mesh()};
                Image& image = tree_->images[i];
                image = image_of(affine_of(geometry.transform), geometry.errors,
                                 source.inner ? *source.inner : image_of(source.scene->extent),
                                 source.scene->extent.error);
                if (!empty) tree_->extents[own + i] = extent_of(image, *source.support);
            },
            256);
        for (std::size_t i = 0; i < sources_.size(); ++i) {
            const Extent& extent = tree_->extents[own + i];
            if (sources_[i].support == nullptr) continue;
            if (!(in_range(extent.box.lo) && in_range(extent.box.hi))) refuse_reach(sources_[i].id);
            tree_->bounds = unite(tree_->bounds, extent.box);
        }
    }

    /// The meshes and shapes alone, for scenes that place this one.
    void keep_own_parts() {
        const std::size_t count = tree_->own_part_count();
        if (tree_->instances.empty() || count == 0) return;
        auto own = std::make_shared<SceneTree>();
        own->meshes = tree_->meshes;
        own->shapes = tree_->shapes;
        own->mesh_names = tree_->mesh_names;
        own->extents.assign(tree_->extents.begin(),
                            tree_->extents.begin() + static_cast<std::ptrdiff_t>(count));
        build_tops(*own, nullptr);
        tree_->own_parts = std::move(own);
    }

    /// The trees over parts; `last`: that of the last commit, whose nodes may stay; or null.
    void build_tops(SceneTree& tree, const SceneTree* last) {
        for (const Extent& extent : tree.extents) tree.extent = unite(tree.extent, extent);
        for (const auto& mesh : tree.meshes)
            tree.stack_size =
                std::max(tree.stack_size, wide_stack_capacity(mesh->tree->stats().max_depth));
        for (const auto& shapes : tree.shapes)
            tree.stack_size =
                std::max(tree.stack_size, wide_stack_capacity(shapes->arrays.stats.max_depth));
        if (tree.only_mesh() != nullptr || tree.only_shapes() != nullptr) return;
        const Quality quality = quality_of_parts(options_);
        std::vector<std::uint32_t> near, wild;
        for (std::uint32_t part = 0; part < tree.extents.size(); ++part)
            if (!tree.extents[part].empty())
                (is_wild(tree.extents[part]) ? wild : near).push_back(part);
        const auto make = [&](const std::vector<std::uint32_t>& parts, PartTree SceneTree::*which) {
            const PartTree* const old = last == nullptr ? nullptr : &(last->*which);
            if (old != nullptr &&
                refit_part_tree(*old, parts, tree.extents, options_.refit_limit, tree.*which))
                report_.parts_refitted = true;
            else
                build_part_tree(parts, tree.extents, quality, tree.*which);
        };
        make(near, &SceneTree::near);
        make(wild, &SceneTree::wild);
        tree.stack_size += wide_stack_capacity(
            std::max(tree.near.arrays.stats.max_depth, tree.wild.arrays.stats.max_depth));
        report_.bytes +=
            (tree.near.arrays.nodes.size() + tree.wild.arrays.nodes.size()) * sizeof(WideNode) +
            tree.placed.size() * sizeof(PlacedScene) + tree.ways.size() * sizeof(WayIn);
    }

    const SceneInternals::State& state_;
    const SceneOptions& options_;
    CommitReport& report_;
    const std::size_t most_placed_;
    std::shared_ptr<SceneTree> tree_ = std::make_shared<SceneTree>();
    std::vector<std::pair<std::uint32_t, const Geometry*>> instances_;  // by ascending id
    OwnGeometries<float> own_;
    std::vector<Source> sources_;  // [placed scenes]
};

}  // namespace

std::shared_ptr<const SceneTree> make_scene_tree(const SceneInternals::State& state,
                                                 const SceneOptions& options, CommitReport& report,
                                                 std::size_t most_placed) {
    return run_commit(options, [&] {
        if (!is_settled(state, options)) return Commit(state, options, report, most_placed).run();
        report = report_of_no_change(*state.report);
        return state.tree;
    });
}

}  // namespace raydix
