// All pairs of primitives that overlap: within one tree, or between two.
#pragma once

#include <raydix/bvh.h>

#include <cstdint>
#include <vector>

namespace raydix {

/// Ids of two primitives: within one tree first < second; between two, `first` is of the first tree
/// and `second` of the second.
struct PrimitivePair {
    std::uint32_t first, second;

    friend constexpr bool operator==(const PrimitivePair&, const PrimitivePair&) = default;
};
static_assert(sizeof(PrimitivePair) == 8);

struct PairOptions {
    bool narrow = false;  // the triangles themselves must have a point in common, not only their
                          // boxes; decided without rounding, coplanar ones included
    /// Bounds the peak of a call that keeps the pairs. 0: half of what is left (result_limit.h).
    std::uint64_t max_result_bytes = 0;
    int threads = 0;  // 0 to 1,024; 0: all the machine has. Results do not depend on it
};

/// Pairs whose boxes overlap (closed: to touch is to overlap), each once, sorted by (first,
/// second); with `narrow`, of those the triangles that meet. Pairs of triangles of one tree that
/// share a corner (the same place, bit for bit) are left out. All builders give the same pairs.
/// None is ever dropped. Throws InputError: `narrow` for a tree of boxes or points; ResultTooLarge,
/// as soon as that is known, if the call would take more than max_result_bytes.
[[nodiscard]] std::vector<PrimitivePair> overlapping_pairs(const Bvh& bvh,
                                                           const PairOptions& options = {});
/// Between two trees; each may hold triangles, boxes or points. Nothing is left out.
[[nodiscard]] std::vector<PrimitivePair> overlapping_pairs(const Bvh& a, const Bvh& b,
                                                           const PairOptions& options = {});

/// How many there are, without keeping them.
[[nodiscard]] std::uint64_t count_overlapping_pairs(const Bvh& bvh,
                                                    const PairOptions& options = {});
[[nodiscard]] std::uint64_t count_overlapping_pairs(const Bvh& a, const Bvh& b,
                                                    const PairOptions& options = {});

}  // namespace raydix
