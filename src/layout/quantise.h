// Boxes of eight children in steps of a power of two, 8 bits an axis, that never leave anything
// out: the frame of Ylitie, Karras and Laine 2017 (section 3.2), in exact arithmetic. Shared by the
// nodes of cwbvh and of the wide trees of the CPU.
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
/// The largest q with origin + q * step <= at, and the least with origin + q * step >= at, held
/// within 0 to 255: exact, whatever the sizes are. origin <= at.
[[nodiscard]] int steps_below(float origin, int exponent, float at);
[[nodiscard]] int steps_above(float origin, int exponent, float at);
/// Whether origin + q * step is at most / at least `at`, exactly.
[[nodiscard]] bool is_at_most(float origin, int exponent, int q, float at);
[[nodiscard]] bool is_at_least(float origin, int exponent, int q, float at);

/// Places up to 8 children in slots 0 to 7 so that the sum over children of
/// dot(centre of child - centre of node, diagonal of slot) is largest: the assignment of
/// section 3.2, solved exactly. slots [count], out.
void assign_octant_slots(std::span<const Aabb> children, int* slots);

/// The same by rule of thumb, in a tenth of the time: children far from the middle choose first,
/// each the best slot that is left.
void assign_octant_slots_greedily(std::span<const Aabb> children, int* slots);

/// The children of a wide node by slot; null where there is none.
using ChildSlots = std::array<const BvhNode*, quantised_width>;

inline float coordinate(Vec3 v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

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

/// Fills the frame and the boxes of a node. What a ray can never miss by rounding is what
/// contains_exactly said yes to: coarser steps until it does. Empty slots get an inverted box.
template <class Node>
void quantise_children(const ChildSlots& slots, Node& node) {
    Aabb all = empty_box();
    for (const BvhNode* child : slots)
        if (child != nullptr) all = unite(all, {child->lo, child->hi});
    for (int axis = 0; axis < 3; ++axis) {
        node.origin[axis] = coordinate(all.lo, axis);
        node.exponent[axis] =
            static_cast<std::uint8_t>(step_exponent(node.origin[axis], coordinate(all.hi, axis)));
    }
    for (;;) {
        bool contained = true;
        for (int s = 0; s < quantised_width; ++s) {
            const BvhNode* child = slots[static_cast<std::size_t>(s)];
            for (int axis = 0; axis < 3; ++axis) {
                const float origin = node.origin[axis];
                const int exponent = node.exponent[axis];
                node.lo[axis][s] = static_cast<std::uint8_t>(
                    child == nullptr ? max_steps
                                     : steps_below(origin, exponent, coordinate(child->lo, axis)));
                node.hi[axis][s] = static_cast<std::uint8_t>(
                    child == nullptr ? 0
                                     : steps_above(origin, exponent, coordinate(child->hi, axis)));
            }
            contained = contained &&
                        (child == nullptr || contains_exactly(node, s, {child->lo, child->hi}));
        }
        if (contained) return;
        for (std::uint8_t& exponent : node.exponent)
            exponent = static_cast<std::uint8_t>(exponent < max_step_exponent ? exponent + 1
                                                                              : max_step_exponent);
    }
}

}  // namespace raydix
