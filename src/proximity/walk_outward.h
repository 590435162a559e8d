// Walk of one query point through the binary tree, nearer child first. What happens at a leaf, and
// how far still matters, is the caller's.
#pragma once

#include <raydix/bvh.h>

#include "base/check.h"
#include "base/math.h"
#include "proximity/closest_on_triangle.h"
#include "trace/walk.h"

#if defined(__SSE4_1__)
#include <smmintrin.h>
#endif

namespace raydix {

struct NodeBoxes {
    Aabb a, b;
};
/// Boxes of two nodes in a row: on a device in four loads of 16 bytes, for which the pair must be
/// aligned.
RAYDIX_HD inline NodeBoxes load_boxes(const BvhNode* pair) {
#if defined(__CUDA_ARCH__)
    const float4* from = reinterpret_cast<const float4*>(pair);
    const float4 a_lo = from[0], a_hi = from[1], b_lo = from[2], b_hi = from[3];
    return {{{a_lo.x, a_lo.y, a_lo.z}, {a_hi.x, a_hi.y, a_hi.z}},
            {{b_lo.x, b_lo.y, b_lo.z}, {b_hi.x, b_hi.y, b_hi.z}}};
#else
    return {{pair[0].lo, pair[0].hi}, {pair[1].lo, pair[1].hi}};
#endif
}

/// Lower bounds for the squares of the distances to all that is in two boxes.
template <class Scalar>
struct BasicPairDistance {
    Scalar a, b;
};
using PairDistance = BasicPairDistance<float>;
using PairDistanceD = BasicPairDistance<double>;

/// A query's distances to the boxes of a tree. Boxes grow by `pad` first: where triangles are in
/// several leaves, a point that double arithmetic put onto a part's face may be that far off it.
class BoxDistances {
public:
    BoxDistances(Vec3 query, float pad)
#if defined(__SSE4_1__)
        // The fourth lanes hold links and counts; an infinite pad turns them into 0.
        : query_(_mm_set_ps(0.0f, query.z, query.y, query.x)),
          pad_(_mm_set_ps(infinity, pad, pad, pad)){}
#else
        : query_(query), pad_{pad, pad, pad} {
    }
#endif

          /// `pair` points to two nodes in a row.
          [[nodiscard]] PairDistance
          operator()(const BvhNode* pair) const {
#if defined(__SSE4_1__)
        const float* p = &pair->lo.x;
        const __m128 a = square_off(p), b = square_off(p + 8);
        const __m128 xy = _mm_unpacklo_ps(a, b);  // ax bx ay by
        const __m128 sum = _mm_add_ps(_mm_add_ps(xy, _mm_movehl_ps(xy, xy)), _mm_unpackhi_ps(a, b));
        return {_mm_cvtss_f32(sum), _mm_cvtss_f32(_mm_shuffle_ps(sum, sum, 1))};
#else
        const auto bound = [&](const BvhNode& node) {
            return squared_distance_to_box({node.lo - pad_, node.hi + pad_}, query_);
        };
        return {bound(pair[0]), bound(pair[1])};
#endif
    }

private:
#if defined(__SSE4_1__)
    [[nodiscard]] __m128 square_off(const float* box) const {
        const __m128 below = _mm_sub_ps(_mm_load_ps(box), query_);
        const __m128 above = _mm_sub_ps(query_, _mm_load_ps(box + 4));
        const __m128 off = _mm_max_ps(_mm_sub_ps(_mm_max_ps(below, above), pad_), _mm_setzero_ps());
        return _mm_mul_ps(off, off);
    }
    __m128 query_, pad_;
#else
    Vec3 query_, pad_;
#endif
};

/// The same in double; the query is where the nodes are.
class BoxDistancesD {
public:
    BoxDistancesD(Vec3d query, double pad) : query_(query), pad_(pad) {}
    [[nodiscard]] PairDistanceD operator()(const BvhNode* pair) const {
        return {bound(pair[0]), bound(pair[1])};
    }

private:
    [[nodiscard]] double bound(const BvhNode& node) const {
        const auto square = [&](float lo, float hi, double q) {
            const double off = max_of(max_of(lo - q, q - hi) - pad_, 0.0);
            return off * off;
        };
        return (square(node.lo.x, node.hi.x, query_.x) + square(node.lo.y, node.hi.y, query_.y)) +
               square(node.lo.z, node.hi.z, query_.z);
    }
    Vec3d query_;
    double pad_;
};

/// The same for a thread of a device, over trees in which each triangle is in one leaf.
struct DeviceBoxDistances {
    Vec3 query;

    [[nodiscard]] RAYDIX_HD PairDistance operator()(const BvhNode* pair) const {
        const NodeBoxes boxes = load_boxes(pair);
        return {squared_distance_to_box(boxes.a, query), squared_distance_to_box(boxes.b, query)};
    }
};

/// A thread's own stack, for trees of up to `entries` levels.
template <int entries>
class LocalWalkStack {
public:
    [[nodiscard]] RAYDIX_HD PendingNode* begin() { return entries_; }
    [[nodiscard]] RAYDIX_HD std::uint32_t capacity() const { return entries; }

private:
    PendingNode entries_[entries];
};

/// 0 unless triangles may be in several leaves.
inline float box_pad(const Bvh& bvh) {
    if (!bvh.has_split_primitives()) return 0.0f;
    const Aabb box = bvh.bounds();
    const Vec3 far = max_of(max_of(box.hi, -1.0f * box.hi), max_of(box.lo, -1.0f * box.lo));
    return 0x1p-46f * max_of(max_of(far.x, far.y), far.z);
}

/// `leaf(node) -> bool` handles a leaf and says whether to stop; a subtree is left out only if its
/// distance is greater than `reach()`. The tree must not be empty.
template <class Distances, class Stack, class Leaf, class Reach>
RAYDIX_HD void walk_outward(const BvhNode* nodes, const Distances& distances, Stack& stack,
                            const Leaf& leaf, const Reach& reach) {
    auto* const bottom = stack.begin();
    auto* top = bottom;
    std::uint32_t slot = 0;
    for (;;) {
        const BvhNode& node = nodes[slot];
        if (node.is_leaf()) {
            if (leaf(node)) return;
        } else {
            const auto d = distances(&nodes[node.first]);
            const bool b_first = d.b < d.a;
            const auto nearer = b_first ? d.b : d.a, farther = b_first ? d.a : d.b;
            if (nearer <= reach()) {
                if (farther <= reach()) {
                    RAYDIX_CHECK(static_cast<std::uint32_t>(top - bottom), <, stack.capacity());
                    *top++ = {node.first + (b_first ? 0u : 1u), farther};
                }
                slot = node.first + (b_first ? 1u : 0u);
                continue;
            }
        }
        do {
            if (top == bottom) return;
            slot = (--top)->slot;
        } while (top->entry > reach());
    }
}

}  // namespace raydix
