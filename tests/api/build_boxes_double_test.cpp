// Trees over boxes in double: nodes that hold their boxes in exact arithmetic, input that is left
// out, refits.
#include <gtest/gtest.h>
#include <raydix/raydix.h>

#include <limits>

#include "support/double_scenes.h"
#include "support/message.h"

namespace raydix::test {
namespace {

constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

std::vector<AabbD> random_boxes(std::size_t n, Vec3d place, double size, std::uint64_t seed) {
    RandomD random(seed);
    std::vector<AabbD> boxes;
    for (std::size_t i = 0; i < n; ++i) {
        const Vec3d lo = place + size * random.in({{0, 0, 0}, {1, 1, 1}});
        boxes.push_back({lo, lo + 0.05 * size * random.in({{0, 0, 0}, {1, 1, 1}})});
        if (i % 4 == 0) boxes.back().hi = lo;
    }
    return boxes;
}

/// Every leaf's node holds its boxes, and the room that is promised, with no rounding.
void expect_outward(const BoxBvhD& bvh, const std::vector<AabbD>& boxes) {
    const ExactPoint center = exact(bvh.center());
    const Exact scale(bvh.scale());
    std::size_t seen = 0;
    for (std::uint32_t slot = 0; slot < bvh.tree().nodes().size(); ++slot) {
        const BvhNode& node = bvh.tree().nodes()[slot];
        if (slot == 1 || !node.is_leaf()) continue;
        for (std::uint32_t k = node.first; k < node.first + node.count; ++k, ++seen) {
            const AabbD& box = boxes[bvh.order()[k]];
            const Vec3d far = max_of(box.hi, -1.0 * box.lo);
            const Exact room = Exact(0x1p-44) * Exact(max_of(max_of(far.x, far.y), far.z)) * scale;
            const ExactPoint lo = exact(box.lo) - center, hi = exact(box.hi) - center;
            EXPECT_LE(Exact(node.lo.x), lo.x * scale - room);
            EXPECT_LE(Exact(node.lo.y), lo.y * scale - room);
            EXPECT_LE(Exact(node.lo.z), lo.z * scale - room);
            EXPECT_GE(Exact(node.hi.x), hi.x * scale + room);
            EXPECT_GE(Exact(node.hi.y), hi.y * scale + room);
            EXPECT_GE(Exact(node.hi.z), hi.z * scale + room);
        }
    }
    EXPECT_EQ(seen, bvh.input_count() - bvh.left_out());
    const CheckReport report = check(bvh.tree());
    EXPECT_TRUE(report.ok) << report.broken;
}

TEST(BuildBoxesDouble, NodesHoldTheirBoxesExactly) {
    for (const std::vector<AabbD>& boxes :
         {random_boxes(300, {0, 0, 0}, 1.0, 1), random_boxes(300, utm_place, 100.0, 2),
          random_boxes(300, {-0.9e12, -0.9e12, -0.9e12}, 1.8e12, 3),
          random_boxes(300, {1e5, -2e5, 3e5}, 1e-6, 4), random_boxes(300, {0, 0, 0}, 1e-9, 5)})
        for (const Builder builder : {Builder::karras, Builder::hploc, Builder::binned}) {
            const BoxBvhD bvh = build_bvh(boxes, {.builder = builder, .max_leaf = 1});
            expect_outward(bvh, boxes);
            EXPECT_GT(bvh.bytes(), 0u);
        }
}

TEST(BuildBoxesDouble, SameTreeForEveryThreadCount) {
    const std::vector<AabbD> boxes = random_boxes(20000, utm_place, 100.0, 6);
    for (const Builder builder : {Builder::karras, Builder::ploc, Builder::sweep}) {
        const BoxBvhD one = build_bvh(boxes, {.builder = builder, .threads = 1});
        EXPECT_GT(one.build_ms().total, 0.0);
        for (const int threads : {2, 7}) {
            const BoxBvhD more = build_bvh(boxes, {.builder = builder, .threads = threads});
            EXPECT_EQ(tree_hash(one.tree()), tree_hash(more.tree()));
            EXPECT_EQ(one.center(), more.center());
        }
    }
}

TEST(BuildBoxesDouble, WhatIsNotValidIsLeftOut) {
    std::vector<AabbD> boxes = random_boxes(20, {0, 0, 0}, 1.0, 7);
    boxes[3].lo.x = nan;
    boxes[4].hi.y = inf;
    boxes[5].hi.z = 1.0000001e12;
    boxes[6].lo.x = boxes[6].hi.x + 1e-9;    // inverted
    boxes[7] = {{7, 7, 0}, {7, 7, 7e-14}};   // too small
    boxes[8] = {{7, -0.0, 7}, {7, 0.0, 7}};  // a point
    const BoxBvhD bvh = build_bvh(boxes);
    EXPECT_EQ(bvh.input_count(), 20u);
    EXPECT_EQ(bvh.left_out(), 5u);
    EXPECT_EQ(bvh.order().size(), 15u);
    EXPECT_EQ(bvh.bounds().hi.x, 7.0);
    expect_outward(bvh, boxes);
    EXPECT_EQ(message_of([&] { static_cast<void>(build_bvh(boxes, {.strict = true})); }),
              "box 3: not finite, out of range or inverted, as are 4 others");
    for (AabbD& box : boxes) box.lo.y = nan;
    const BoxBvhD none = build_bvh(boxes);
    EXPECT_TRUE(none.empty());
    EXPECT_EQ(none.left_out(), 20u);
    EXPECT_GT(none.bounds().lo.x, none.bounds().hi.x);
    EXPECT_TRUE(build_bvh(std::vector<AabbD>{}).empty());
    EXPECT_THROW(static_cast<void>(build_bvh(boxes, {.max_leaf = 0})), InputError);
    EXPECT_THROW(static_cast<void>(build_bvh(boxes, {.bits = 12})), InputError);
}

TEST(BuildBoxesDouble, Refit) {
    std::vector<AabbD> boxes = random_boxes(500, utm_place, 100.0, 8);
    boxes[17].lo.x = nan;
    BoxBvhD bvh = build_bvh(boxes, {.builder = Builder::ploc, .max_leaf = 2});
    RandomD random(9);
    std::vector<AabbD> moved = boxes;
    for (AabbD& box : moved) {
        const Vec3d by = Vec3d{3e6, 0, 0} + 10.0 * random.in({{-1, -1, -1}, {1, 1, 1}});
        box = {box.lo + by, box.hi + by};
    }
    const std::vector<std::uint32_t> order(bvh.order().begin(), bvh.order().end());
    for (const int threads : {1, 2, 7}) {
        const RefitQuality quality = refit(bvh, moved, threads);
        EXPECT_GT(quality.sah, 0.0);
        expect_outward(bvh, moved);
        EXPECT_TRUE(std::ranges::equal(order, bvh.order()));
        EXPECT_GT(bvh.center().x, 3e6);
    }
    const std::string hash = tree_hash(bvh.tree());
    const auto message = [&](const std::vector<AabbD>& to) {
        return message_of([&] { refit(bvh, to); });
    };
    std::vector<AabbD> bad = moved;
    bad[300].lo.z = inf;
    EXPECT_EQ(message(bad), "refit: box 300 is not finite or out of range now");
    bad = moved;
    bad[17] = bad[18];
    EXPECT_EQ(message(bad),
              "refit: 1 box(s) were left out when the tree was built, but are valid now");
    bad.pop_back();
    EXPECT_EQ(message(bad), "refit: 499 boxes, but the tree was built from 500");
    EXPECT_EQ(tree_hash(bvh.tree()), hash) << "unchanged";
    BoxBvhD empty;
    refit(empty, std::vector<AabbD>{});
    EXPECT_TRUE(empty.empty());
}

}  // namespace
}  // namespace raydix::test
