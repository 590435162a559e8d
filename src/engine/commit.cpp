#include "engine/commit.h"

#include <raydix/error.h>

#include <limits>
#include <optional>
#include <string>
#include <unordered_map>

#include "engine/part_tree.h"
#include "exec/parallel.h"
#include "exec/progress.h"
#include "layout/wide_refit.h"

namespace raydix {
namespace {

using Geometry = SceneAccess::State::Geometry;

/// Parts whose error is larger stand in a tree of their own.
constexpr double wild_error = 0x1p-12;

/// Meshes that one tree holds.
struct Group {
    std::uint32_t mask;
    std::vector<std::uint32_t> ids;
};

std::vector<Group> groups_of(const SceneAccess::State& state, Usage usage) {
    std::vector<Group> groups;
    std::map<std::uint32_t, std::size_t> by_mask;
    for (const auto& [id, geometry] : state.geometries) {
        if (geometry.is_instance() || geometry.mesh.triangles.empty()) continue;
        const auto found = by_mask.find(geometry.mask);
        if (usage == Usage::fixed && found != by_mask.end()) {
            groups[found->second].ids.push_back(id);
        } else {
            by_mask[geometry.mask] = groups.size();
            groups.push_back({geometry.mask, {id}});
        }
    }
    return groups;
}

/// The meshes behind each other.
Mesh merged(const SceneAccess::State& state, const Group& group,
            std::vector<std::uint32_t>& first) {
    std::size_t vertices = 0, triangles = 0;
    for (const std::uint32_t id : group.ids) {
        const MeshView& mesh = state.geometries.at(id).mesh;
        first.push_back(static_cast<std::uint32_t>(triangles));
        vertices += mesh.vertices.size();
        triangles += mesh.triangles.size();
    }
    if (std::max(vertices, triangles) >= no_primitive)
        throw InputError("scene: " + std::to_string(triangles) + " triangles of " +
                         std::to_string(vertices) + " vertices are too many for one tree");
    Mesh out;
    out.vertices.resize(vertices);
    out.triangles.resize(triangles);
    std::size_t vertex = 0;
    for (std::size_t k = 0; k < group.ids.size(); ++k) {
        const MeshView& mesh = state.geometries.at(group.ids[k]).mesh;
        std::copy(mesh.vertices.begin(), mesh.vertices.end(), out.vertices.begin() + vertex);
        const auto offset = static_cast<std::uint32_t>(vertex);
        for_each_index(mesh.triangles.size(), [&](std::size_t i) {
            const Triangle& t = mesh.triangles[i];
            out.triangles[first[k] + i] = {t[0] + offset, t[1] + offset, t[2] + offset};
        });
        vertex += mesh.vertices.size();
    }
    return out;
}

class Commit {
public:
    Commit(const SceneAccess::State& state, const SceneOptions& options, CommitReport& report,
           std::size_t most_placed)
        : state_(state), options_(options), report_(report), most_placed_(most_placed) {
        tree_->quality = options.quality;
        tree_->usage = options.usage;
        if (state.tree == nullptr || options.quality != state.tree_quality ||
            options.compact != state.tree_compact)
            return;
        for (const auto& mesh : state.tree->meshes) last_[mesh->ids.front()] = mesh.get();
    }

    std::shared_ptr<const SceneTree> run() {
        build_meshes();
        for (const auto& mesh : tree_->meshes) {
            tree_->extents.push_back(extent_of_mesh(mesh->tree->arrays().bounds));
            report_.meshes += mesh->ids.size();
            report_.triangles += mesh->triangles;
            report_.bytes += mesh->tree->stats().bytes;
            if (!mesh->tree->empty())
                tree_->bounds = unite(tree_->bounds, mesh->tree->arrays().bounds);
        }
        for (const auto& [id, geometry] : state_.geometries)
            if (!geometry.is_instance())
                tree_->mesh_names.push_back({id, geometry.mask, geometry.mesh, geometry.own});
        place_instances();
        progress_at(done_ / work_);
        const ProgressStage top(done_ / work_, 1);
        build_tops(*tree_);
        keep_own_meshes();
        report_.instances = tree_->instances.size();
        report_.paths = tree_->paths;
        return std::move(tree_);
    }

private:
    void build_meshes() {
        const std::vector<Group> groups = groups_of(state_, options_.usage);
        for (const Group& group : groups) work_ += work_of(group);
        work_ += static_cast<double>(groups.size()) + instance_work();
        for (const Group& group : groups) {
            const double after = done_ + work_of(group);
            const ProgressStage stage(done_ / work_, after / work_);
            tree_->meshes.push_back(mesh_tree(group));
            progress_at(1);
            done_ = after;
        }
    }

