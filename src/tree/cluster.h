// The binary tree that agglomerative builders grow from primitives up: what two clusters become
// when they merge, and which pair is the better one. Meister and Bittner 2018, "Parallel
// Locally-Ordered Clustering for BVH Construction"; leaves by SAH are decided here too, because a
// merge knows all it takes.
#pragma once

#include <raydix/types.h>

#include <cstdint>

#include "base/hd.h"
#include "base/math.h"

namespace raydix {

/// A cluster's name: a merged one by its place among ClusterNodes, a primitive by its place in
/// Morton order, with the highest bit set.
using ClusterRef = std::uint32_t;
inline constexpr ClusterRef primitive_cluster = 0x80000000u;

RAYDIX_HD inline bool is_primitive(ClusterRef ref) { return (ref & primitive_cluster) != 0; }

/// What a subtree is worth to its parent.
struct ClusterSum {
    std::uint32_t count;   // primitives
    std::uint32_t inner;   // inner nodes that the finished tree keeps; 0: one leaf
    std::uint32_t height;  // edges down to its deepest leaf
    std::uint32_t least;   // its smallest primitive id
    float cost;            // SAH times the root's area; written only where count <= max_leaf
};

/// A merged cluster, in one cache line. The left child holds the smallest primitive id.
struct alignas(64) ClusterNode {
    Vec3 lo;
    ClusterRef left;
    Vec3 hi;
    ClusterRef right;
    ClusterSum sum;
};
static_assert(sizeof(ClusterNode) == 64);

/// Half the surface of a box in float: the distance of two clusters is that of their union.
RAYDIX_HD inline float cluster_area(const Aabb& box) {
    const Vec3 d = box.hi - box.lo;
    return (d.x * d.y + d.y * d.z) + d.z * d.x;
}

RAYDIX_HD inline ClusterSum sum_of_primitive(std::uint32_t primitive_id, const Aabb& box) {
    return {1, 0, 0, primitive_id, cluster_area(box)};
}

/// Costs are 1 per inner node and 1 per primitive: a subtree of up to max_leaf primitives becomes a
/// leaf if that costs no more.
RAYDIX_HD inline ClusterSum merge_sums(const ClusterSum& a, const ClusterSum& b, float area,
                                       std::uint32_t max_leaf) {
    ClusterSum sum;
    sum.count = a.count + b.count;
    sum.least = a.least < b.least ? a.least : b.least;
    sum.inner = 1 + a.inner + b.inner;
    sum.height = 1 + (a.height > b.height ? a.height : b.height);
    sum.cost = 0;
    if (sum.count <= max_leaf) {
        const float as_leaf = static_cast<float>(sum.count) * area;
        sum.cost = area + (a.cost + b.cost);
        if (as_leaf <= sum.cost) {
            sum.cost = as_leaf;
            sum.inner = 0;
            sum.height = 0;
        }
    }
    return sum;
}

/// Two clusters on their way into one.
struct ClusterPart {
    ClusterRef ref;
    Aabb box;
    ClusterSum sum;
};

RAYDIX_HD inline ClusterNode merge_clusters(const ClusterPart& a, const ClusterPart& b,
                                            std::uint32_t max_leaf) {
    const Aabb box = unite(a.box, b.box);
    const bool a_left = a.sum.least < b.sum.least;
    return {box.lo, a_left ? a.ref : b.ref, box.hi, a_left ? b.ref : a.ref,
            merge_sums(a.sum, b.sum, cluster_area(box), max_leaf)};
}

/// Of the pairs (i - d, i) and (i, i + d) with equal areas, whether i takes the right one. The
/// choice is the pair's own, the same from both ends: pairs that tie and share a cluster differ in
/// the lowest set bit of d at their first position. So some pair always merges, and equal boxes
/// pair up and halve in each round.
RAYDIX_HD constexpr bool tie_goes_right(std::uint32_t i, std::uint32_t d) {
    return (i & (d & (0u - d))) == 0;
}

}  // namespace raydix
