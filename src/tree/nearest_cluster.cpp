#include "tree/nearest_cluster.h"

#include <array>
#include <bit>
#include <limits>

#include "base/float4.h"

namespace raydix {
namespace {

constexpr std::int64_t halo = max_radius + 4;

/// Areas of the unions of i and i + d, and the nearest of each i, over one block and what lies
/// around it. Places are counted from `origin`, 2 radii before the block.
class BlockSearch {
public:
    BlockSearch(const BoxLanes& boxes, std::int64_t origin, std::uint32_t radius)
        : boxes_(boxes), origin_(origin), radius_(radius) {}

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
            const TieMasks ties(static_cast<std::uint32_t>(origin_ + k));
            Float4 best = Float4::all(std::numeric_limits<float>::infinity());
            Float4 offset = Float4::all(0);
            for (std::uint32_t d = 1; d <= radius_; ++d) {
                const Float4 right = Float4::load(row(d) + k);
                const Float4 left = Float4::load(row(d) + k - d);
                const Mask4 goes_right = (right < left) | ((right <= left) & ties.of(d));
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

private:
    static constexpr std::size_t width = partner_block + 4 * halo;

    struct Lanes {
        std::array<Float4, 6> v;
    };
    /// tie_goes_right of four places, by the lowest set bit of d.
    struct TieMasks {
        std::array<Mask4, 5> by_bit;
        explicit TieMasks(std::uint32_t i) {
            for (std::uint32_t b = 0; b < by_bit.size(); ++b) {
                std::array<std::uint32_t, 4> lanes;
                for (std::uint32_t k = 0; k < 4; ++k)
                    lanes[k] = tie_goes_right(i + k, 1u << b) ? ~0u : 0u;
                by_bit[b] = Mask4::load(lanes.data());
            }
        }
        [[nodiscard]] Mask4 of(std::uint32_t d) const {
            return by_bit[static_cast<std::size_t>(std::countr_zero(d))];
        }
    };

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

void find_partners(const BoxLanes& boxes, std::uint32_t begin, std::uint32_t end,
                   std::uint32_t radius, std::int8_t* partners) {
    // A partner may lie a radius outside of the block, and its own nearest a radius beyond that.
    const std::int64_t reach = up_to_four(radius), size = up_to_four(end - begin);
    const std::int64_t origin = std::int64_t{begin} - 2 * reach;
    BlockSearch search(boxes, origin, radius);
    search.fill_areas(0, 3 * reach + size);
    search.find_nearest(reach, 3 * reach + size);
    for (std::uint32_t i = begin; i < end; ++i) {
        const std::int64_t k = std::int64_t{i} - origin;
        const std::int32_t offset = search.nearest(k);
        partners[i] = search.nearest(k + offset) == -offset ? static_cast<std::int8_t>(offset)
                                                            : std::int8_t{0};
    }
}

}  // namespace raydix
