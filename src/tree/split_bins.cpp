#include "tree/split_bins.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "base/math.h"
#include "exec/parallel.h"

// A box in one register where the processor has such registers, found out at run time.
#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>
#define RAYDIX_WITH_AVX2
#define RAYDIX_AVX2 __attribute__((target("avx2")))
#define RAYDIX_AVX2_INLINE RAYDIX_AVX2 __attribute__((always_inline)) inline
#endif

namespace raydix {
namespace {

/// Shorter extents of doubled centroids are not divided: the scale would overflow.
constexpr float least_extent = 1e-30f;
/// The last centroid falls below the upper end of the last bin.
constexpr float below_one = 0.99999f;
/// Lists from this length on use two sets of bins.
constexpr std::size_t by_turns_from = 64;

/// The union of boxes, as their SplitBoxes are: the lesser of both corners, lane by lane.
struct alignas(32) Corners {
    std::array<float, 4> lo, minus_hi;

    void clear() { lo = minus_hi = {infinity, infinity, infinity, infinity}; }
    void add(const float* other_lo, const float* other_minus_hi) {
        min_of(Float4::load(lo.data()), Float4::load(other_lo)).store(lo.data());
        min_of(Float4::load(minus_hi.data()), Float4::load(other_minus_hi)).store(minus_hi.data());
    }
    [[nodiscard]] Aabb box() const {
        return {{lo[0], lo[1], lo[2]}, {-minus_hi[0], -minus_hi[1], -minus_hi[2]}};
    }
    [[nodiscard]] float area() const {
        const float x = lo[0] + minus_hi[0], y = lo[1] + minus_hi[1], z = lo[2] + minus_hi[2];
        return (x * y + y * z) + z * x;
    }
};

/// What fell into the bins with one number on the three axes. The counts of an axis are one number:
/// boxes in the lower half, primitives in the upper.
struct alignas(128) BinRow {
    std::array<Corners, 3> corners;
    std::array<std::uint64_t, 4> counts;

    void clear() {
        for (Corners& c : corners) c.clear();
        counts = {};
    }
    void add(const BinRow& other) {
        for (std::size_t axis = 0; axis < 3; ++axis)
            corners[axis].add(other.corners[axis].lo.data(), other.corners[axis].minus_hi.data());
        for (std::size_t axis = 0; axis < 4; ++axis) counts[axis] += other.counts[axis];
    }
    [[nodiscard]] std::uint32_t boxes(std::size_t axis) const {
        return static_cast<std::uint32_t>(counts[axis]);
    }
    [[nodiscard]] std::uint32_t primitives(std::size_t axis) const {
        return static_cast<std::uint32_t>(counts[axis] >> 32);
    }
    /// Area times count in the lane of each axis; NaN if nothing is there.
    [[nodiscard]] Float4 cost() const {
        const auto minus_size = [](const Corners& c) {
            return Float4::load(c.lo.data()) + Float4::load(c.minus_hi.data());
        };
        Float4 x = minus_size(corners[0]), y = minus_size(corners[1]), z = minus_size(corners[2]),
               none = Float4::all(0);
        transpose(x, y, z, none);
        const std::array<std::uint32_t, 4> count{primitives(0), primitives(1), primitives(2), 0};
        return ((x * y + y * z) + z * x) * Float4::of(count.data());
    }
};

/// The best plane of each axis.
struct PlanePerAxis {
    std::array<float, 4> cost, bin;
};

/// Boxes fall into two sets of bins by turns: neighbours in a list often share a bin, and would
/// wait for each other.
class Bins {
public:
    explicit Bins(const BinGrid& grid) : grid_(grid), bins_(grid.bins) {}

    void take(std::span<const SplitBox> boxes, [[maybe_unused]] bool wide) {
#if defined(RAYDIX_WITH_AVX2)
        if (wide) return fill_8(boxes);
#endif
        fill(boxes);
    }
    void add(const Bins& other) {
        for (std::uint32_t b = 0; b < bins_; ++b) rows_[b].add(other.rows_[b]);
    }

