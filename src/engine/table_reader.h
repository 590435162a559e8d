// Tables of scenes -> what they hold, each thing checked before it is used; of either number type.
// How a scene comes to its trees is the caller's.
#pragma once

#include <raydix/error.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "engine/commit.h"
#include "engine/scene_state.h"
#include "engine/scene_tables.h"
#include "engine/shape_tree.h"
#include "exec/search.h"

namespace raydix {

[[noreturn]] inline void fail_in(const std::string& section, const std::string& reason) {
    throw InputError(section + ": " + reason);
}

/// Hands out the elements of a section from the first on.
template <class T>
class TableSupply {
public:
    TableSupply(const char* section, std::span<const T> all) : section_(section), rest_(all) {}

    std::span<const T> take(std::uint64_t count, const std::string& whose) {
        if (count > rest_.size())
            fail_in(section_, whose + " has " + std::to_string(count) + ", but " +
                                  std::to_string(rest_.size()) + " are left");
        const std::span<const T> out = rest_.first(count);
        rest_ = rest_.subspan(count);
        return out;
    }
    void finish() const {
        if (!rest_.empty()) fail_in(section_, std::to_string(rest_.size()) + " belong to nothing");
    }

private:
    const char* section_;
    std::span<const T> rest_;
};

template <class Scalar>
class TableReader {
public:
    explicit TableReader(const BasicSceneArrays<Scalar>& arrays) : in_(arrays) {}

protected:
    using State = typename BasicSceneInternals<Scalar>::State;
    using View = BasicMeshView<Scalar>;
    using Stored = BasicStoredGeometry<Scalar>;
    template <class T>
    using Supply = TableSupply<T>;

    /// read_trees(): when the meshes are there. commit(k, geometries, options, state): gives scene
    /// k its tree. `explained`: placed parts that a file of this size may have beside its
    /// geometries.
    template <class ReadTrees, class Commit>
    std::shared_ptr<State> read(const ReadTrees& read_trees, const Commit& commit,
                                std::size_t explained) {
        explained_ = explained;
        read_meshes();
        read_trees();
        read_shapes();
        if (in_.scenes.empty()) fail("scenes", "there are none");
        Supply<Stored> geometries("geometries", in_.geometries);
        for (std::size_t k = 0; k < in_.scenes.size(); ++k)
            read_scene(k, geometries.take(in_.scenes[k].geometry_count, name_of(k)), commit);
        geometries.finish();
        check_use();
        read_ids(*scenes_.back());
        return scenes_.back();
    }

    [[noreturn]] static void fail(const std::string& section, const std::string& reason) {
        fail_in(section, reason);
    }
    static std::string name_of(std::size_t scene) { return "scene " + std::to_string(scene); }

    /// What a commit of scene k makes.
    auto make_tree(std::size_t k, const State& state, const SceneOptions& options,
                   CommitReport& report) const {
        try {
            return make_scene_tree(state, options, report, most_placed());
        } catch (const InputError& error) {
            fail("geometries", name_of(k) + ": " + error.what());
        }
    }

    const BasicSceneArrays<Scalar>& in_;
    std::vector<View> meshes_;

private:
    static constexpr bool builds_trees = std::is_same_v<Scalar, double>;

    void read_meshes() {
        Supply<BasicVec3<Scalar>> vertices("vertices", in_.vertices);
        Supply<Triangle> triangles("triangles", in_.triangles);
        for (const StoredMesh& mesh : in_.meshes) {
            const std::string name = "mesh " + std::to_string(meshes_.size());
            const View view(vertices.take(mesh.vertices, name),
                            triangles.take(mesh.triangles, name));
            if (view.triangles.empty()) fail("meshes", name + " has no triangles");
            meshes_.push_back(view);
        }
        vertices.finish();
        triangles.finish();
        for (std::size_t m = 0; m < meshes_.size(); ++m) {
            const View& mesh = meshes_[m];
            const std::size_t bad = first_index_where(mesh.triangles.size(), [&](std::size_t i) {
                return std::ranges::max(mesh.triangles[i]) >= mesh.vertices.size();
            });
            if (bad < mesh.triangles.size())
                fail("triangles", "triangle " + std::to_string(bad) + " of mesh " +
                                      std::to_string(m) + " has an index past the " +
                                      std::to_string(mesh.vertices.size()) + " vertices");
        }
    }

