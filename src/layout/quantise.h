// Boxes of eight children in steps of a power of two, 8 bits an axis, that never leave anything
// out: the frame of Ylitie, Karras and Laine 2017 (section 3.2), in exact arithmetic. Shared by the
// nodes of cwbvh and of the CPU's compact wide trees.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include <array>
#include <cstdint>
#include <span>

#include "base/math.h"

namespace raydix {

inline constexpr int quantised_width = 8;
inline constexpr int min_step_exponent = 1, max_step_exponent = 254;  // of normal floats
inline constexpr int max_steps = 255;

/// The biased exponent of the least power of two of which 255 reach from lo to hi.
[[nodiscard]] int step_exponent(float lo, float hi);
/// Whether origin + q * step is at most / at least `at`, exactly.
[[nodiscard]] bool is_at_most(float origin, int exponent, int q, float at);
[[nodiscard]] bool is_at_least(float origin, int exponent, int q, float at);

/// Places up to 8 children in slots 0 to 7 so that the sum over children of
/// dot(centre of child - centre of node, diagonal of slot) is largest: the assignment of
/// section 3.2, solved exactly. slots [count], out.
void assign_octant_slots(std::span<const Aabb> children, int* slots);

inline float coordinate(Vec3 v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

/// Boxes of the children of a wide node, by slot.
struct SlotBoxes {
    float lo[3][quantised_width], hi[3][quantised_width];
    unsigned used = 0;  // bit s: there is a child in slot s; others hold anything
    void set(int slot, const Aabb& box) {
        for (int axis = 0; axis < 3; ++axis) {
            lo[axis][slot] = coordinate(box.lo, axis);
            hi[axis][slot] = coordinate(box.hi, axis);
        }
        used |= 1u << slot;
    }
};

/// The frame of a node and the boxes of its children in it. An unused slot has an inverted box.
struct QuantisedBoxes {
    float origin[3];
    std::uint8_t exponent[3];
    std::uint8_t lo[3][quantised_width], hi[3][quantised_width];
};

/// `all` is the box around all of them. lo is the largest number of steps that is not above the
/// child, hi the least that is not below, exactly, whatever the sizes are. What a ray can never
/// miss by rounding is what was compared in exact arithmetic: coarser steps until every decoded box
/// contains its child.
[[nodiscard]] QuantisedBoxes quantise(const SlotBoxes& boxes, const Aabb& all);

/// The step of an axis, 2^(exponent - 127).
[[nodiscard]] double quantised_step(int exponent);

/// Copies frame and boxes into a node, which has the same arrays.
template <class Node>
void set_boxes(Node& node, const QuantisedBoxes& q) {
    for (int axis = 0; axis < 3; ++axis) {
        node.origin[axis] = q.origin[axis];
        node.exponent[axis] = q.exponent[axis];
        for (int s = 0; s < quantised_width; ++s) {
            node.lo[axis][s] = q.lo[axis][s];
            node.hi[axis][s] = q.hi[axis][s];
        }
    }
}

/// Whether the child in `slot` as it will be decoded contains `box`, in exact arithmetic. A node
/// has origin[3], exponent[3], lo[3][8] and hi[3][8].
template <class Node>
[[nodiscard]] bool contains_exactly(const Node& node, int slot, const Aabb& box) {
    bool inside = true;
    for (int axis = 0; axis < 3; ++axis)
        inside = inside &&
                 is_at_most(node.origin[axis], node.exponent[axis], node.lo[axis][slot],
                            coordinate(box.lo, axis)) &&
                 is_at_least(node.origin[axis], node.exponent[axis], node.hi[axis][slot],
                             coordinate(box.hi, axis));
    return inside;
}

}  // namespace raydix
