#include "tree/nearest_cluster.h"

#include <array>
#include <bit>
#include <limits>

#include "base/float4.h"

// The same lanes twice as wide where the processor has them, found out at run time. No contraction:
// the options forbid it, and the target has no fused operations.
#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>
#define RAYDIX_WITH_AVX2
#define RAYDIX_AVX2 __attribute__((target("avx2")))
#endif

namespace raydix {
namespace {

constexpr std::int64_t halo = max_radius + 4;

/// tie_goes_right of the places from 0 on, a row per lowest set bit of d. It repeats every 32
/// places.
constexpr std::size_t tie_period = 2 * max_radius;
using TieMasks = std::array<std::array<std::uint32_t, 2 * tie_period>, 5>;
constexpr TieMasks tie_masks = [] {
    TieMasks masks{};
    for (std::uint32_t b = 0; b < masks.size(); ++b)
        for (std::uint32_t i = 0; i < masks[b].size(); ++i)
            masks[b][i] = tie_goes_right(i, 1u << b) ? ~0u : 0u;
    return masks;
}();
const std::uint32_t* tie_masks_of(std::uint32_t d) {
    return tie_masks[static_cast<std::size_t>(std::countr_zero(d))].data();
}

/// Areas of the unions of i and i + d, and the nearest of each i, over one block and what lies
/// around it. Places are counted from `origin`, 2 radii before the block.
class BlockSearch {
public:
    BlockSearch(const BoxLanes& boxes, std::int64_t origin, std::uint32_t radius)
        : boxes_(boxes), origin_(origin), radius_(radius) {}

    /// nearest(k) for places [begin, end), both multiples of 4; begin is the radius at least.
    void run(std::int64_t begin, std::int64_t end, [[maybe_unused]] bool wide) {
#if defined(RAYDIX_WITH_AVX2)
        if (wide) {
            fill_areas_8(0, end);
            find_nearest_8(begin, end);
            return;
        }
#endif
        fill_areas(0, end);
        find_nearest(begin, end);
    }

    /// Rows of areas for places [begin, end), both multiples of 4.
    void fill_areas(std::int64_t begin, std::int64_t end) {
        for (std::int64_t k = begin; k < end; k += 4) {
            const Lanes own = lanes_at(k);
            for (std::uint32_t d = 1; d <= radius_; ++d)
                union_area(own, lanes_at(k + d)).store(row(d) + k);
        }
    }

    /// nearest(k) for places [begin, end), both multiples of 4; needs areas from begin - radius on.
    void find_nearest(std::int64_t begin, std::int64_t end) {
        for (std::int64_t k = begin; k < end; k += 4) {
            const std::size_t phase = phase_of(k);
            Float4 best = Float4::all(std::numeric_limits<float>::infinity());
            Float4 offset = Float4::all(0);
            for (std::uint32_t d = 1; d <= radius_; ++d) {
                const Float4 right = Float4::load(row(d) + k);
                const Float4 left = Float4::load(row(d) + k - d);
                const Mask4 goes_right =
                    (right < left) | ((right <= left) & Mask4::load(tie_masks_of(d) + phase));
                const auto step = static_cast<float>(d);
                const Float4 nearer = min_of(right, left);
                offset = select(nearer < best,
                                select(goes_right, Float4::all(step), Float4::all(-step)), offset);
                best = min_of(nearer, best);
            }
            offset.store(&nearest_[static_cast<std::size_t>(k)]);
        }
    }

    [[nodiscard]] std::int32_t nearest(std::int64_t k) const {
        return static_cast<std::int32_t>(nearest_[static_cast<std::size_t>(k)]);
    }

#if defined(RAYDIX_WITH_AVX2)
    RAYDIX_AVX2 void fill_areas_8(std::int64_t begin, std::int64_t end) {
        for (std::int64_t k = begin; k < end; k += 8) {
            std::array<const float*, 6> at;
            for (std::size_t c = 0; c < 6; ++c) at.data()[c] = boxes_.lane(c) + origin_ + k;
            const __m256 lo_x = _mm256_loadu_ps(at.data()[0]), lo_y = _mm256_loadu_ps(at.data()[1]),
                         lo_z = _mm256_loadu_ps(at.data()[2]), hi_x = _mm256_loadu_ps(at.data()[3]),
                         hi_y = _mm256_loadu_ps(at.data()[4]), hi_z = _mm256_loadu_ps(at.data()[5]);
            for (std::uint32_t d = 1; d <= radius_; ++d) {
                const __m256 x =
                    _mm256_sub_ps(_mm256_max_ps(hi_x, _mm256_loadu_ps(at.data()[3] + d)),
                                  _mm256_min_ps(lo_x, _mm256_loadu_ps(at.data()[0] + d)));
                const __m256 y =
                    _mm256_sub_ps(_mm256_max_ps(hi_y, _mm256_loadu_ps(at.data()[4] + d)),
                                  _mm256_min_ps(lo_y, _mm256_loadu_ps(at.data()[1] + d)));
                const __m256 z =
                    _mm256_sub_ps(_mm256_max_ps(hi_z, _mm256_loadu_ps(at.data()[5] + d)),
                                  _mm256_min_ps(lo_z, _mm256_loadu_ps(at.data()[2] + d)));
                const __m256 xy_yz = _mm256_add_ps(_mm256_mul_ps(x, y), _mm256_mul_ps(y, z));
                _mm256_storeu_ps(row(d) + k, _mm256_add_ps(xy_yz, _mm256_mul_ps(z, x)));
            }
        }
    }