    [[nodiscard]] std::optional<Split> best(bool wide) const {
        const PlanePerAxis found = sweep_planes(wide);
        std::size_t axis = 0;
        for (std::size_t a = 1; a < 3; ++a)
            if (found.cost[a] < found.cost[axis]) axis = a;
        if (found.cost[axis] == infinity) return std::nullopt;
        if (found.cost[axis] == 0) return most_even();
        return split_at(axis, static_cast<std::uint32_t>(found.bin[axis]));
    }

    [[nodiscard]] SplitSides sides_of(const Split& split) const {
        Corners left, right;
        left.clear();
        right.clear();
        std::uint32_t left_count = 0, right_count = 0;
        for (std::uint32_t b = 0; b < bins_; ++b) {
            const bool is_left = static_cast<std::int32_t>(b) <= split.last_left;
            const Corners& own = rows_[b].corners[split.axis];
            (is_left ? left : right).add(own.lo.data(), own.minus_hi.data());
            (is_left ? left_count : right_count) += rows_[b].primitives(split.axis);
        }
        SplitSides sides{0, left.box(), right.box()};
        sides.cost = left.area() * static_cast<float>(left_count) +
                     right.area() * static_cast<float>(right_count);
        return sides;
    }

private:
    [[nodiscard]] PlanePerAxis sweep_planes([[maybe_unused]] bool wide) const {
#if defined(RAYDIX_WITH_AVX2)
        if (wide) return sweep_8();
#endif
        return sweep();
    }

    void fill(std::span<const SplitBox> boxes) {
        for (std::uint32_t b = 0; b < bins_; ++b) rows_[b].clear();
        const Float4 origin = Float4::load(grid_.origin.data());
        const Float4 scale = Float4::load(grid_.scale.data());
        for (const SplitBox& box : boxes) {
            std::array<std::int32_t, 4> bin;
            ((box.center2() - origin) * scale).store_whole(bin.data());
            const std::uint64_t counts = 1 + (std::uint64_t{box.count} << 32);
            for (std::size_t axis = 0; axis < 3; ++axis) {
                BinRow& row = rows_[static_cast<std::size_t>(bin[axis])];
                row.corners[axis].add(&box.lo.x, &box.minus_hi.x);
                row.counts[axis] += counts;
            }
        }
    }

    [[nodiscard]] PlanePerAxis sweep() const {
        std::array<Float4, max_bins> right_cost;
        BinRow side;
        side.clear();
        for (std::uint32_t b = bins_ - 1; b > 0; --b) {
            side.add(rows_[b]);
            right_cost[b] = side.cost();
        }
        side.clear();
        Float4 cost = Float4::all(infinity), bin = Float4::all(0);
        for (std::uint32_t b = 0; b + 1 < bins_; ++b) {
            side.add(rows_[b]);
            const Float4 here = side.cost() + right_cost[b + 1];
            const Mask4 better = here < cost;  // no for NaN
            cost = select(better, here, cost);
            bin = select(better, Float4::all(static_cast<float>(b)), bin);
        }
        PlanePerAxis best;
        cost.store(best.cost.data());
        bin.store(best.bin.data());
        return best;
    }

#if defined(RAYDIX_WITH_AVX2)
    RAYDIX_AVX2_INLINE static void clear_8(BinRow& row) {
        const __m256 none = _mm256_set1_ps(infinity);
        for (std::size_t axis = 0; axis < 3; ++axis)
            _mm256_store_ps(row.corners.data()[axis].lo.data(), none);
        _mm256_store_si256(reinterpret_cast<__m256i*>(row.counts.data()), _mm256_setzero_si256());
    }
    RAYDIX_AVX2_INLINE static void add_8(BinRow* rows, const SplitBox& box, __m128 origin,
                                         __m128 scale) {
        // The fourth lanes hold whole numbers: as floats they would be subnormal, hence slow.
        const __m256 corners =
            _mm256_blend_ps(_mm256_load_ps(&box.lo.x), _mm256_setzero_ps(), 0x88);
        const __m128 center2 =
            _mm_sub_ps(_mm256_castps256_ps128(corners), _mm256_extractf128_ps(corners, 1));
        const __m128i bin = _mm_cvttps_epi32(_mm_mul_ps(_mm_sub_ps(center2, origin), scale));
        const auto xy = static_cast<std::uint64_t>(_mm_cvtsi128_si64(bin));
        const std::uint64_t counts = 1 + (std::uint64_t{box.count} << 32);
        add_to_row_8<0>(rows[static_cast<std::uint32_t>(xy)], corners, counts);
        add_to_row_8<1>(rows[xy >> 32], corners, counts);
        add_to_row_8<2>(rows[static_cast<std::uint32_t>(_mm_extract_epi32(bin, 2))], corners,
                        counts);
    }
    template <std::size_t axis>
    RAYDIX_AVX2_INLINE static void add_to_row_8(BinRow& row, __m256 corners, std::uint64_t counts) {
        float* at = row.corners.data()[axis].lo.data();
        _mm256_store_ps(at, _mm256_min_ps(_mm256_load_ps(at), corners));
        row.counts.data()[axis] += counts;
    }

