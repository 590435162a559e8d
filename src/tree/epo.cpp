// Each triangle walks down through the boxes that it reaches into and adds up the area it has
// there, except where it is at home. Triangles are independent, so they run in parallel.
#include "tree/epo.h"

#include <raydix/error.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <vector>

#include <fmt/format.h>

#include "exec/parallel.h"
#include "tree/clip.h"
#include "tree/walk.h"

namespace raydix {
namespace {

/// Where leaves have each triangle: trees with parts of triangles have some in several.
class Homes {
public:
    explicit Homes(std::span<const std::uint32_t> order) {
        positions_.resize(order.size());
        std::iota(positions_.begin(), positions_.end(), 0u);
        // By triangle, and in the order of the first leaf of each.
        std::vector<std::uint32_t> first_of;
        for (std::uint32_t position = 0; position < order.size(); ++position) {
            if (order[position] >= first_of.size()) first_of.resize(order[position] + 1, none);
            std::uint32_t& first = first_of[order[position]];
            first = std::min(first, position);
        }
        std::ranges::stable_sort(positions_, {},
                                 [&](std::uint32_t position) { return first_of[order[position]]; });
        for (std::uint32_t k = 0; k < positions_.size(); ++k)
            if (k == 0 || order[positions_[k]] != order[positions_[k - 1]]) begin_.push_back(k);
        begin_.push_back(static_cast<std::uint32_t>(positions_.size()));
    }

    /// Triangles.
    [[nodiscard]] std::size_t count() const { return begin_.size() - 1; }
    /// Of triangle i, ascending.
    [[nodiscard]] std::span<const std::uint32_t> of(std::size_t i) const {
        return std::span(positions_).subspan(begin_[i], begin_[i + 1] - begin_[i]);
    }

private:
    static constexpr std::uint32_t none = ~std::uint32_t{0};
    std::vector<std::uint32_t> positions_, begin_;
};

struct Visit {
    std::uint32_t node_index;
    std::span<const std::uint32_t> home;  // below the node: then its own surface does not count
};

/// Sum over nodes of cost(n) * the area that one triangle has in the box of n without belonging to
/// it.
double foreign_area(const Bvh& bvh, const std::vector<std::uint32_t>& begin,
                    const SahConstants& cost, std::span<const std::uint32_t> home,
                    const Polygon& triangle, std::vector<Visit>& waiting) {
    double sum = 0;
    waiting.assign(1, {0, home});
    while (!waiting.empty()) {
        const Visit visit = waiting.back();
        waiting.pop_back();
        const BvhNode& node = bvh.nodes()[visit.node_index];
        if (visit.home.empty()) {
            const Polygon part = clip(triangle, {node.lo, node.hi});
            if (part.count == 0) continue;
            sum += (node.is_leaf() ? cost.primitive * node.count : cost.node) * part.area();
        }
        if (node.is_leaf()) continue;
        const auto at_right = std::ranges::lower_bound(visit.home, begin[node.first + 1]);
        const auto left = static_cast<std::size_t>(at_right - visit.home.begin());
        waiting.push_back({node.first + 1, visit.home.subspan(left)});
        waiting.push_back({node.first, visit.home.first(left)});
    }
    return sum;
}

}  // namespace

std::optional<double> end_point_overlap(const Bvh& bvh, const SahConstants& cost, double sample) {
    if (!(sample > 0 && sample <= 1))
        throw InputError(fmt::format("EPO sample {} is not in (0, 1]", sample));
    if (bvh.triangles().empty()) return std::nullopt;
    const Homes homes(bvh.order());
    const std::size_t n = homes.count();
    const std::size_t sampled =
        std::clamp<std::size_t>(static_cast<std::size_t>(std::llround(sample * double(n))), 1, n);
    const std::vector<std::uint32_t> begin = first_positions(bvh);

    constexpr std::size_t block_triangles = 128;
    struct Sums {
        double overlap = 0, area = 0;
    };
    std::vector<Sums> sums((sampled + block_triangles - 1) / block_triangles);
    for_each_block(
        sampled, block_triangles, [&](std::size_t b, std::size_t first, std::size_t last) {
            std::vector<Visit> waiting;
            for (std::size_t i = first; i < last; ++i) {
                const auto home = homes.of((2 * i + 1) * n / (2 * sampled));  // amid the i-th part
                const LeafTriangle& t = bvh.triangles()[home.front()];
                const Polygon triangle = polygon_of(t.v0, t.v1, t.v2);
                const double area = triangle.area();
                if (area == 0) continue;
                sums[b].area += area;
                sums[b].overlap += foreign_area(bvh, begin, cost, home, triangle, waiting);
            }
        });
    Sums total;
    for (const Sums& s : sums) {
        total.overlap += s.overlap;
        total.area += s.area;
    }
    if (total.area == 0) return std::nullopt;
    return total.overlap / total.area;
}

}  // namespace raydix