    /// In triangles, for what is told of progress; a part of the tree over all counts as one.
    [[nodiscard]] double work_of(const Group& group) const {
        if (kept(group) != nullptr) return 0;
        std::size_t triangles = 0;
        for (const std::uint32_t id : group.ids)
            triangles += state_.geometries.at(id).mesh.triangles.size();
        return static_cast<double>(triangles);
    }
    [[nodiscard]] double instance_work() const {
        double parts = 0;
        for (const auto& [id, geometry] : state_.geometries)
            if (geometry.is_instance() && geometry.scene->tree != nullptr)
                parts += 1 + static_cast<double>(geometry.scene->tree->placed.size());
        return parts;
    }

    std::shared_ptr<const MeshTree> mesh_tree(const Group& group) {
        auto out = std::make_shared<MeshTree>();
        out->ids = group.ids;
        out->mask = group.mask;
        if (const MeshTree* const old = kept(group)) {
            out->tree = old->tree, out->first = old->first, out->triangles = old->triangles;
            out->view = old->view;
            out->sah_at_build = old->sah_at_build;
            out->make_buckets();
            return out;
        }
        if (refit(group, *out)) return out;
        WideBvh built;
        WideBvhBuilder builder;
        BuildOptions build = build_options_for(options_.quality);
        build.threads = options_.threads;
        const WideBvhOptions wide{.compact = options_.compact};
        if (group.ids.size() == 1) {
            const MeshView& mesh = state_.geometries.at(group.ids.front()).mesh;
            out->first = {0};
            out->triangles = mesh.triangles.size();
            builder.build(mesh, build, built, wide);
        } else {
            const Mesh mesh = merged(state_, group, out->first);
            out->triangles = mesh.triangles.size();
            builder.build(mesh, build, built, wide);
        }
        ++report_.trees_built;
        out->sah_at_build = built.stats().sah;
        finish(std::move(built), *out);
        return out;
    }

