// The search for partners against its definition, four places at once and eight.
#include "tree/nearest_cluster.h"

#include <gtest/gtest.h>

#include <random>
#include <tuple>
#include <vector>

namespace raydix {
namespace {

std::size_t nearest(const std::vector<Aabb>& boxes, std::size_t i, std::size_t radius) {
    auto best = std::tuple(infinity, std::size_t{0}, false, i);
    for (std::size_t j = i > radius ? i - radius : 0; j < boxes.size() && j <= i + radius; ++j) {
        if (j == i) continue;
        const std::size_t first = std::min(i, j), d = std::max(i, j) - first;
        const bool goes_right =
            tie_goes_right(static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(d));
        best =
            std::min(best, std::tuple(cluster_area(unite(boxes[i], boxes[j])), d, !goes_right, j));
    }
    return std::get<3>(best);
}

class FindPartners : public testing::TestWithParam<bool> {};

TEST_P(FindPartners, AreMutualNearestNeighbours) {
    if (GetParam() && !has_wide_search()) GTEST_SKIP() << "this processor has no AVX2";
    constexpr unsigned seed = 12;
    std::mt19937 random(seed);
    const auto coordinate = [&] { return static_cast<float>(random() % 8); };  // many ties
    for (const std::uint32_t n : {1u, 2u, 3u, 7u, 100u, 511u, 512u, 513u, 1100u})
        for (const std::uint32_t radius : {1u, 4u, 7u, 8u, max_radius}) {
            std::vector<Aabb> boxes;
            BoxLanes lanes;
            lanes.reset(n);
            for (std::uint32_t i = 0; i < n; ++i) {
                const Vec3 lo{coordinate(), coordinate(), coordinate()};
                boxes.push_back({lo, {lo.x + coordinate(), lo.y + coordinate(), lo.z}});
                lanes.set(i, boxes.back());
            }
            lanes.close(n);
            std::vector<std::int8_t> partners(n);
            for (std::uint32_t begin = 0; begin < n; begin += partner_block)
                find_partners(lanes, begin, std::min(n, begin + partner_block), radius,
                              partners.data(), GetParam());
            for (std::size_t i = 0; i < n; ++i) {
                const std::size_t j = nearest(boxes, i, radius);
                const bool mutual = nearest(boxes, j, radius) == i;
                ASSERT_EQ(partners[i], mutual ? static_cast<int>(j) - static_cast<int>(i) : 0)
                    << "place " << i << " of " << n << ", radius " << radius << ", seed " << seed;
            }
        }
}

INSTANTIATE_TEST_SUITE_P(Width, FindPartners, testing::Bool(),
                         [](const auto& p) { return p.param ? "eight" : "four"; });

}  // namespace
}  // namespace raydix
