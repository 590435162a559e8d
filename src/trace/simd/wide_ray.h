// A ray's constants for wide nodes, and what every kernel over them shares.
#pragma once

#include <raydix/trace.h>
#include <raydix/types.h>

#include <cstdint>

#include "base/math.h"
#include "layout/wide_bvh.h"
#include "trace/ray_frame.h"
#include "trace/slab.h"
#include "trace/triangle_test.h"

namespace raydix {

struct WideView {
    const WideNode* nodes;
    const TriangleBlock* blocks;
    const CompactNode* compact_nodes;
    const CompactBlock* compact_blocks;
    const Vec3* vertices;
    TriangleBlock* room;  // of a compact tree, one for each thread
    Aabb bounds;          // of the root
    Vec3 middle;          // of the bounds: planes of WideNode are about it
    bool is_compact;

    template <bool compact>
    [[nodiscard]] const auto& node(std::uint32_t word) const {
        if constexpr (compact)
            return compact_nodes[word];
        else
            return nodes[word];
    }

    /// The block of a leaf; in a compact tree its triangles are put together in `room`.
    template <bool compact>
    [[nodiscard]] const TriangleBlock& block(std::uint32_t place,
                                             [[maybe_unused]] std::uint32_t count) const {
        if constexpr (!compact) return blocks[place / 8];
        const CompactBlock& from = compact_blocks[place / 8];
        for (std::uint32_t lane = place % 8; lane < place % 8 + count; ++lane)
            room->set(lane,
                      {vertices[from.vertex[0][lane]], vertices[from.vertex[1][lane]],
                       vertices[from.vertex[2][lane]]},
                      from.prim[lane]);
        return *room;
    }
};

/// Children still to visit: words of WideNode::child and where the ray enters them.
struct WideStackView {
    std::uint32_t* words;
    float* entries;
};

/// As above, for packets: entries are those of the nearest ray, bit k of `active` is ray k.
struct PacketStackView {
    std::uint32_t* words;
    float* entries;
    std::uint64_t* active;
};

/// Siblings of the deepest path (contract.md 2), and room for a whole vector behind the last.
inline std::size_t wide_stack_capacity(std::uint32_t max_depth) {
    return std::size_t{quantised_width - 1} * (max_depth + 1) + 1 + 2 * quantised_width;
}

/// Components of the direction below 2^-80 count as that for boxes: nothing is infinite or NaN
/// then, a plane before the origin stays before it, and the one behind stays farther away than any
/// hit (docs/algorithms/wide.md).
inline constexpr float wide_longest_inverse = 0x1p80f;

/// Boxes widen by twice the pad of slab.h: it covers the roundings of origin + steps, fused or not.
inline constexpr float wide_pad_factor = 2.0f;
/// The bounds of a packet round once more (docs/algorithms/wide.md).
inline constexpr float packet_pad_factor = 3.0f;

struct WideRay {
    Vec3 inverse;            // limited
    Vec3 near_pad;           // with the sign that moves near planes toward the ray's start
    std::uint32_t negative;  // bit a: the direction's component a is negative (or -0)
};

inline WideRay make_wide_ray(const RayFrame& frame, const Aabb& bounds) {
    const SlabFrame slabs = make_slab_frame(frame, bounds);
    const auto limited = [](float inverse) {
        return max_of(min_of(inverse, wide_longest_inverse), -wide_longest_inverse);
    };
    WideRay ray;
    ray.inverse = {limited(slabs.inverse.x), limited(slabs.inverse.y), limited(slabs.inverse.z)};
    ray.near_pad = wide_pad_factor * slabs.near_pad;
    ray.negative = (slabs.near_x != 0 ? 1u : 0u) | (slabs.near_y != 0 ? 2u : 0u) |
                   (slabs.near_z != 0 ? 4u : 0u);
    return ray;
}

inline LeafTriangle triangle_of(const TriangleBlock& block, std::uint32_t lane) {
    const auto corner = [&](int v) {
        return Vec3{block.corner[3 * v][lane], block.corner[3 * v + 1][lane],
                    block.corner[3 * v + 2][lane]};
    };
    return {corner(0), corner(1), corner(2)};
}

/// The best hit so far, t in the frame's units.
struct WideBest {
    float t;
    std::uint32_t prim = no_primitive;
    float u = 0.0f, v = 0.0f;

    [[nodiscard]] bool found() const { return prim != no_primitive; }
    /// At equal t the lower primitive wins, whatever order the leaves come in.
    void take(float new_t, std::uint32_t new_prim, float new_u, float new_v) {
        if (new_t < t || (new_t == t && new_prim < prim)) *this = {new_t, new_prim, new_u, new_v};
    }
};

}  // namespace raydix
