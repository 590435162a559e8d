// Whether the arrays that a scene shares with its owner still hold what the last commit made its
// trees of.
#pragma once

#include <raydix/error.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include "engine/scene_tree.h"
#include "engine/scene_tree_double.h"
#include "primitives/double_sources.h"
#include "primitives/sources.h"
#include "primitives/zero_area.h"
#include "trace/simd/wide_ray.h"

namespace raydix {

/// The meshes of one tree whose arrays are the caller's. `Tree`: SceneTree or SceneTreeD.
template <class Tree>
class SharedArrays {
    static constexpr bool is_float = std::is_same_v<Tree, SceneTree>;
    using MeshTreeOf = std::conditional_t<is_float, MeshTree, MeshTreeD>;
    using Name = std::conditional_t<is_float, MeshName, MeshNameD>;
    using Source = std::conditional_t<is_float, TriangleSource, TriangleSourceD>;
    using Corners = std::conditional_t<is_float, LeafTriangle, LeafTriangleD>;
    using Box = std::conditional_t<is_float, Aabb, AabbD>;

public:
    SharedArrays(const Tree& scene, const MeshTreeOf& mesh) : mesh_(mesh) {
        for (const std::uint32_t id : mesh.ids)
            names_.push_back(&*std::ranges::lower_bound(scene.mesh_names, id, {}, &Name::id));
    }

    /// Throws InputError that names the first geometry that changed, and its first triangle that
    /// did. Triangles that no leaf holds, then and now, are not compared.
    void require_unchanged() const {
        if (std::ranges::none_of(names_, is_shared)) return;
        for (const Name* const name : names_)
            if (is_shared(name)) require_indices(*name);
        std::vector<State> states(mesh_.triangles, State::in_no_leaf);
        for_each_triangle(mesh_, [&](std::uint32_t prim, const Corners& then) {
            const std::size_t m = mesh_.mesh_of(prim);
            if (!is_shared(names_[m])) return;
            const Corners now = source_of(*names_[m]).corners(prim - mesh_.first[m]);
            states[prim] = are_equal(then, now) ? State::same : State::other;
        });
        for (std::size_t m = 0; m < names_.size(); ++m)
            if (is_shared(names_[m])) require_same(*names_[m], states.data() + mesh_.first[m]);
    }

private:
    enum class State : std::uint8_t { in_no_leaf, same, other };

    static bool is_shared(const Name* name) { return name->own == nullptr; }
    static Source source_of(const Name& name) {
        return {name.mesh.vertices.data(), name.mesh.triangles.data(), name.mesh.vertices.size()};
    }
    /// Neither has a -0.
    static bool are_equal(const Corners& a, const Corners& b) {
        const auto equal = [](const auto& p, const auto& q) {
            return p.x == q.x && p.y == q.y && p.z == q.z;
        };
        return equal(a.v0, b.v0) && equal(a.v1, b.v1) && equal(a.v2, b.v2);
    }
    [[noreturn]] static void refuse(const Name& name, std::uint32_t triangle) {
        throw InputError("scenes: geometry " + std::to_string(name.id) +
                         ": its shared arrays changed since the commit, at triangle " +
                         std::to_string(triangle));
    }
    static void require_indices(const Name& name) {
        for (std::uint32_t i = 0; i < name.mesh.triangles.size(); ++i)
            if (!source_of(name).readable(i)) refuse(name, i);
    }
    static void require_same(const Name& name, const State* states) {
        const Source source = source_of(name);
        const auto has_leaf = [&](std::uint32_t i) {  // in a new tree
            Box box;
            return source.box(i, box) && !has_zero_area(source.corners(i));
        };
        for (std::uint32_t i = 0; i < name.mesh.triangles.size(); ++i)
            if (states[i] == State::other || (states[i] == State::in_no_leaf && has_leaf(i)))
                refuse(name, i);
    }

    /// Calls visit(place) for each triangle of each leaf.
    template <class Nodes, class Visit>
    static void for_each_place(const Nodes& nodes, const Visit& visit) {
        for (const auto& node : nodes)
            for (const std::uint32_t word : node.child) {
                if (word == wide_no_child || (word & wide_leaf_bit) == 0) continue;
                const std::uint32_t first = (word & ~wide_leaf_bit) >> 3, count = (word & 7) + 1;
                for (std::uint32_t k = 0; k < count; ++k) visit(first + k);
            }
    }
    /// Calls visit(the tree's number of it, corners) for each triangle of each leaf.
    template <class Visit>
    static void for_each_triangle(const MeshTree& mesh, const Visit& visit) {
        WideView view = mesh.view;
        TriangleBlock room{};
        view.room = &room;
        const auto at = [&](const TriangleBlock& block, std::uint32_t lane) {
            visit(block.prim[lane], triangle_of(block, lane));
        };
        const WideBvh::Arrays& arrays = mesh.tree->arrays();
        if (view.is_compact)
            for_each_place(arrays.compact_nodes.view(), [&](std::uint32_t place) {
                at(view.block<true>(place), place % block_lanes);
            });
        else
            for_each_place(arrays.nodes.view(), [&](std::uint32_t place) {
                at(view.block<false>(place), place % block_lanes);
            });
    }
    template <class Visit>
    static void for_each_triangle(const MeshTreeD& mesh, const Visit& visit) {
        for_each_place(mesh.tree->arrays.nodes.view(), [&](std::uint32_t place) {
            const TriangleBlockD& block = mesh.tree->blocks[place / block_lanes];
            visit(block.prim[place % block_lanes], block.triangle(place % block_lanes));
        });
    }

    const MeshTreeOf& mesh_;
    std::vector<const Name*> names_;  // [meshes]
};

}  // namespace raydix
