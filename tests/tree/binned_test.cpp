// tree/binned.h: the same tree from every instruction set that the processor has.
#include "tree/binned.h"

#include <gtest/gtest.h>

#include <bit>
#include <numeric>

#include "tree/cluster_cases.h"

namespace raydix::test {
namespace {

std::vector<int> widths() {
    std::vector<int> all;
    for (const int width : {4, 8, 16})
        if (width <= split_width()) all.push_back(width);
    return all;
}

bool same_node(const ClusterNode& a, const ClusterNode& b) {
    return a.lo == b.lo && a.hi == b.hi && a.left == b.left && a.right == b.right &&
           a.sum.count == b.sum.count && a.sum.inner == b.sum.inner &&
           a.sum.height == b.sum.height && a.sum.least == b.sum.least && a.sum.cost == b.sum.cost;
}

TEST(BinnedWidths, GiveTheSameTree) {
    constexpr std::uint64_t seed = 2007;
    std::vector<BoxInput> inputs = cluster_inputs(seed);
    std::mt19937_64 random(seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    BoxInput& many = inputs.emplace_back(BoxInput{"more than one task", {}});
    for (int i = 0; i < 40'000; ++i) {
        const Vec3 p{unit(), unit() - 0.5f, 100 * unit() - 50};
        many.boxes.push_back({p, {p.x + 0.01f * unit(), p.y, p.z + unit()}});
    }
    for (const BoxInput& input : inputs) {
        BoxLanes boxes;
        boxes.reset(static_cast<std::uint32_t>(input.boxes.size()));
        std::vector<std::uint32_t> ids;
        for (const Aabb& box : input.boxes)
            if (box.lo.x <= box.hi.x && box.lo.y <= box.hi.y && box.hi.x < infinity) {
                boxes.set(static_cast<std::uint32_t>(ids.size()), box);
                ids.push_back(static_cast<std::uint32_t>(ids.size()));
            }
        if (ids.empty()) continue;
        Buffer<ClusterNode> expected, nodes;
        BinnedScratch scratch;
        const ClusterRef root =
            build_binned(std::span<const std::uint32_t>(ids), ids, boxes, 4, expected, scratch, 4);
        for (const int width : widths()) {
            ASSERT_EQ(build_binned(std::span<const std::uint32_t>(ids), ids, boxes, 4, nodes,
                                   scratch, width),
                      root);
            for (std::size_t k = 0; k + 1 < ids.size(); ++k)
                ASSERT_TRUE(same_node(nodes[k], expected[k]))
                    << input.name << ", node " << k << ", width " << width << ", seed " << seed;
        }
    }
}

/// Sets of lanes with gaps, and boxes on a grid: many costs are equal.
TEST(SmallSplits, EveryWidthMakesTheSameChoice) {
    constexpr std::uint64_t seed = 16;
    std::mt19937_64 random(seed);
    for (int repeat = 0; repeat < 3000; ++repeat) {
        const std::uint64_t cells = repeat % 3 == 0 ? 2 : repeat % 3 == 1 ? 8 : 1 << 20;
        const auto coordinate = [&] { return static_cast<float>(random() % cells) - 1; };
        SmallBoxes boxes{};
        for (std::size_t lane = 0; lane < small_boxes; ++lane) {
            const Vec3 p{coordinate(), coordinate(), coordinate()};
            const Aabb box{p, {p.x + 1, p.y + coordinate() + 1, p.z + coordinate() + 1}};
            boxes.set(lane, SplitBox::of(box, 0, 1));
        }
        const auto set = static_cast<LaneSet>(repeat < 100 ? 0xFFFF : random() & 0xFFFF);
        if (std::popcount(set) < 3) continue;
        const LaneSet expected = split_small(boxes, set, 4);
        EXPECT_EQ(expected & ~set, 0u);
        EXPECT_NE(expected, 0u);
        EXPECT_NE(expected, set);
        for (const int width : widths())
            ASSERT_EQ(split_small(boxes, set, width), expected)
                << "set " << set << ", width " << width << ", seed " << seed;
    }
}

/// Two far boxes among near ones: of five or fewer no plane is needed to tell them apart.
TEST(SmallSplits, FewBoxesAreDividedAsNoPlaneCould) {
    SmallBoxes boxes{};
    // A large box around the origin, and four small ones on both sides of its centre.
    const std::array<Aabb, 5> all{{{{-10, -10, -10}, {10, 10, 10}},
                                   {{-1, -1, -1}, {-0.9f, -0.9f, -0.9f}},
                                   {{1, 1, 1}, {1.1f, 1.1f, 1.1f}},
                                   {{-1, 1, -1}, {-0.9f, 1.1f, -0.9f}},
                                   {{1, -1, 1}, {1.1f, -0.9f, 1.1f}}}};
    for (std::size_t k = 0; k < all.size(); ++k) boxes.set(3 * k, SplitBox::of(all[k], 0, 1));
    for (const int width : widths())
        EXPECT_EQ(split_small(boxes, 0b1001001001001, width), 1u) << width;
}

}  // namespace
}  // namespace raydix::test