    RAYDIX_AVX2 void fill_8(std::span<const SplitBox> boxes) {
        const bool by_turns = boxes.size() >= by_turns_from;
        for (std::uint32_t b = 0; b < bins_; ++b) clear_8(rows_.data()[b]);
        const __m128 origin = _mm_load_ps(grid_.origin.data()),
                     scale = _mm_load_ps(grid_.scale.data());
        const SplitBox *box = boxes.data(), *end = box + boxes.size();
        if (!by_turns) {
            for (; box != end; ++box) add_8(rows_.data(), *box, origin, scale);
            return;
        }
        for (std::uint32_t b = 0; b < bins_; ++b) clear_8(other_rows_.data()[b]);
        for (; box + 1 < end; box += 2) {
            add_8(rows_.data(), box[0], origin, scale);
            add_8(other_rows_.data(), box[1], origin, scale);
        }
        if (box != end) add_8(rows_.data(), *box, origin, scale);
        for (std::uint32_t b = 0; b < bins_; ++b) {
            Side8 side = load_8(rows_.data()[b]);
            unite_8(side, load_8(other_rows_.data()[b]));
            BinRow& row = rows_.data()[b];
            for (std::size_t axis = 0; axis < 3; ++axis)
                _mm256_store_ps(row.corners.data()[axis].lo.data(), side.corners[axis]);
            _mm256_store_si256(reinterpret_cast<__m256i*>(row.counts.data()), side.counts);
        }
    }

    /// A BinRow in registers.
    struct Side8 {
        __m256 corners[3];
        __m256i counts;
    };
    RAYDIX_AVX2_INLINE static Side8 load_8(const BinRow& row) {
        const Corners* c = row.corners.data();
        return {{_mm256_load_ps(c[0].lo.data()), _mm256_load_ps(c[1].lo.data()),
                 _mm256_load_ps(c[2].lo.data())},
                _mm256_load_si256(reinterpret_cast<const __m256i*>(row.counts.data()))};
    }
    RAYDIX_AVX2_INLINE static void unite_8(Side8& side, const Side8& other) {
        for (std::size_t axis = 0; axis < 3; ++axis)
            side.corners[axis] = _mm256_min_ps(side.corners[axis], other.corners[axis]);
        side.counts = _mm256_add_epi64(side.counts, other.counts);
    }
    RAYDIX_AVX2_INLINE static __m128 minus_size_8(__m256 corners) {
        return _mm_add_ps(_mm256_castps256_ps128(corners), _mm256_extractf128_ps(corners, 1));
    }
    RAYDIX_AVX2_INLINE static __m128 cost_8(const Side8& side) {
        __m128 x = minus_size_8(side.corners[0]), y = minus_size_8(side.corners[1]),
               z = minus_size_8(side.corners[2]), none = _mm_setzero_ps();
        _MM_TRANSPOSE4_PS(x, y, z, none);
        const __m128 area =
            _mm_add_ps(_mm_add_ps(_mm_mul_ps(x, y), _mm_mul_ps(y, z)), _mm_mul_ps(z, x));
        const __m128i primitives = _mm_castps_si128(_mm_shuffle_ps(
            _mm_castsi128_ps(_mm256_castsi256_si128(side.counts)),
            _mm_castsi128_ps(_mm256_extracti128_si256(side.counts, 1)), _MM_SHUFFLE(3, 1, 3, 1)));
        return _mm_mul_ps(area, _mm_cvtepi32_ps(primitives));
    }

