// Two trees, or one with itself, walked together: pairs of nodes whose boxes overlap, down to pairs
// of primitives.
#pragma once

#include <raydix/bvh.h>
#include <raydix/double.h>

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "base/check.h"
#include "primitives/exact_overlap.h"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace raydix {

/// A primitive's box in leaf order, laid out as a node's is.
struct PairBox {
    Vec3 lo;
    std::uint32_t prim;
    Vec3 hi;
    std::uint32_t unused;
};
static_assert(sizeof(PairBox) == sizeof(BvhNode));

/// A number for the place of each corner of a triangle: equal places have equal ones.
struct alignas(16) CornerKeys {
    std::array<std::uint32_t, 4> keys;  // the last is no corner's
};

inline std::uint32_t key_bits(float x) { return std::bit_cast<std::uint32_t>(x); }
inline std::uint32_t key_bits(double x) {
    const auto bits = std::bit_cast<std::uint64_t>(x);
    return static_cast<std::uint32_t>(bits ^ bits >> 32);
}

template <class Corners>
inline CornerKeys corner_keys(const Corners& t) {
    const auto key = [](auto p) {
        const auto bits = [](auto x) { return key_bits(x); };
        const std::uint32_t mixed =
            (bits(p.x) * 0x9e3779b1u ^ bits(p.y)) * 0x85ebca77u ^ bits(p.z) * 0xc2b2ae3du;
        return mixed ^ mixed >> 15;
    };
    return {{key(t.v0), key(t.v1), key(t.v2), 0}};
}

/// Bit 4 * i + j: key i of `a` is key j of `b`, for the first three of both.
inline unsigned equal_keys(const CornerKeys& a, const CornerKeys& b) {
#if defined(__SSE2__)
    const __m128i x = _mm_load_si128(reinterpret_cast<const __m128i*>(a.keys.data()));
    const __m128i y = _mm_load_si128(reinterpret_cast<const __m128i*>(b.keys.data()));
    const auto bits = [](__m128i equal) {
        return static_cast<unsigned>(_mm_movemask_ps(_mm_castsi128_ps(equal)) & 7);
    };
    return bits(_mm_cmpeq_epi32(_mm_shuffle_epi32(x, 0x00), y)) |
           bits(_mm_cmpeq_epi32(_mm_shuffle_epi32(x, 0x55), y)) << 4 |
           bits(_mm_cmpeq_epi32(_mm_shuffle_epi32(x, 0xAA), y)) << 8;
#else
    unsigned equal = 0;
    for (unsigned i = 0; i < 3; ++i)
        for (unsigned j = 0; j < 3; ++j)
            if (a.keys[i] == b.keys[j]) equal |= 1u << (4 * i + j);
    return equal;
#endif
}

/// What walks read of a tree. Each primitive is in one leaf. Corners: LeafTriangle, or
/// LeafTriangleD with boxes and nodes around those of the triangles.
template <class Corners>
struct BasicPairTree {
    const BvhNode* nodes;
    const PairBox* boxes;      // [references]
    const Corners* triangles;  // [references]; null unless they are triangles
    const CornerKeys* keys;    // the same
    std::uint32_t max_depth;

    /// Whether two triangles have a corner at the same place.
    [[nodiscard]] bool share_a_corner(std::uint32_t k, std::uint32_t l) const {
        const auto* s = &triangles[k].v0;
        const auto* t = &triangles[l].v0;
        for (unsigned equal = equal_keys(keys[k], keys[l]); equal != 0; equal &= equal - 1) {
            const int bit = std::countr_zero(equal);
            if (s[bit / 4] == t[bit % 4]) return true;
        }
        return false;
    }
};
using PairTree = BasicPairTree<LeafTriangle>;
using PairTreeD = BasicPairTree<LeafTriangleD>;

/// Closed boxes of nodes or primitives.
template <class A, class B>
bool boxes_overlap(const A& a, const B& b) {
#if defined(__SSE2__)
    const __m128 apart = _mm_or_ps(_mm_cmpgt_ps(_mm_loadu_ps(&a.lo.x), _mm_loadu_ps(&b.hi.x)),
                                   _mm_cmpgt_ps(_mm_loadu_ps(&b.lo.x), _mm_loadu_ps(&a.hi.x)));
    return (_mm_movemask_ps(apart) & 7) == 0;  // the fourth lanes are no coordinates
#else
    return boxes_touch(Aabb{a.lo, a.hi}, Aabb{b.lo, b.hi});
#endif
}

