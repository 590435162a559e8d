// Tables -> a scene. Trees of triangles are used where they lie; what stands above them is made
// anew by an ordinary commit of each scene, which finds no mesh changed.
#include <raydix/error.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>

#include "engine/commit.h"
#include "engine/scene_state.h"
#include "engine/scene_tables.h"
#include "engine/shape_tree.h"
#include "exec/parallel.h"
#include "exec/search.h"
#include "layout/wide_check.h"

namespace raydix {
namespace {

using State = SceneInternals::State;

[[noreturn]] void fail(const std::string& section, const std::string& reason) {
    throw InputError(section + ": " + reason);
}

/// Hands out the elements of a section from the first on.
template <class T>
class Supply {
public:
    Supply(const char* section, std::span<const T> all) : section_(section), rest_(all) {}

    std::span<const T> take(std::uint64_t count, const std::string& whose) {
        if (count > rest_.size())
            fail(section_, whose + " has " + std::to_string(count) + ", but " +
                               std::to_string(rest_.size()) + " are left");
        const std::span<const T> out = rest_.first(count);
        rest_ = rest_.subspan(count);
        return out;
    }
    void finish() const {
        if (!rest_.empty()) fail(section_, std::to_string(rest_.size()) + " belong to nothing");
    }

private:
    const char* section_;
    std::span<const T> rest_;
};

class SceneReader {
public:
    explicit SceneReader(const SceneArrays& arrays) : in_(arrays) {}

    std::shared_ptr<State> read() {
        read_meshes();
        read_trees();
        read_shapes();
        if (in_.scenes.empty()) fail("scenes", "there are none");
        Supply geometries("geometries", in_.geometries);
        for (std::size_t k = 0; k < in_.scenes.size(); ++k)
            read_scene(k, geometries.take(in_.scenes[k].geometry_count, name_of(k)));
        geometries.finish();
        check_use();
        read_ids(*scenes_.back());
        return scenes_.back();
    }

private:
    static std::string name_of(std::size_t scene) { return "scene " + std::to_string(scene); }

    void read_meshes() {
        Supply vertices("vertices", in_.vertices);
        Supply triangles("triangles", in_.triangles);
        for (const StoredMesh& mesh : in_.meshes) {
            const std::string name = "mesh " + std::to_string(meshes_.size());
            const MeshView view(vertices.take(mesh.vertices, name),
                                triangles.take(mesh.triangles, name));
            if (view.triangles.empty()) fail("meshes", name + " has no triangles");
            meshes_.push_back(view);
        }
        vertices.finish();
        triangles.finish();
        for (std::size_t m = 0; m < meshes_.size(); ++m) {
            const MeshView& mesh = meshes_[m];
            const std::size_t bad = first_index_where(mesh.triangles.size(), [&](std::size_t i) {
                return std::ranges::max(mesh.triangles[i]) >= mesh.vertices.size();
            });
            if (bad < mesh.triangles.size())
                fail("triangles", "triangle " + std::to_string(bad) + " of mesh " +
                                      std::to_string(m) + " has an index past the " +
                                      std::to_string(mesh.vertices.size()) + " vertices");
        }
    }

