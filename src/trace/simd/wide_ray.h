// A ray's constants for wide nodes, and what every kernel over them shares.
#pragma once

#include <raydix/trace.h>
#include <raydix/types.h>

#include <bit>
#include <cstdint>
#include <cstring>

#include "base/math.h"
#include "layout/wide_bvh.h"
#include "trace/ray_frame.h"
#include "trace/simd/ray_classes.h"
#include "trace/slab.h"
#include "trace/triangle_test.h"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace raydix {

/// All lanes, since empty ones name vertex 0. Whole vectors are written, as they are read next.
inline void fill_block(const CompactBlock& from, const Vec3* vertices, TriangleBlock& block) {
#if defined(__SSE2__)
    static_assert(block_lanes == 4);
    for (int v = 0; v < 3; ++v) {
        __m128 corner[4];
        for (int lane = 0; lane < 4; ++lane) {
            const float* const p = &vertices[from.vertex[v][lane]].x;
            corner[lane] = _mm_movelh_ps(
                _mm_castsi128_ps(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(p))),
                _mm_load_ss(p + 2));
        }
        _MM_TRANSPOSE4_PS(corner[0], corner[1], corner[2], corner[3]);
        for (int axis = 0; axis < 3; ++axis) _mm_store_ps(block.corner[3 * v + axis], corner[axis]);
    }
    std::memcpy(block.prim, from.prim, sizeof(block.prim));
#else
    for (std::uint32_t lane = 0; lane < block_lanes; ++lane)
        block.set(lane,
                  {vertices[from.vertex[0][lane]], vertices[from.vertex[1][lane]],
                   vertices[from.vertex[2][lane]]},
                  from.prim[lane]);
#endif
}

/// Says which hits count, where a caller has a say in that.
struct HitCheck {
    /// `ray`: as the job has it; t of the hit is the ray's.
    bool (*function)(const void* context, const Ray* ray, const TreeHit& hit);
    const void* context;

    bool operator()(const Ray* ray, const TreeHit& hit) const {
        return function(context, ray, hit);
    }
};

struct WideView {
    const WideNode* nodes;
    const TriangleBlock* blocks;
    const CompactNode* compact_nodes;
    const CompactBlock* compact_blocks;
    const Vec3* vertices;
    TriangleBlock* room;  // of a compact tree, one for each thread; or null
    bool is_compact;
    // By axis, the last is 0: the root's bounds, and their middle, which planes of WideNode are
    // about.
    const float *lo, *hi, *middle;
    bool local_pads;  // as the tree says

    template <bool compact>
    [[nodiscard]] const auto& node(std::uint32_t word) const {
        if constexpr (compact)
            return compact_nodes[word];
        else
            return nodes[word];
    }

    /// The block of a leaf; in a compact tree its triangles are put together in `room`.
    template <bool compact>
    [[nodiscard]] const TriangleBlock& block(std::uint32_t place) const {
        if constexpr (!compact) return blocks[place / block_lanes];
        fill_block(compact_blocks[place / block_lanes], vertices, *room);
        return *room;
    }
};

/// How boxes around parts of a scene widen once more, along every axis: by `rate` of the ray's
/// greatest distance to the tree's bounds, by components, and by `least`.
struct PadGrowth {
    float rate = 0, least = 0;
};

/// `room` is for compact trees; null: who traces brings it.
inline WideView view_of(const WideBvh::Arrays& arrays, TriangleBlock* room = nullptr) {
    return {arrays.nodes.data(),          arrays.blocks.data(),   arrays.compact_nodes.data(),
            arrays.compact_blocks.data(), arrays.vertices.data(), room,
            arrays.stats.compact,         arrays.frame.lo,        arrays.frame.hi,
            arrays.frame.middle,          arrays.local_pads};
}

/// Children still to visit: words of WideNode::child and where the ray enters them. Rays in turn
/// that want the closest hit keep both in `pairs`, the word in the lower half; null if there are
/// none.
struct WideStackView {
    std::uint32_t* words;
    float* entries;
    std::uint64_t* pairs = nullptr;

    /// The part that begins `at` places behind this one.
    [[nodiscard]] WideStackView from(std::size_t at) const {
        return {words + at, entries + at, pairs == nullptr ? nullptr : pairs + at};
    }
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

/// Boxes widen by more than the pad of slab.h: it covers the roundings of plane * rate + start,
/// fused or not.
inline constexpr float wide_pad_factor = 1.25f;
/// The bounds of a packet round once more (docs/algorithms/wide.md).
inline constexpr float packet_pad_factor = 1.5f;

inline LeafTriangle triangle_of(const TriangleBlock& block, std::uint32_t lane) {
    const auto corner = [&](int v) {
        return Vec3{block.corner[3 * v][lane], block.corner[3 * v + 1][lane],
                    block.corner[3 * v + 2][lane]};
    };
    return {corner(0), corner(1), corner(2)};
}

inline TriangleRay triangle_ray_of(const RayClass& kind, Vec3 origin, Vec3 direction, float shear_x,
                                   float shear_y, float tmin) {
    return {origin,
            direction,
            static_cast<int>(kind.kx),
            static_cast<int>(kind.ky),
            static_cast<int>(kind.kz),
            shear_x,
            shear_y,
            tmin};
}

/// The whole test: where an edge function is 0 or NaN, or a vector of planes leaves it open. All
/// hits count an edge that triangles share once.
template <EdgeRule edges = EdgeRule::closed>
[[gnu::noinline]] inline bool test_exactly(const TriangleRay& ray, const TriangleBlock& block,
                                           std::uint32_t lane, float tmax, TriangleHit& hit) {
    return intersect_triangle<edges>(ray, triangle_of(block, lane), tmax, hit);
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
    /// The same without a jump, for hits that may not count.
    void take_if(bool counts, float new_t, std::uint32_t new_prim, float new_u, float new_v) {
        const bool better = counts & ((new_t < t) | ((new_t == t) & (new_prim < prim)));
#if defined(__SSE2__)
        const __m128i taken = _mm_set1_epi32(-static_cast<int>(better));
        const __m128i found =
            _mm_castps_si128(_mm_setr_ps(new_t, std::bit_cast<float>(new_prim), new_u, new_v));
        auto* const all = reinterpret_cast<__m128i*>(this);
        const __m128i old = _mm_loadu_si128(all);
        _mm_storeu_si128(all,
                         _mm_or_si128(_mm_and_si128(taken, found), _mm_andnot_si128(taken, old)));
#else
        if (better) *this = {new_t, new_prim, new_u, new_v};
#endif
    }
};

}  // namespace raydix
