// Tables -> a scene. Trees of triangles are used where they lie; what stands above them is made
// anew by an ordinary commit of each scene, which finds no mesh changed.
#include <raydix/error.h>

#include <cmath>
#include <string>
#include <unordered_map>
#include <utility>

#include "engine/commit.h"
#include "engine/scene_state.h"
#include "engine/scene_tables.h"
#include "engine/table_reader.h"
#include "exec/parallel.h"
#include "layout/local_pads.h"
#include "layout/wide_check.h"

namespace raydix {
namespace {

class SceneReader : TableReader<float> {
public:
    using TableReader::TableReader;

    std::shared_ptr<State> run() {
        return read([&] { read_trees(); }, [&](auto&&... scene) { commit(scene...); },
                    (in_.nodes.size() + in_.blocks.size()) / 16);
    }

private:
    void read_trees() {
        Supply<WideNode> nodes("nodes", in_.nodes);
        Supply<TriangleBlock> blocks("blocks", in_.blocks);
        Supply<CompactNode> compact_nodes("compact_nodes", in_.compact_nodes);
        Supply<CompactBlock> compact_blocks("compact_blocks", in_.compact_blocks);
        Supply<Vec3> corners("corners", in_.corners);
        Supply<MeshView> meshes("meshes", std::span<const MeshView>(meshes_));
        std::uint32_t first = 0;
        for (const StoredTree& tree : in_.trees) {
            const std::string name = "tree " + std::to_string(trees_.size());
            const auto own = meshes.take(tree.meshes, name);
            if (own.empty()) fail("trees", name + " has no meshes");
            if (tree.compact > 1) fail("trees", name + " is of an unknown kind");
            const auto is_figure = [](double x) { return std::isfinite(x) && x >= 0; };
            if (!is_figure(tree.sah) || !is_figure(tree.sah_at_build) || !is_figure(tree.widening))
                fail("trees", name + " has figures that are negative or not finite");
            auto arrays = std::make_unique<WideBvh::Arrays>();
            arrays->clear({.width = quantised_width, .compact = tree.compact != 0});
            if (tree.compact != 0) {
                arrays->compact_nodes = buffer(compact_nodes.take(tree.nodes, name));
                arrays->compact_blocks = buffer(compact_blocks.take(tree.blocks, name));
            } else {
                arrays->nodes = buffer(nodes.take(tree.nodes, name));
                arrays->blocks = buffer(blocks.take(tree.blocks, name));
            }
            arrays->vertices = buffer(corners.take(tree.corners, name));
            arrays->set_bounds(tree.bounds);
            if (const Fault fault = wide_fault(*arrays, own, arrays->stats))
                throw InputError(*fault + " (" + name + ")");
            arrays->stats.sah = tree.sah;
            arrays->stats.widening = tree.widening;
            settle_local_pads(*arrays);
            tree_of_.insert(tree_of_.end(), own.size(), trees_.size());
            trees_.push_back(
                {std::make_shared<const WideBvh>(WideBvhInternals::tree_of(std::move(arrays))),
                 tree.sah_at_build, first});
            first += tree.meshes;
        }
        nodes.finish();
        blocks.finish();
        compact_nodes.finish();
        compact_blocks.finish();
        corners.finish();
        meshes.finish();
    }

    /// Nobody writes through the pointer: trees are handed out as const only.
    template <class T>
    [[nodiscard]] Buffer<T> buffer(std::span<const T> elements) const {
        return {in_.owner, const_cast<T*>(elements.data()), elements.size()};
    }

    /// The same trees, which a commit finds unchanged.
    void commit(std::size_t k, std::span<const StoredGeometry> geometries,
                const SceneOptions& options, State& state) {
        state.tree = tree_of_meshes(k, geometries, options);
        CommitReport report;
        state.tree = make_tree(k, state, options, report);
        // Trees of shapes are made anew.
        if (report.trees_built != report.shapes)
            fail("trees", "those of " + name_of(k) + " are around other meshes than its own");
    }

    /// What a commit looks for among the trees of the last one.
    std::shared_ptr<const SceneTree> tree_of_meshes(std::size_t k,
                                                    std::span<const StoredGeometry> geometries,
                                                    const SceneOptions& options) {
        std::vector<std::pair<std::size_t, std::shared_ptr<MeshTree>>> trees;  // their numbers
        std::unordered_map<std::size_t, std::size_t> place;                    // in `trees`
        for (const StoredGeometry& geometry : geometries) {
            if (geometry.kind != stored_mesh || geometry.number == stored_none) continue;
            const std::size_t number = tree_of_[geometry.number];
            const auto [found, is_new] = place.emplace(number, trees.size());
            if (is_new) trees.emplace_back(number, std::make_shared<MeshTree>());
            MeshTree& mesh = *trees[found->second].second;
            if (geometry.number != trees_[number].first_mesh + mesh.ids.size())
                fail("geometries", name_of(k) + ": geometry " + std::to_string(geometry.id) +
                                       " is mesh " + std::to_string(geometry.number) +
                                       " out of the order of its tree");
            mesh.mask = geometry.mask;  // a commit finds them under one, or not at all
            mesh.ids.push_back(geometry.id);
            mesh.first.push_back(static_cast<std::uint32_t>(mesh.triangles));
            mesh.triangles += meshes_[geometry.number].triangles.size();
        }
        auto out = std::make_shared<SceneTree>();
        out->quality = options.quality;
        out->usage = options.usage;
        out->compact = options.compact;
        for (auto& [number, mesh] : trees) {
            const Tree& tree = trees_[number];
            if (mesh->ids.size() != in_.trees[number].meshes)
                fail("trees", "those of " + name_of(k) + " are around other meshes than its own");
            if (tree.wide->stats().compact != options.compact)
                fail("trees", "tree " + std::to_string(number) + " is not of the kind that " +
                                  name_of(k) + " has");
            mesh->set_tree(tree.wide);
            mesh->sah_at_build = tree.sah_at_build;
            mesh->left_out = tree.wide->stats().left_out;
            mesh->make_buckets();
            out->meshes.push_back(std::move(mesh));
        }
        return out;
    }

    struct Tree {
        std::shared_ptr<const WideBvh> wide;
        double sah_at_build;
        std::uint32_t first_mesh;
    };

    std::vector<Tree> trees_;
    std::vector<std::size_t> tree_of_;  // [meshes]
};

/// In double trees are no part of the tables: each scene's first commit builds them.
class SceneReaderD : TableReader<double> {
public:
    using TableReader::TableReader;

    std::shared_ptr<State> run() {
        const auto commit = [&](std::size_t k, std::span<const StoredGeometryD>,
                                const SceneOptions& options, State& state) {
            CommitReport report;
            state.tree = make_tree(k, state, options, report);
            for (auto& [id, geometry] : state.geometries) geometry.changed = false;
        };
        return read([] {}, commit, in_.triangles.size() / 64);
    }
};

}  // namespace

Scene scene_of(const SceneArrays& arrays) {
    std::shared_ptr<SceneInternals::State> state;
    with_threads(0, [&] { state = SceneReader(arrays).run(); });
    return SceneInternals::scene_of(std::move(state));
}

SceneD scene_of(const SceneArraysD& arrays) {
    std::shared_ptr<SceneInternalsD::State> state;
    with_threads(0, [&] { state = SceneReaderD(arrays).run(); });
    return SceneInternalsD::scene_of(std::move(state));
}

}  // namespace raydix
