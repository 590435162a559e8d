// Each triangle walks down through the boxes that it reaches into and adds up the area it has
// there, except where it is at home. Triangles are independent, so they run in parallel.
#include "tree/epo.h"

#include <raydix/error.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "exec/parallel.h"
#include "tree/clip.h"
#include "tree/walk.h"

namespace raydix {
namespace {

struct Visit {
    std::uint32_t node_index;
    bool at_home;  // the triangle lies below this node: its own surface does not count here
};

/// Sum over nodes of cost(n) * the area that one triangle has in the box of n without belonging to
/// it.
double foreign_area(const Bvh& bvh, const std::vector<std::uint32_t>& begin,
                    const SahConstants& cost, std::uint32_t position, const Polygon& triangle,
                    std::vector<Visit>& waiting) {
    double sum = 0;
    waiting.assign(1, {0, true});
    while (!waiting.empty()) {
        const Visit visit = waiting.back();
        waiting.pop_back();
        const BvhNode& node = bvh.nodes()[visit.node_index];
        if (!visit.at_home) {
            const Polygon part = clip(triangle, {node.lo, node.hi});
            if (part.count == 0) continue;
            sum += (node.is_leaf() ? cost.primitive * node.count : cost.node) * part.area();
        }
        if (node.is_leaf()) continue;
        const bool at_right = position >= begin[node.first + 1];
        waiting.push_back({node.first + 1, visit.at_home && at_right});
        waiting.push_back({node.first, visit.at_home && !at_right});
    }
    return sum;
}

}  // namespace

std::optional<double> end_point_overlap(const Bvh& bvh, const SahConstants& cost, double sample) {
    if (!(sample > 0 && sample <= 1))
        throw InputError(fmt::format("EPO sample {} is not in (0, 1]", sample));
    const std::size_t n = bvh.triangles().size();
    if (n == 0) return std::nullopt;
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
                const std::size_t position =
                    (2 * i + 1) * n / (2 * sampled);  // the middle of the i-th part
                const LeafTriangle& t = bvh.triangles()[position];
                const Polygon triangle = polygon_of(t.v0, t.v1, t.v2);
                const double area = triangle.area();
                if (area == 0) continue;
                sums[b].area += area;
                sums[b].overlap += foreign_area(
                    bvh, begin, cost, static_cast<std::uint32_t>(position), triangle, waiting);
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
