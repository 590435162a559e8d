// A compressed wide node and a ray (Ylitie, Karras, Laine 2017, section 3.3): which of the eight
// children it meets, and in which order they come. For host and device.
#pragma once

#include <cstdint>
#include <cstring>

#include "base/bits.h"
#include "base/device_math.h"
#include "base/hd.h"
#include "layout/cwbvh.h"
#include "trace/slab.h"

namespace raydix {

/// Bits 24 to 31 of `hits`: children still to visit, the highest first; bits 0 to 7: inner_mask of
/// their parent, whose child_base is `base`.
struct CwbvhGroup {
    std::uint32_t base, hits;

    [[nodiscard]] RAYDIX_HD bool has_nodes() const { return hits >> cwbvh_first_child_bit != 0; }
};

/// A node as 32-bit words: 0-2 origin, 3 exponents and inner_mask, 4 and 5 bases, 6 and 7 meta,
/// then pairs of lo x, y, z and hi x, y, z.
struct CwbvhWords {
    std::uint32_t word[20];
};

// Static: this is compiled for several instruction sets (trace/warp/lane.h).
RAYDIX_HD static inline CwbvhWords load_node(const CwbvhNode* node) {
    CwbvhWords words;
#if defined(__CUDA_ARCH__)
    const uint4* from = reinterpret_cast<const uint4*>(node);
#pragma unroll
    for (int k = 0; k < 5; ++k) {
        const uint4 four = __ldg(from + k);
        words.word[4 * k] = four.x;
        words.word[4 * k + 1] = four.y;
        words.word[4 * k + 2] = four.z;
        words.word[4 * k + 3] = four.w;
    }
#else
    std::memcpy(&words, node, sizeof(words));
#endif
    return words;
}

RAYDIX_HD static inline float float_of_bits(std::uint32_t bits) {
    float value;
    std::memcpy(&value, &bits, sizeof(value));
    return value;
}

RAYDIX_HD static inline std::uint32_t byte_of(std::uint32_t word, int k) {
    return word >> (8 * k) & 255u;
}

RAYDIX_HD static inline int highest_bit(std::uint32_t bits) { return 31 - leading_zeros(bits); }

/// Planes round three times more than those of slab.h.
inline constexpr float cwbvh_pad_factor = 1.5f;

/// One axis of a node for one ray: t of the plane q is q * rate + near or far.
struct CwbvhAxis {
    float rate, near, far;
};

/// How a ray goes through any node: slot s comes at place s ^ octant, high places first. Bit a is
/// set where the direction is not negative along axis a.
RAYDIX_HD static inline std::uint32_t octant_of(bool negative_x, bool negative_y, bool negative_z) {
    return (negative_x ? 0u : 1u) | (negative_y ? 0u : 2u) | (negative_z ? 0u : 4u);
}

/// Bits of four children whose meta is one word: a leaf's triangles, or the place of a node's turn.
RAYDIX_HD static inline std::uint32_t places_in_order(std::uint32_t meta, std::uint32_t octant) {
    // Where bits 3 and 4 of a byte are set there is a node; its slot is the lowest three bits.
    const std::uint32_t nodes = (meta & meta << 1) >> 4 & 0x01010101u;
    return meta ^ (nodes * octant);
}

/// The children of a node that the ray meets between tmin and tmax: nodes as bits 24 to 31,
/// triangles as bits 0 to 23. plane(steps, rate, start) is steps * rate + start.
template <class Plane>
RAYDIX_HD static inline std::uint32_t meet_children(std::uint32_t octant, const CwbvhWords& node,
                                                    const CwbvhAxis (&axes)[3], float tmin,
                                                    float tmax, Plane plane) {
    const std::uint32_t* w = node.word;
    const CwbvhAxis &x = axes[0], &y = axes[1], &z = axes[2];
    const bool negative_x = (octant & 1u) == 0, negative_y = (octant & 2u) == 0,
               negative_z = (octant & 4u) == 0;
    std::uint32_t hits = 0;
#if defined(__CUDA_ARCH__)
#pragma unroll
#endif
    for (int half = 0; half < 2; ++half) {
        const std::uint32_t lo_x = w[8 + half], lo_y = w[10 + half], lo_z = w[12 + half];
        const std::uint32_t hi_x = w[14 + half], hi_y = w[16 + half], hi_z = w[18 + half];
        const std::uint32_t near_x = negative_x ? hi_x : lo_x, far_x = negative_x ? lo_x : hi_x;
        const std::uint32_t near_y = negative_y ? hi_y : lo_y, far_y = negative_y ? lo_y : hi_y;
        const std::uint32_t near_z = negative_z ? hi_z : lo_z, far_z = negative_z ? lo_z : hi_z;
        const std::uint32_t meta = places_in_order(w[6 + half], octant);
#if defined(__CUDA_ARCH__)
#pragma unroll
#endif
        for (int k = 0; k < 4; ++k) {
            const auto steps = [&](std::uint32_t word) {
                return static_cast<float>(byte_of(word, k));
            };
            const float ex = plane(steps(near_x), x.rate, x.near),
                        ey = plane(steps(near_y), y.rate, y.near),
                        ez = plane(steps(near_z), z.rate, z.near);
            const float lx = plane(steps(far_x), x.rate, x.far),
                        ly = plane(steps(far_y), y.rate, y.far),
                        lz = plane(steps(far_z), z.rate, z.far);
            const float entry = greater(greater(ex, ey), greater(ez, tmin));
            const float leave = lesser(lesser(lx, ly), lz) * slab_exit_factor;
            const std::uint32_t child = byte_of(meta, k);
            if (entry <= lesser(leave, tmax)) hits |= (child >> 5) << (child & 31u);
        }
    }
    return hits;
}

/// What meet_children found, apart: a group of nodes, and bits of triangles.
RAYDIX_HD static inline CwbvhGroup met_nodes(const CwbvhWords& node, std::uint32_t hits) {
    return {node.word[4], (hits & 0xFF000000u) | node.word[3] >> 24};
}
RAYDIX_HD static inline std::uint32_t met_triangles(std::uint32_t hits) {
    return hits & 0x00FFFFFFu;
}

/// Goes on to the first child of `group`: takes it out, and returns its node.
RAYDIX_HD static inline std::uint32_t take_first_child(std::uint32_t octant, CwbvhGroup& group) {
    const int bit = highest_bit(group.hits);
    group.hits ^= 1u << bit;
    const std::uint32_t slot = (static_cast<std::uint32_t>(bit) - cwbvh_first_child_bit) ^ octant;
    const std::uint32_t before = group.hits & ((1u << slot) - 1u);
    return group.base + static_cast<std::uint32_t>(count_ones(std::uint64_t{before}));
}

}  // namespace raydix