struct SlotPair {
    std::uint32_t a, b;
};

/// `same`: both trees are one, and (n, n) stands for all pairs within n. pair(k, l) gets positions
/// in leaf order of primitives whose boxes overlap.
template <bool same, class Tree, class Pair>
class PairWalk {
public:
    PairWalk(const Tree& a, const Tree& b, const Pair& pair) : a_(a), b_(b), pair_(pair) {}

    /// Gives the pairs of nodes that `at` falls into to push(SlotPair); at leaves, its primitives
    /// to pair().
    template <class Push>
    void step(SlotPair at, const Push& push) const {
        const BvhNode& a = a_.nodes[at.a];
        const BvhNode& b = b_.nodes[at.b];
        if constexpr (same) {
            if (at.a == at.b) {
                if (a.is_leaf()) return within_leaf(a);
                push({a.first, a.first});
                push({a.first + 1, a.first + 1});
                return offer({a.first, a.first + 1}, push);
            }
        }
        if (a.is_leaf() && b.is_leaf()) return between_leaves(a, b);
        if (b.is_leaf() || (!a.is_leaf() && size(a) >= size(b))) {
            offer({a.first, at.b}, push);
            offer({a.first + 1, at.b}, push);
        } else {
            offer({at.a, b.first}, push);
            offer({at.a, b.first + 1}, push);
        }
    }

private:
    template <class Push>
    void offer(SlotPair next, const Push& push) const {
        if (boxes_overlap(a_.nodes[next.a], b_.nodes[next.b])) push(next);
    }
    static float size(const BvhNode& n) {
        return ((n.hi.x - n.lo.x) + (n.hi.y - n.lo.y)) + (n.hi.z - n.lo.z);
    }
    void within_leaf(const BvhNode& leaf) const {
        for (std::uint32_t k = leaf.first; k < leaf.first + leaf.count; ++k)
            for (std::uint32_t l = k + 1; l < leaf.first + leaf.count; ++l)
                if (boxes_overlap(a_.boxes[k], a_.boxes[l])) pair_(k, l);
    }
    void between_leaves(const BvhNode& a, const BvhNode& b) const {
        for (std::uint32_t k = a.first; k < a.first + a.count; ++k) {
            if (!boxes_overlap(a_.boxes[k], b)) continue;
            for (std::uint32_t l = b.first; l < b.first + b.count; ++l)
                if (boxes_overlap(a_.boxes[k], b_.boxes[l])) pair_(k, l);
        }
    }

    const Tree& a_;
    const Tree& b_;
    const Pair& pair_;
};

/// All pairs below `start`, depth first. Each step goes one level down in one tree, or in both
/// where they are one, and leaves at most one pair, or two, behind: the sum of both depths is
/// enough room.
template <class Walk>
void walk_pairs(const Walk& walk, SlotPair start, std::uint32_t depths,
                std::vector<SlotPair>& stack) {
    const std::size_t room = std::size_t{depths} + 3;
    stack.clear();
    stack.reserve(room);
    stack.push_back(start);
    while (!stack.empty()) {
        const SlotPair at = stack.back();
        stack.pop_back();
        walk.step(at, [&](SlotPair next) { stack.push_back(next); });
        RAYDIX_CHECK(stack.size(), <=, room);
    }
}

/// Work for many threads: pairs of nodes that together stand for `start`, at least `wanted` if
/// there are so many. Leaves that are met on the way go to pair().
template <class Walk>
std::vector<SlotPair> spread_pairs(const Walk& walk, SlotPair start, std::size_t wanted) {
    std::vector<SlotPair> level{start}, next;
    while (!level.empty() && level.size() < wanted) {
        next.clear();
        for (const SlotPair at : level) walk.step(at, [&](SlotPair n) { next.push_back(n); });
        std::swap(level, next);
    }
    return level;
}

}  // namespace raydix
