// All pairs of primitives that overlap: within one tree, or between two.
#pragma once

#include <raydix/bvh.h>

#include <cstdint>
#include <vector>

namespace raydix {

/// Ids of two primitives. Within one tree first < second. Between two trees `first` is of the first
/// one and `second` of the second one.
struct PrimitivePair {
    std::uint32_t first, second;

    friend constexpr bool operator==(const PrimitivePair&, const PrimitivePair&) = default;
};
static_assert(sizeof(PrimitivePair) == 8);

struct PairOptions {
    bool narrow = false;  // true: the triangles themselves must have a point in common, decided
                          // without rounding, coplanar ones included. false: their boxes
    /// The most bytes that a call which keeps the pairs may hold. 0: half of what is left to the
    /// process (result_limit.h).
    std::uint64_t max_result_bytes = 0;
    int threads = 0;  // 0 to 1,024; 0: all the machine has. Results do not depend on it
};

/// Finds all pairs of primitives whose boxes overlap or, with `narrow`, of triangles that meet. To
/// touch is to overlap. Each pair comes once, sorted by (first, second). Pairs of triangles of one
/// tree that share a corner (the same place, bit for bit) are left out. All builders give the same
/// pairs. None is ever dropped. Throws InputError: `narrow` for a tree of boxes or points. Throws
/// ResultTooLarge, an InputError, as soon as it is known that the call would take more than
/// max_result_bytes.
[[nodiscard]] std::vector<PrimitivePair> overlapping_pairs(const Bvh& bvh,
                                                           const PairOptions& options = {});
/// Between two trees; each may hold triangles, boxes or points. Nothing is left out.
[[nodiscard]] std::vector<PrimitivePair> overlapping_pairs(const Bvh& a, const Bvh& b,
                                                           const PairOptions& options = {});

/// Counts the pairs without keeping them.
[[nodiscard]] std::uint64_t count_overlapping_pairs(const Bvh& bvh,
                                                    const PairOptions& options = {});
[[nodiscard]] std::uint64_t count_overlapping_pairs(const Bvh& a, const Bvh& b,
                                                    const PairOptions& options = {});

}  // namespace raydix