    RAYDIX_AVX2 PlanePerAxis sweep_8() const {
        alignas(16) float right_cost[max_bins][4];
        const BinRow* rows = rows_.data();
        Side8 side = load_8(rows[bins_ - 1]);
        for (std::uint32_t b = bins_ - 1;;) {
            _mm_store_ps(right_cost[b], cost_8(side));
            if (--b == 0) break;
            unite_8(side, load_8(rows[b]));
        }
        side = load_8(rows[0]);
        __m128 cost = _mm_set1_ps(infinity), bin = _mm_setzero_ps();
        for (std::uint32_t b = 0;;) {
            const __m128 here = _mm_add_ps(cost_8(side), _mm_load_ps(right_cost[b + 1]));
            const __m128 better = _mm_cmplt_ps(here, cost);
            cost = _mm_blendv_ps(cost, here, better);
            bin = _mm_blendv_ps(bin, _mm_set1_ps(static_cast<float>(b)), better);
            if (++b + 1 == bins_) break;
            unite_8(side, load_8(rows[b]));
        }
        PlanePerAxis best;
        _mm_storeu_ps(best.cost.data(), cost);
        _mm_storeu_ps(best.bin.data(), bin);
        return best;
    }
#endif

    [[nodiscard]] Split most_even() const {
        Split best{};
        std::uint32_t best_larger = ~0u;
        for (std::size_t axis = 0; axis < 3; ++axis)
            for (std::uint32_t b = 0; b + 1 < bins_; ++b) {
                const Split split = split_at(axis, b);
                const std::uint32_t right =
                    split_at(axis, bins_ - 1).left_primitives - split.left_primitives;
                const std::uint32_t larger = std::max(split.left_primitives, right);
                if (split.left_primitives == 0 || right == 0 || larger >= best_larger) continue;
                best_larger = larger;
                best = split;
            }
        return best;
    }

    [[nodiscard]] Split split_at(std::size_t axis, std::uint32_t last_left) const {
        Split split{axis, static_cast<std::int32_t>(last_left), 0, 0};
        for (std::uint32_t b = 0; b <= last_left; ++b) {
            split.left_boxes += rows_[b].boxes(axis);
            split.left_primitives += rows_[b].primitives(axis);
        }
        return split;
    }

    const BinGrid& grid_;
    std::uint32_t bins_;
    std::array<BinRow, max_bins> rows_;
    [[maybe_unused]] std::array<BinRow, max_bins> other_rows_;
};

}  // namespace

namespace {

/// Around doubled centroids.
struct CenterBounds {
    Float4 lo = Float4::all(infinity), hi = Float4::all(-infinity);

    void add(const CenterBounds& other) {
        lo = min_of(lo, other.lo);
        hi = max_of(hi, other.hi);
    }
};

CenterBounds center_bounds(std::span<const SplitBox> boxes) {
    // Two by two: each minimum waits for the one before.
    std::array<Float4, 2> lo, hi;
    lo.fill(Float4::all(infinity));
    hi.fill(Float4::all(-infinity));
    const auto take = [&](std::size_t k, const SplitBox& box) {
        const Float4 center2 = box.center2();
        lo[k] = min_of(lo[k], center2);
        hi[k] = max_of(hi[k], center2);
    };
    std::size_t i = 0;
    for (; i + 1 < boxes.size(); i += 2) {
        take(0, boxes[i]);
        take(1, boxes[i + 1]);
    }
    if (i < boxes.size()) take(0, boxes[i]);
    return {min_of(lo[0], lo[1]), max_of(hi[0], hi[1])};
}

bool in_blocks(std::size_t boxes) { return boxes >= 2 * parallel_boxes; }
std::size_t block_count(std::size_t boxes) { return (boxes + parallel_boxes - 1) / parallel_boxes; }

}  // namespace

BinGrid::BinGrid(std::span<const SplitBox> boxes, std::uint32_t most)
    : bins(bin_count(boxes.size(), most)) {
    CenterBounds all;
    if (in_blocks(boxes.size())) {
        std::vector<CenterBounds> parts(block_count(boxes.size()));
        for_each_block(boxes.size(), parallel_boxes,
                       [&](std::size_t b, std::size_t begin, std::size_t end) {
                           parts[b] = center_bounds(boxes.subspan(begin, end - begin));
                       });
        for (const CenterBounds& part : parts) all.add(part);
    } else {
        all = center_bounds(boxes);
    }
    std::array<float, 4> extent;
    all.lo.store(origin.data());
    (all.hi - all.lo).store(extent.data());
    for (std::size_t axis = 0; axis < 4; ++axis)
        scale[axis] = extent[axis] >= least_extent
                          ? below_one * static_cast<float>(bins) / extent[axis]
                          : 0.0f;
}

std::optional<Split> find_split(std::span<const SplitBox> boxes, const BinGrid& grid, bool wide,
                                SplitSides* sides) {
    if (grid.flat()) return std::nullopt;
    const auto answer = [&](const Bins& bins) {
        const std::optional<Split> split = bins.best(wide);
        if (split && sides != nullptr) *sides = bins.sides_of(*split);
        return split;
    };
    if (!in_blocks(boxes.size())) {
        Bins bins(grid);
        bins.take(boxes, wide);
        return answer(bins);
    }
    // Minima and whole numbers: as exact in parts as at once.
    std::vector<Bins> parts;
    parts.reserve(block_count(boxes.size()));
    while (parts.size() < block_count(boxes.size())) parts.emplace_back(grid);
    for_each_block(boxes.size(), parallel_boxes,
                   [&](std::size_t b, std::size_t begin, std::size_t end) {
                       parts[b].take(boxes.subspan(begin, end - begin), wide);
                   });
    for (std::size_t b = 1; b < parts.size(); ++b) parts[0].add(parts[b]);
    return answer(parts[0]);
}

namespace {

/// Stores to one of both cursors' places without a branch: nobody can guess the side.
struct Cursors {
    std::size_t left, right;

