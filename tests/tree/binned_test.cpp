// tree/binned.h: the same tree from every instruction set that the processor has.
#include "tree/binned.h"

#include <gtest/gtest.h>

#include <bit>
#include <numeric>
#include <optional>
#include <vector>

#include "tree/cluster_cases.h"
#include "tree/split_bins.h"

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

/// Three cubes in a row cost as much divided behind the first as before the last, and each plane
/// between them as much as its neighbours in the same gap; eight cubes cost the same on each axis.
TEST(SplitBins, OfEqualPlanesTheFirstIsTaken) {
    for (const bool wide : {false, true}) {
        if (wide && split_width() < 8) continue;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            std::vector<SplitBox> row;
            for (std::uint32_t k = 0; k < 3; ++k) {
                Vec3 lo{0, 0, 0};
                (&lo.x)[axis] = static_cast<float>(k);
                row.push_back(SplitBox::of({lo, lo + Vec3{1, 1, 1}}, k, 1));
            }
            const BinGrid grid(row);
            const std::optional<Split> split = find_split(row, grid, wide);
            ASSERT_TRUE(split);
            EXPECT_EQ(split->axis, axis);
            EXPECT_EQ(split->left_boxes, 1u);
            EXPECT_EQ(split->last_left, grid.bin(row[0], axis));
        }
        std::vector<SplitBox> cube;
        for (std::uint32_t k = 0; k < 8; ++k) {
            const Vec3 lo{float(k & 1), float(k >> 1 & 1), float(k >> 2)};
            cube.push_back(SplitBox::of({lo, lo + Vec3{1, 1, 1}}, k, 1));
        }
        const std::optional<Split> split = find_split(cube, BinGrid(cube), wide);
        ASSERT_TRUE(split);
        EXPECT_EQ(split->axis, 0u);
        EXPECT_EQ(split->left_boxes, 4u);
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