    void read_shapes() {
        Supply<BasicSphere<Scalar>> spheres("spheres", in_.spheres);
        Supply<BasicCapsule<Scalar>> capsules("capsules", in_.capsules);
        Supply<BasicVec3<Scalar>> points("points", in_.points);
        for (const BasicStoredShapes<Scalar>& stored : in_.shapes) {
            const std::string name = "shapes " + std::to_string(shapes_.size());
            if (stored.kind == 0)
                shapes_.emplace_back(spheres.take(stored.count, name));
            else if (stored.kind == 1)
                shapes_.emplace_back(capsules.take(stored.count, name));
            else if (stored.kind == 2)
                shapes_.emplace_back(
                    BasicBalls<Scalar>{points.take(stored.count, name), stored.radius});
            else
                fail("shapes", name + " are of an unknown kind");
            if constexpr (std::is_same_v<Scalar, double>)
                if (stored.reserved != 0)
                    fail("shapes", name + " have reserved bytes that are not zero");
            if (stored.kind != 2 && stored.radius != 0)
                fail("shapes", name + " have a radius each, and one more");
        }
        spheres.finish();
        capsules.finish();
        points.finish();
        used_shapes_.resize(shapes_.size());
    }

    template <class Commit>
    void read_scene(std::size_t k, std::span<const Stored> geometries, const Commit& commit) {
        const StoredScene& stored = in_.scenes[k];
        if (stored.quality > static_cast<std::uint32_t>(Quality::high) ||
            stored.usage > static_cast<std::uint32_t>(Usage::moving) || stored.compact > 1)
            fail("scenes", name_of(k) + " was made with unknown options");
        auto state = std::make_shared<State>();
        for (std::size_t g = 0; g < geometries.size(); ++g) {
            const Stored& geometry = geometries[g];
            if (geometry.id == no_primitive || (g > 0 && geometry.id <= geometries[g - 1].id))
                fail("geometries", name_of(k) + " has the id " + std::to_string(geometry.id) +
                                       ", which does not follow the one before");
            state->geometries.emplace_hint(state->geometries.end(), geometry.id,
                                           geometry_of(k, geometry));
        }
        const SceneOptions options{.quality = static_cast<Quality>(stored.quality),
                                   .usage = static_cast<Usage>(stored.usage),
                                   .compact = stored.compact != 0};
        commit(k, geometries, options, *state);
        placed_ += state->tree->placed.size();
        state->changed = false;
        scenes_.push_back(std::move(state));
    }

    typename State::Geometry geometry_of(std::size_t scene, const Stored& stored) {
        typename State::Geometry out;
        out.mask = stored.mask;
        out.changed = builds_trees;
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
                BasicSceneInternals<Scalar>::place(stored.id, stored.transform, out);
            } catch (const InputError& error) {
                fail("geometries", name_of(scene) + ": " + error.what());
            }
            return out;
        }
        if (const auto zeros = no_transform<BasicTransform<Scalar>>();
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
        used_meshes_.resize(meshes_.size());
        if (builds_trees && used_meshes_[stored.number])
            fail("geometries", name + " is mesh " + std::to_string(stored.number) + " once more");
        used_meshes_[stored.number] = true;
        out.mesh = meshes_[stored.number];
        out.own = in_.owner;
        return out;
    }

    /// A few small scenes in each other may place very many parts: where they would come to more
    /// than a file of this size explains, they stay in their instances, with the same hits.
    [[nodiscard]] std::size_t most_placed() const {
        constexpr std::size_t spare = std::size_t{1} << 17;
        const std::size_t usual = spare + in_.geometries.size() + explained_;
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

    std::vector<std::shared_ptr<State>> scenes_;
    std::vector<BasicShapes<Scalar>> shapes_;
    std::vector<bool> used_, used_meshes_, used_shapes_;
    std::size_t placed_ = 0, explained_ = 0;
};

}  // namespace raydix