    std::size_t place(bool goes_left) {
        const std::size_t at = goes_left ? left : right;
        left += goes_left;
        right += !goes_left;
        return at;
    }
};

#if defined(RAYDIX_WITH_AVX2)
/// Whole boxes, so that who loads them next need not wait for two halves.
RAYDIX_AVX2 void divide_boxes_8(std::span<const SplitBox> from, const BinGrid& grid,
                                const Split& split, SplitBox* to, Cursors cursors) {
    const float origin = grid.origin.data()[split.axis], scale = grid.scale.data()[split.axis];
    const auto end_of_left = static_cast<float>(split.last_left + 1);
    const SplitBox *box = from.data(), *end = box + from.size();
    for (; box != end; ++box) {
        const float center2 = (&box->lo.x)[split.axis] - (&box->minus_hi.x)[split.axis];
        // Not negative, so its whole part is at most last_left.
        const bool goes_left = (center2 - origin) * scale < end_of_left;
        _mm256_store_ps(&to[cursors.place(goes_left)].lo.x, _mm256_load_ps(&box->lo.x));
    }
}
#endif

void divide_part(std::span<const SplitBox> from, const BinGrid& grid, const Split& split,
                 SplitBox* to, Cursors cursors, [[maybe_unused]] bool wide) {
#if defined(RAYDIX_WITH_AVX2)
    if (wide) return divide_boxes_8(from, grid, split, to, cursors);
#endif
    for (const SplitBox& box : from)
        to[cursors.place(grid.bin(box, split.axis) <= split.last_left)] = box;
}

}  // namespace

void divide_boxes(std::span<const SplitBox> from, const BinGrid& grid, const Split& split,
                  SplitBox* to, std::size_t right_begin, bool wide) {
    if (!in_blocks(from.size())) return divide_part(from, grid, split, to, {0, right_begin}, wide);
    std::vector<std::size_t> lefts(block_count(from.size()));
    for_each_block(from.size(), parallel_boxes,
                   [&](std::size_t b, std::size_t begin, std::size_t end) {
                       for (std::size_t k = begin; k < end; ++k)
                           lefts[b] += grid.bin(from[k], split.axis) <= split.last_left ? 1 : 0;
                   });
    std::exclusive_scan(lefts.begin(), lefts.end(), lefts.begin(), std::size_t{0});
    for_each_block(
        from.size(), parallel_boxes, [&](std::size_t b, std::size_t begin, std::size_t end) {
            const std::size_t right = right_begin + begin - lefts[b];
            divide_part(from.subspan(begin, end - begin), grid, split, to, {lefts[b], right}, wide);
        });
}

}  // namespace raydix