    RAYDIX_AVX2 void find_nearest_8(std::int64_t begin, std::int64_t end) {
        for (std::int64_t k = begin; k < end; k += 8) {
            const std::size_t phase = phase_of(k);
            __m256 best = _mm256_set1_ps(infinity), offset = _mm256_setzero_ps();
            for (std::uint32_t d = 1; d <= radius_; ++d) {
                const __m256 right = _mm256_loadu_ps(row(d) + k);
                const __m256 left = _mm256_loadu_ps(row(d) + k - d);
                const __m256 ties =
                    _mm256_loadu_ps(reinterpret_cast<const float*>(tie_masks_of(d) + phase));
                const __m256 goes_right =
                    _mm256_or_ps(_mm256_cmp_ps(right, left, _CMP_LT_OQ),
                                 _mm256_and_ps(_mm256_cmp_ps(right, left, _CMP_LE_OQ), ties));
                const auto step = static_cast<float>(d);
                const __m256 nearer = _mm256_min_ps(right, left);
                const __m256 side =
                    _mm256_blendv_ps(_mm256_set1_ps(-step), _mm256_set1_ps(step), goes_right);
                offset = _mm256_blendv_ps(offset, side, _mm256_cmp_ps(nearer, best, _CMP_LT_OQ));
                best = _mm256_min_ps(nearer, best);
            }
            _mm256_storeu_ps(nearest_.data() + k, offset);
        }
    }
#endif

private:
    static constexpr std::size_t width = partner_block + 4 * halo;

    struct Lanes {
        std::array<Float4, 6> v;
    };
    [[nodiscard]] std::size_t phase_of(std::int64_t k) const {
        return static_cast<std::size_t>(origin_ + k + static_cast<std::int64_t>(2 * tie_period)) %
               tie_period;
    }
    [[nodiscard]] float* row(std::uint32_t d) { return areas_[d - 1].data(); }
    [[nodiscard]] Lanes lanes_at(std::int64_t k) const {
        Lanes lanes;
        for (std::size_t c = 0; c < 6; ++c) lanes.v[c] = Float4::load(boxes_.lane(c) + origin_ + k);
        return lanes;
    }
    /// As cluster_area of the union, to the bit.
    static Float4 union_area(const Lanes& a, const Lanes& b) {
        const Float4 x = max_of(a.v[3], b.v[3]) - min_of(a.v[0], b.v[0]);
        const Float4 y = max_of(a.v[4], b.v[4]) - min_of(a.v[1], b.v[1]);
        const Float4 z = max_of(a.v[5], b.v[5]) - min_of(a.v[2], b.v[2]);
        return (x * y + y * z) + z * x;
    }

    const BoxLanes& boxes_;
    std::int64_t origin_;
    std::uint32_t radius_;
    alignas(64) std::array<std::array<float, width>, max_radius> areas_;
    alignas(64) std::array<float, width> nearest_;
};

std::int64_t up_to_four(std::int64_t k) { return (k + 3) / 4 * 4; }

}  // namespace

bool has_wide_search() {
#if defined(RAYDIX_WITH_AVX2)
    static const bool has = __builtin_cpu_supports("avx2") != 0;
    return has;
#else
    return false;
#endif
}

void find_partners(const BoxLanes& boxes, std::uint32_t begin, std::uint32_t end,
                   std::uint32_t radius, std::int8_t* partners) {
    find_partners(boxes, begin, end, radius, partners, has_wide_search());
}

void find_partners(const BoxLanes& boxes, std::uint32_t begin, std::uint32_t end,
                   std::uint32_t radius, std::int8_t* partners, bool wide) {
    // A partner may lie a radius outside of the block, and its own nearest a radius beyond that.
    const std::int64_t reach = up_to_four(radius), size = up_to_four(end - begin);
    const std::int64_t origin = std::int64_t{begin} - 2 * reach;
    BlockSearch search(boxes, origin, radius);
    search.run(reach, 3 * reach + size, wide);
    for (std::uint32_t i = begin; i < end; ++i) {
        const std::int64_t k = std::int64_t{i} - origin;
        const std::int32_t offset = search.nearest(k);
        // A product, not a choice: nobody can guess which clusters agree.
        const std::int32_t agree = search.nearest(k + offset) == -offset;
        partners[i] = static_cast<std::int8_t>(offset * agree);
    }
}

}  // namespace raydix