    static void finish(WideBvh tree, MeshTree& out) {
        out.make_buckets();
        out.tree = std::make_shared<const WideBvh>(std::move(tree));
        TriangleBlock none;
        out.view = view_of(out.tree->arrays(), none);
        out.view.room = nullptr;
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

    /// The last tree around one mesh whose vertices moved, if it is still good enough.
    bool refit(const Group& group, MeshTree& out) {
        if (options_.usage != Usage::moving || options_.refit_limit < 1) return false;
        const MeshTree* const old = last_of(group);
        if (old == nullptr) return false;
        const MeshView& mesh = state_.geometries.at(group.ids.front()).mesh;
        std::optional<WideBvh> tree =
            group.ids.size() == 1 ? refit_wide(*old->tree, mesh) : std::nullopt;
        if (!tree) return false;
        const double now = tree->stats().sah, then = old->sah_at_build;
        const double ratio = now > 0 && then > 0 ? now / then : 1.0;
        report_.sah_ratio = std::max(report_.sah_ratio, ratio);
        if (ratio > options_.refit_limit) return false;
        ++report_.trees_refitted;
        out.first = {0};
        out.triangles = mesh.triangles.size();
        out.sah_at_build = then;
        finish(std::move(*tree), out);
        return true;
    }

    void place_instances() {
        for (const auto& [id, geometry] : state_.geometries) {
            if (!geometry.is_instance()) continue;
            const auto name = [named = id] { return "instance " + std::to_string(named); };
            const auto& inner = geometry.scene->tree;
            if (inner == nullptr)
                throw InputError(name() + ": the scene that it places was never committed");
            if (inner->levels >= Scene::max_levels)
                throw InputError(name() + ": more than " + std::to_string(Scene::max_levels) +
                                 " levels of instances");
            tree_->levels = std::max(tree_->levels, inner->levels + 1);
            const auto number = static_cast<std::uint32_t>(tree_->paths + 1);
            tree_->paths += 1 + inner->paths;
            if (tree_->paths > no_primitive - 1)
                throw InputError(name() + ": more than 2^32 - 2 paths through instances");
            tree_->instances.push_back({id, geometry.mask, number, geometry.transform, inner});
            place(geometry, id, number, inner);
        }
        set_extents();
    }

    /// Where the box of a placed scene comes from.
    struct Source {
        const Geometry* geometry;
        std::uint32_t id;
        const Image* inner;      // null: the scene itself
        const SceneTree* scene;  // what is placed
        const Support* support;  // its own; null if it is empty
    };

    void place(const Geometry& geometry, std::uint32_t id, std::uint32_t number,
               const std::shared_ptr<const SceneTree>& inner) {
        const WayIn way(geometry.inverse, geometry.mask);
        const auto add = [&](PlacedScene placed, const Image* image) {
            const SceneTree* const scene = placed.scene.get();
            sources_.push_back(
                {&geometry, id, image, scene, scene->extent.empty() ? nullptr : &scene->support()});
            if (!scene->extent.empty()) placed.mesh = scene->only_mesh();
            tree_->placed.push_back(std::move(placed));
        };
        if (inner->instances.empty() ||
            tree_->placed.size() + inner->placed.size() + 1 > most_placed_) {
            add({way, number, 0, 0, inner}, nullptr);
            return;
        }
        if (inner->own_meshes != nullptr) add({way, number, 0, 0, inner->own_meshes}, nullptr);
        for (std::size_t k = 0; k < inner->placed.size(); ++k) {
            const PlacedScene& below = inner->placed[k];
            const auto first = static_cast<std::uint32_t>(tree_->ways.size());
            tree_->ways.push_back(below.way);
            for (std::uint32_t w = 0; w < below.more; ++w)
                tree_->ways.push_back(inner->ways[below.first + w]);
            add({way, number + below.number, first, below.more + 1, below.scene},
                &inner->images[k]);
        }
    }

    void set_extents() {
        const std::size_t meshes = tree_->extents.size();
        tree_->extents.resize(meshes + sources_.size());
        tree_->images.resize(sources_.size());
        for_each_index(
            sources_.size(),
            [&](std::size_t i) {
                const Source& source = sources_[i];
                const Geometry& geometry = *source.geometry;
                Image& image = tree_->images[i];
                image = image_of(affine_of(geometry.transform), geometry.errors,
                                 source.inner ? *source.inner : image_of(source.scene->extent));
                if (source.support != nullptr)
                    tree_->extents[meshes + i] = extent_of(image, *source.support);
            },
            256);
        for (std::size_t i = 0; i < sources_.size(); ++i) {
            const Extent& extent = tree_->extents[meshes + i];
            if (sources_[i].support == nullptr) continue;
            if (!(in_range(extent.box.lo) && in_range(extent.box.hi)))
                throw InputError("instance " + std::to_string(sources_[i].id) +
                                 ": it reaches beyond 1e12, or is not finite");
            tree_->bounds = unite(tree_->bounds, extent.box);
        }
    }

    /// The meshes alone, for scenes that place this one.
    void keep_own_meshes() {
        if (tree_->instances.empty() || tree_->meshes.empty()) return;
        auto own = std::make_shared<SceneTree>();
        own->meshes = tree_->meshes;
        own->extents.assign(
            tree_->extents.begin(),
            tree_->extents.begin() + static_cast<std::ptrdiff_t>(tree_->meshes.size()));
        build_tops(*own);
        tree_->own_meshes = std::move(own);
    }

    void build_tops(SceneTree& tree) {
        for (const Extent& extent : tree.extents) tree.extent = unite(tree.extent, extent);
        for (const auto& mesh : tree.meshes)
            tree.stack_size =
                std::max(tree.stack_size, wide_stack_capacity(mesh->tree->stats().max_depth));
        if (tree.only_mesh() != nullptr) return;
        const Quality quality = options_.usage == Usage::moving ? Quality::fast : options_.quality;
        std::vector<std::uint32_t> near, wild;
        for (std::uint32_t part = 0; part < tree.extents.size(); ++part)
            if (!tree.extents[part].empty())
                (tree.extents[part].error <= wild_error ? near : wild).push_back(part);
        build_part_tree(near, tree.extents, quality, tree.near);
        build_part_tree(wild, tree.extents, quality, tree.wild);
        for (const PlacedScene& placed : tree.placed)
            tree.stack_size = std::max(tree.stack_size, placed.scene->stack_size);
        tree.stack_size += wide_stack_capacity(
            std::max(tree.near.arrays.stats.max_depth, tree.wild.arrays.stats.max_depth));
        report_.bytes +=
            (tree.near.arrays.nodes.size() + tree.wild.arrays.nodes.size()) * sizeof(WideNode) +
            tree.placed.size() * sizeof(PlacedScene) + tree.ways.size() * sizeof(WayIn);
    }

    const SceneAccess::State& state_;
    const SceneOptions& options_;
    CommitReport& report_;
    const std::size_t most_placed_;
    std::shared_ptr<SceneTree> tree_ = std::make_shared<SceneTree>();
    std::vector<Source> sources_;                              // [placed scenes]
    std::unordered_map<std::uint32_t, const MeshTree*> last_;  // by their first mesh
    double work_ = 0, done_ = 0;
};

}  // namespace

std::shared_ptr<const SceneTree> make_scene_tree(const SceneAccess::State& state,
                                                 const SceneOptions& options,
                                                 CommitReport& report, std::size_t most_placed) {
    std::shared_ptr<const SceneTree> out;
    ProgressListener listener(options.progress);
    const ProgressStage stage({options.progress ? &listener : nullptr, 0, 1});
    with_threads(options.threads, [&] { out = Commit(state, options, report, most_placed).run(); });
    listener.finish();
    return out;
}

}  // namespace raydix