    void read_trees() {
        Supply nodes("nodes", in_.nodes);
        Supply blocks("blocks", in_.blocks);
        Supply compact_nodes("compact_nodes", in_.compact_nodes);
        Supply compact_blocks("compact_blocks", in_.compact_blocks);
        Supply corners("corners", in_.corners);
        Supply meshes("meshes", std::span<const MeshView>(meshes_));
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

    void read_shapes() {
        Supply spheres("spheres", in_.spheres);
        Supply capsules("capsules", in_.capsules);
        Supply points("points", in_.points);
        for (const StoredShapes& stored : in_.shapes) {
            const std::string name = "shapes " + std::to_string(shapes_.size());
            if (stored.kind == 0)
                shapes_.emplace_back(spheres.take(stored.count, name));
            else if (stored.kind == 1)
                shapes_.emplace_back(capsules.take(stored.count, name));
            else if (stored.kind == 2)
                shapes_.emplace_back(
                    BasicBalls<float>{points.take(stored.count, name), stored.radius});
            else
                fail("shapes", name + " are of an unknown kind");
            if (stored.kind != 2 && stored.radius != 0)
                fail("shapes", name + " have a radius each, and one more");
        }
        spheres.finish();
        capsules.finish();
        points.finish();
        used_shapes_.resize(shapes_.size());
    }

    /// Nobody writes through the pointer: trees are handed out as const only.
    template <class T>
    [[nodiscard]] Buffer<T> buffer(std::span<const T> elements) const {
        return {in_.owner, const_cast<T*>(elements.data()), elements.size()};
    }

    void read_scene(std::size_t k, std::span<const StoredGeometry> geometries) {
        const StoredScene& stored = in_.scenes[k];
        if (stored.quality > static_cast<std::uint32_t>(Quality::high) ||
            stored.usage > static_cast<std::uint32_t>(Usage::moving) || stored.compact > 1)
            fail("scenes", name_of(k) + " was made with unknown options");
        auto state = std::make_shared<State>();
        for (std::size_t g = 0; g < geometries.size(); ++g) {
            const StoredGeometry& geometry = geometries[g];
            if (geometry.id == no_primitive || (g > 0 && geometry.id <= geometries[g - 1].id))
                fail("geometries", name_of(k) + " has the id " + std::to_string(geometry.id) +
                                       ", which does not follow the one before");
            state->geometries.emplace_hint(state->geometries.end(), geometry.id,
                                           geometry_of(k, geometry));
        }
        const SceneOptions options{.quality = static_cast<Quality>(stored.quality),
                                   .usage = static_cast<Usage>(stored.usage),
                                   .compact = stored.compact != 0};
        state->tree = tree_of_meshes(k, geometries, options);
        CommitReport report;
        try {
            state->tree = make_scene_tree(*state, options, report, most_placed());
        } catch (const InputError& error) {
            fail("geometries", name_of(k) + ": " + error.what());
        }
        // Trees of shapes are made anew.
        if (report.trees_built != report.shapes)
            fail("trees", "those of " + name_of(k) + " are around other meshes than its own");
        placed_ += state->tree->placed.size();
        state->changed = false;
        scenes_.push_back(std::move(state));
    }

    State::Geometry geometry_of(std::size_t scene, const StoredGeometry& stored) {
        State::Geometry out;
        out.mask = stored.mask;
        out.changed = false;
        const std::string name = name_of(scene) + ": geometry " + std::to_string(stored.id);
        if (stored.kind > stored_shapes) fail("geometries", name + " is of an unknown kind");
        if (stored.kind == stored_instance) {
            if (stored.number >= scene)
                fail("geometries",
                     name + " shows " + name_of(stored.number) + ", which is not before it");
            out.scene = scenes_[stored.number];
            used_.resize(in_.scenes.size());
            used_[stored.number] = true;
            try {
                SceneInternals::place(stored.id, stored.transform, out);
            } catch (const InputError& error) {
                fail("geometries", name_of(scene) + ": " + error.what());
            }
            return out;
        }
        if (const Transform zeros = no_transform();
            std::memcmp(&stored.transform, &zeros, sizeof(zeros)) != 0)
            fail("geometries", name + " is no instance, but has a transform");
        if (stored.kind == stored_shapes) {
            if (stored.number >= shapes_.size())
                fail("geometries", name + " is shapes " + std::to_string(stored.number) + " of " +
                                       std::to_string(shapes_.size()));
            if (used_shapes_[stored.number])
                fail("geometries",
                     name + " is shapes " + std::to_string(stored.number) + " once more");
            used_shapes_[stored.number] = true;
            out.shapes = shapes_[stored.number];
            out.own = in_.owner;
            return out;
        }
        if (stored.number == stored_none) return out;
        if (stored.number >= meshes_.size())
            fail("geometries", name + " is mesh " + std::to_string(stored.number) + " of " +
                                   std::to_string(meshes_.size()));
        out.mesh = meshes_[stored.number];
        out.own = in_.owner;
        return out;
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
            mesh.ids.push_back(geometry.id);
            mesh.first.push_back(static_cast<std::uint32_t>(mesh.triangles));
            mesh.triangles += meshes_[geometry.number].triangles.size();
            used_meshes_.resize(meshes_.size());
            used_meshes_[geometry.number] = true;
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
            mesh->make_buckets();
            out->meshes.push_back(std::move(mesh));
        }
        return out;
    }

    /// A few small scenes in each other may place very many parts: where they would come to more
    /// than a file of this size explains, they stay in their instances, with the same hits.
    [[nodiscard]] std::size_t most_placed() const {
        constexpr std::size_t spare = std::size_t{1} << 17;
        const std::size_t usual =
            spare + in_.geometries.size() + (in_.nodes.size() + in_.blocks.size()) / 16;
        return placed_ >= usual ? 0 : std::min(usual - placed_, usually_placed);
    }

    /// Whether all that is there is shown.
    void check_use() {
        used_.resize(in_.scenes.size());
        for (std::size_t k = 0; k + 1 < used_.size(); ++k)
            if (!used_[k]) fail("scenes", name_of(k) + " stands nowhere");
        used_meshes_.resize(meshes_.size());
        for (std::size_t m = 0; m < used_meshes_.size(); ++m)
            if (!used_meshes_[m]) fail("meshes", "mesh " + std::to_string(m) + " stands nowhere");
        for (std::size_t k = 0; k < used_shapes_.size(); ++k)
            if (!used_shapes_[k]) fail("shapes", "shapes " + std::to_string(k) + " stand nowhere");
    }

    void read_ids(State& state) const {
        const auto& ids = in_.taken;
        if (in_.next_id > no_primitive)
            fail("info", "the next id is " + std::to_string(in_.next_id));
        for (std::size_t k = 0; k < ids.size(); ++k)
            if (ids[k] == no_primitive || (k == 0 ? ids[k] <= in_.next_id : ids[k] <= ids[k - 1]))
                fail("taken", "id " + std::to_string(ids[k]) + " is out of order");
        state.next_id = in_.next_id;
        state.taken = std::set<std::uint32_t>(ids.begin(), ids.end());
        for (const auto& [id, geometry] : state.geometries)
            if (id >= state.next_id && !state.taken.contains(id))
                fail("taken", "id " + std::to_string(id) + " was given, but is not among them");
    }

    struct Tree {
        std::shared_ptr<const WideBvh> wide;
        double sah_at_build;
        std::uint32_t first_mesh;
    };

    const SceneArrays& in_;
    std::vector<MeshView> meshes_;
    std::vector<Tree> trees_;
    std::vector<std::size_t> tree_of_;  // [meshes]
    std::vector<std::shared_ptr<State>> scenes_;
    std::vector<Shapes> shapes_;
    std::vector<bool> used_, used_meshes_, used_shapes_;
    std::size_t placed_ = 0;
};

}  // namespace

Scene scene_of(const SceneArrays& arrays) {
    std::shared_ptr<State> state;
    with_threads(0, [&] { state = SceneReader(arrays).read(); });
    return SceneInternals::scene_of(std::move(state));
}

}  // namespace raydix
