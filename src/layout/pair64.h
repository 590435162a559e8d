// The node of Aila and Laine 2009: 64 bytes that hold the boxes of both children, which are always
// tested together. Tree of 32-byte nodes -> pairs [max(inner, 1)] and primitive ids with marked
// ends [references].
#pragma once

#include <raydix/bvh.h>
#include <raydix/device.h>

#include <cstdint>

#include "base/hd.h"
#include "base/math.h"

namespace raydix {

/// One per inner node; pair r is inner node r, but the root is pair 0: where it is another inner
/// node (`apetrei`), it and inner node 0 change places.
/// A child >= 0 is the index of its pair, in units of 64 bytes. A child < 0 is a leaf: its
/// complement is the position of the leaf's first primitive in leaf order, in primitives; the list
/// goes on up to an id with `last_in_leaf`.
struct alignas(64) NodePair {
    float c0_xlo, c0_xhi, c0_ylo, c0_yhi;
    float c1_xlo, c1_xhi, c1_ylo, c1_yhi;
    float c0_zlo, c0_zhi, c1_zlo, c1_zhi;
    std::int32_t child0, child1;
    std::int32_t unused0, unused1;  // 0

    /// The box grows by `pad` on all sides.
    RAYDIX_HD void set_child0(const BvhNode& n, float pad, std::int32_t child) {
        c0_xlo = n.lo.x - pad, c0_xhi = n.hi.x + pad, c0_ylo = n.lo.y - pad;
        c0_yhi = n.hi.y + pad, c0_zlo = n.lo.z - pad, c0_zhi = n.hi.z + pad;
        child0 = child;
    }
    RAYDIX_HD void set_child1(const BvhNode& n, float pad, std::int32_t child) {
        c1_xlo = n.lo.x - pad, c1_xhi = n.hi.x + pad, c1_ylo = n.lo.y - pad;
        c1_yhi = n.hi.y + pad, c1_zlo = n.lo.z - pad, c1_zhi = n.hi.z + pad;
        child1 = child;
    }
};
static_assert(sizeof(NodePair) == 64);

/// Bit 31 of an id: primitives are fewer than 2^31.
inline constexpr std::uint32_t last_in_leaf = 0x80000000u;

/// By how much boxes grow: 2^-20 of the scene's largest coordinate. Plane * inverse - origin *
/// inverse rounds by up to 2^-23 of the coordinates, and the hit of a Woop triangle may lie as far
/// outside its box; with the margin every triangle that a ray would accept is reached in any order
/// of traversal (for origins up to some scene sizes away), so all kernels agree on the closest.
RAYDIX_HD inline float pair_padding(const BvhNode& root) {
    const auto largest = [](Vec3 p) {
        const auto size = [](float x) { return x < 0 ? -x : x; };
        return max_of(max_of(size(p.x), size(p.y)), size(p.z));
    };
    return max_of(largest(root.lo), largest(root.hi)) * 0x1p-20f;
}

/// Link of a node: its pair, or its first primitive.
RAYDIX_HD inline std::int32_t pair_link(const BvhNode& node) {
    return node.is_leaf() ? ~static_cast<std::int32_t>(node.first)
                          : static_cast<std::int32_t>((node.first - 2) / 2);
}

/// Pair r out of the two child nodes of inner node r; item 0 also serves a tree of one leaf, whose
/// pair has that leaf on both sides, the second in an inverted box that no ray meets.
struct EmitNodePair {
    const BvhNode* nodes;              // [2 * inner + 2]
    const std::uint32_t* inner_count;  // [1]
    const std::uint32_t* order;        // [references]
    NodePair* pairs;                   // [max(inner, 1)], out
    std::uint32_t* ids;                // [references], out

    RAYDIX_HD void operator()(std::uint32_t r) const {
        NodePair pair;
        std::uint32_t place = r;
        pair.unused0 = pair.unused1 = 0;
        const float pad = pair_padding(nodes[0]);
        if (*inner_count == 0) {
            BvhNode nothing = nodes[0];
            const Aabb none = empty_box();
            nothing.lo = none.lo;
            nothing.hi = none.hi;
            pair.set_child0(nodes[0], pad, pair_link(nodes[0]));
            pair.set_child1(nothing, 0.0f, pair_link(nodes[0]));
            copy_ids(nodes[0]);
        } else {
            const BvhNode &left = nodes[2 * r + 2], &right = nodes[2 * r + 3];
            pair.set_child0(left, pad, place_of(pair_link(left)));
            pair.set_child1(right, pad, place_of(pair_link(right)));
            copy_ids(left);
            copy_ids(right);
            place = static_cast<std::uint32_t>(place_of(static_cast<std::int32_t>(r)));
        }
        pairs[place] = pair;
    }

private:
    /// Of an inner node's pair; leaves stay what they are.
    [[nodiscard]] RAYDIX_HD std::int32_t place_of(std::int32_t inner) const {
        const std::int32_t root = pair_link(nodes[0]);
        return inner == root ? 0 : inner == 0 ? root : inner;
    }
    RAYDIX_HD void copy_ids(const BvhNode& leaf) const {
        if (!leaf.is_leaf()) return;
        const std::uint32_t last = leaf.first + leaf.count - 1;
        for (std::uint32_t k = leaf.first; k < last; ++k) ids[k] = order[k];
        ids[last] = order[last] | last_in_leaf;
    }
};

/// How many pairs there are: none without primitives, else one at least.
struct CountPairs {
    const std::uint32_t *references, *inner_count;
    std::uint32_t* pair_count;
    RAYDIX_HD void operator()(std::uint32_t) const {
        const std::uint32_t inner = *inner_count;
        *pair_count = *references == 0 ? 0 : inner > 0 ? inner : 1;
    }
};

/// `pair_count` [1] is scratch; `limit`: the most inner nodes there can be.
template <class Launcher>
void launch_pairs(Launcher& launcher, const EmitNodePair& emit, const std::uint32_t* references,
                  std::uint32_t limit, std::uint32_t* pair_count) {
    launcher.launch("layout.count_pairs", 1, CountPairs{references, emit.inner_count, pair_count});
    launcher.launch_counted("layout.pairs", pair_count, limit > 0 ? limit : 1, emit);
}

}  // namespace raydix
