// level_boxes, render_tree, render_slice: which boxes, where they are drawn, golden pictures.
#include <raydix/error.h>
#include <raydix/tree_view.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>

#include "base/math.h"
#include "build/shapes.h"
#include "report/srgb.h"
#include "support/support.h"

namespace raydix {
namespace {

double volume(const Aabb& b) {
    return double(b.hi.x - b.lo.x) * double(b.hi.y - b.lo.y) * double(b.hi.z - b.lo.z);
}

bool inside(const Aabb& box, Vec3 p) {
    return p.x >= box.lo.x && p.x <= box.hi.x && p.y >= box.lo.y && p.y <= box.hi.y &&
           p.z >= box.lo.z && p.z <= box.hi.z;
}

Vec3 pixel_at(const Picture& picture, std::uint32_t x, std::uint32_t y) {
    return picture.pixels[std::size_t{y} * picture.width + x];
}
float light(Vec3 p) { return p.x + p.y + p.z; }

TEST(LevelBoxes, OfABvhAreItsNodes) {
    const Bvh bvh = build_bvh(test::ball_and_boxes());
    const auto all = level_boxes(bvh);
    EXPECT_EQ(all.size(), bvh.inner_count() + bvh.leaf_count());
    EXPECT_EQ(all[0].level, 0u);
    std::uint32_t deepest = 0;
    for (const LevelBox& b : all) deepest = std::max(deepest, b.level);
    EXPECT_EQ(deepest, bvh.max_depth());
    std::size_t some = 0;
    for (const LevelBox& b : all) some += b.level >= 2 && b.level <= 4;
    const auto part = level_boxes(bvh, {2, 4});
    EXPECT_EQ(part.size(), some);
    for (const LevelBox& b : part) EXPECT_TRUE(b.level >= 2 && b.level <= 4);
    EXPECT_TRUE(level_boxes(bvh, {90, 99}).empty());
    EXPECT_TRUE(level_boxes(build_bvh(Mesh{})).empty());
}

TEST(LevelBoxes, OfAnOctreeAreItsNodesByLevel) {
    const Octree octree = build_octree(test::random_soup(500, 3));
    const auto all = level_boxes(octree);
    ASSERT_EQ(all.size(), octree.nodes().size());
    for (std::uint32_t node = 0; node < all.size(); ++node) {
        EXPECT_EQ(all[node].level, octree.nodes()[node].level);
        EXPECT_EQ(all[node].box.lo, node_box(octree, node).lo);
        EXPECT_EQ(all[node].box.hi, node_box(octree, node).hi);
    }
    const auto part = level_boxes(octree, {1, 2});
    EXPECT_EQ(part.size(), octree.level_nodes(1).end - octree.level_nodes(1).begin +
                               octree.level_nodes(2).end - octree.level_nodes(2).begin);
    EXPECT_TRUE(level_boxes(octree, {90, 99}).empty());
    EXPECT_TRUE(level_boxes(build_octree(Mesh{})).empty());
}

TEST(LevelBoxes, CellsOfAKdTreePartitionItsBounds) {
    std::vector<Vec3> points;
    for (const Vec3& p : test::random_soup(300, 4).vertices) points.push_back(p);
    const KdTree tree = build_kdtree(points, {.max_leaf = 1});
    const auto cells = level_boxes(tree);
    EXPECT_EQ(cells.size(), 2 * points.size() - 1);
    EXPECT_EQ(volume(cells[0].box), volume(tree.bounds()));
    // A preorder's next box is one level deeper unless this one is a leaf.
    double leaves = 0;
    std::size_t leaf_count = 0;
    for (std::size_t i = 0; i < cells.size(); ++i) {
        if (i + 1 < cells.size() && cells[i + 1].level == cells[i].level + 1) continue;
        leaves += volume(cells[i].box);
        ASSERT_TRUE(inside(cells[i].box, tree.points()[leaf_count])) << i;
        ++leaf_count;
    }
    EXPECT_EQ(leaf_count, points.size());
    EXPECT_NEAR(leaves / volume(tree.bounds()), 1.0, 1e-5);
}

TEST(LevelBoxes, EqualPointsShareACell) {
    const std::vector<Vec3> points(100, Vec3{1, 2, 3});
    EXPECT_EQ(level_boxes(build_kdtree(points, {.max_leaf = 1})).size(), 1u);
    EXPECT_TRUE(level_boxes(build_kdtree(Mesh{})).empty());
}

TEST(RenderSlice, ShowsDeeperBoxesInFrontAndTheCutOfTheScene) {
    Mesh mesh;
    test::add_box(mesh, {0, 0, 0}, {8, 6, 4});
    const Bvh bvh = build_bvh(mesh);
    const std::vector<LevelBox> boxes{
        {{{0, 0, 0}, {8, 6, 4}}, 0}, {{{4, 0, 0}, {8, 6, 4}}, 1}, {{{4, 3, 3.5f}, {8, 6, 4}}, 2}};
    SliceOptions options{.width = 200, .height = 150};
    const Picture middle = render_slice(bvh, boxes, options);
    const float left = light(pixel_at(middle, 50, 75)), right = light(pixel_at(middle, 150, 110)),
                upper = light(pixel_at(middle, 150, 40)), outside = light(pixel_at(middle, 1, 1));
    EXPECT_LT(outside, left);
    EXPECT_LT(left, right);
    EXPECT_EQ(right, upper);  // the third box starts above the plane
    options.at = 0.95f;
    const Picture top = render_slice(bvh, boxes, options);
    EXPECT_GT(light(pixel_at(top, 150, 40)), light(pixel_at(top, 150, 110)));
    // The walls of the box are cut: light lines at its frame, 3 % from the nearest border.
    const auto lightest = [](const Picture& picture, std::uint32_t width, std::uint32_t height) {
        float most = 0;
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x)
                most = std::max(most, light(pixel_at(picture, x, y)));
        return most;
    };
    EXPECT_GT(lightest(middle, 9, 150), 1.0f);
    EXPECT_LT(lightest(middle, 4, 150), 0.1f);
    options.axis = 0;  // 6 across and 4 up, so that there is room above
    const Picture side = render_slice(bvh, boxes, options);
    EXPECT_GT(lightest(side, 200, 15), 1.0f);
    EXPECT_LT(lightest(side, 200, 9), 0.1f);
}

TEST(RenderSlice, SurvivesOddScenes) {
    for (const std::vector<Vec3>& points :
         {std::vector<Vec3>{}, std::vector<Vec3>{{1, 1, 1}}, std::vector<Vec3>(5, Vec3{2, 2, 2}),
          std::vector<Vec3>{{-1e12f, 0, 0}, {1e12f, 1, 0}},
          std::vector<Vec3>{{0, 0, 0}, {1e-30f, 0, 1e-30f}}})
        for (const std::uint32_t axis : {0u, 1u, 2u}) {
            const KdTree tree = build_kdtree(points, {.max_leaf = 1});
            const Picture picture = render_slice(build_bvh(points), level_boxes(tree),
                                                 {.axis = axis, .width = 33, .height = 21});
            ASSERT_EQ(picture.pixels.size(), 33u * 21u);
            for (const Vec3& p : picture.pixels) ASSERT_TRUE(std::isfinite(light(p)));
        }
}

/// The float sum of the lower end and the size may be above the upper end.
TEST(RenderSlice, TheUpperEndIsInTheBox) {
    const Mesh mesh{
        "", {{0, 0, -0.0487069301f}, {1, 0, 2.52381113e-07f}, {0, 1, -0.0487069301f}}, {{0, 1, 2}}};
    const Bvh bvh = build_bvh(mesh);
    const SliceOptions options{.at = 1, .width = 40, .height = 40};
    const Picture with = render_slice(bvh, level_boxes(bvh), options);
    const Picture without = render_slice(bvh, {}, options);
    EXPECT_NE(light(with.pixels[20 * 40 + 20]), light(without.pixels[20 * 40 + 20]));
}

TEST(RenderSlice, RefusesWhatItCannotShow) {
    const Bvh bvh = build_bvh(test::ball_and_boxes());
    EXPECT_THROW((void)render_slice(bvh, {}, {.axis = 3}), InputError);
    EXPECT_THROW((void)render_slice(bvh, {}, {.at = -0.1f}), InputError);
    EXPECT_THROW((void)render_slice(bvh, {}, {.at = std::nanf("")}), InputError);
    EXPECT_THROW((void)render_slice(bvh, {}, {.width = 0}), InputError);
    EXPECT_THROW((void)render_slice(bvh, {}, {.height = 16385}), InputError);
}

Camera front_camera() { return {"front", {0, 0, 10}, {0, 0, 0}, {0, 1, 0}, 40}; }

RenderOptions small_picture(std::uint32_t width, std::uint32_t height) {
    RenderOptions options;
    options.width = width;
    options.height = height;
    options.samples = 4;
    return options;
}

TEST(RenderTree, DrawsBoxesWhereTheyAre) {
    Mesh mesh;
    test::add_quad(mesh, {-0.2f, -0.2f, 0}, {0.2f, -0.2f, 0}, {0.2f, 0.2f, 0}, {-0.2f, 0.2f, 0});
    const Bvh bvh = build_bvh(mesh);
    const RenderOptions options = small_picture(201, 201);
    const Picture without = render_tree(bvh, front_camera(), {}, options);
    const LevelBox box{{{-2, -2, 0}, {2, 2, 0}}, 0};
    const Picture with = render_tree(bvh, front_camera(), {&box, 1}, options);
    // 2 / (10 tan 20 degrees) of half the screen: 55 pixels from the middle.
    const auto changed = [&](std::uint32_t x, std::uint32_t y) {
        return light(pixel_at(with, x, y)) > light(pixel_at(without, x, y)) + 0.3f;
    };
    EXPECT_TRUE(changed(45, 100) || changed(46, 100));
    EXPECT_TRUE(changed(155, 100) || changed(154, 100));
    EXPECT_TRUE(changed(100, 45) || changed(100, 46));
    EXPECT_FALSE(changed(100, 100));
    EXPECT_FALSE(changed(20, 100));
}

TEST(RenderTree, LinesBehindSurfacesAreFainter) {
    Mesh mesh;
    test::add_quad(mesh, {-9, -9, 0}, {0, -9, 0}, {0, 9, 0}, {-9, 9, 0});
    const Bvh bvh = build_bvh(mesh);
    const LevelBox line{{{-4, 0, -1}, {4, 0, -1}}, 0};
    const RenderOptions options = small_picture(201, 201);
    const Picture without = render_tree(bvh, front_camera(), {}, options),
                  with = render_tree(bvh, front_camera(), {&line, 1}, options);
    const auto gain = [&](std::uint32_t x) {
        float most = 0;
        for (std::uint32_t y = 98; y < 104; ++y)
            most = std::max(most, light(pixel_at(with, x, y)) - light(pixel_at(without, x, y)));
        return most;
    };
    EXPECT_GT(gain(60), 0.05f);
    EXPECT_GT(gain(140), 2 * gain(60));
}

TEST(RenderTree, BoxesAroundTheCameraAndPointsAreFine) {
    const std::vector<Vec3> points{{0, 0, 0}, {1, 1, 1}, {-1, 2, 0}, {0, 0, 30}};
    const Bvh bvh = build_bvh(points);
    const Picture picture =
        render_tree(bvh, front_camera(), level_boxes(bvh), small_picture(64, 48));
    float most = 0;
    for (const Vec3& p : picture.pixels) {
        ASSERT_TRUE(std::isfinite(light(p)));
        most = std::max(most, light(p));
    }
    EXPECT_GT(most, 0.3f);
    const Picture empty = render_tree(build_bvh(Mesh{}), front_camera(), {}, small_picture(64, 48));
    EXPECT_EQ(empty.pixels.size(), 64u * 48u);
}

/// Boxes may come from any tree: only the order of their levels counts.
TEST(RenderTree, LevelsMayLieFarApart) {
    const Bvh bvh = build_bvh(test::ball_and_boxes());
    const Aabb box = bvh.bounds();
    const auto picture = [&](std::vector<std::uint32_t> levels) {
        std::vector<LevelBox> boxes;
        for (const std::uint32_t level : levels) boxes.push_back({box, level});
        return render_tree(bvh, front_camera(), boxes, small_picture(61, 47)).pixels;
    };
    const auto same = [](const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
        return std::memcmp(a.data(), b.data(), a.size() * sizeof(Vec3)) == 0;
    };
    EXPECT_TRUE(same(picture({0, 0xFFFFFFFFu}), picture({2, 3})));
    EXPECT_TRUE(same(picture({0xFFFFFFFFu}), picture({5})));
    EXPECT_FALSE(same(picture({0xFFFFFFFFu}), picture({})));
}

TEST(RenderTree, IsTheSameForEveryThreadCount) {
    const Bvh bvh = build_bvh(test::ball_and_boxes());
    const auto boxes = level_boxes(bvh, {0, 6});
    RenderOptions options = small_picture(61, 47);
    options.threads = 1;
    const Picture one = render_tree(bvh, front_camera(), boxes, options);
    for (const int threads : {2, 7}) {
        options.threads = threads;
        const Picture many = render_tree(bvh, front_camera(), boxes, options);
        EXPECT_EQ(
            std::memcmp(one.pixels.data(), many.pixels.data(), one.pixels.size() * sizeof(Vec3)),
            0);
    }
}

/// Pixels that differ by more than one level in a channel.
std::size_t count_far_apart(const Picture& a, const Picture& b) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < a.pixels.size(); ++i) {
        const auto apart = [](float x, float y) {
            return std::abs(srgb_byte(x) - srgb_byte(y)) > 1;
        };
        count += apart(a.pixels[i].x, b.pixels[i].x) || apart(a.pixels[i].y, b.pixels[i].y) ||
                 apart(a.pixels[i].z, b.pixels[i].z);
    }
    return count;
}

/// RAYDIX_UPDATE_GOLDEN=1 writes the picture anew: look at it before it is committed.
void expect_golden(const std::string& name, const Picture& picture) {
    SCOPED_TRACE(name);
    const std::filesystem::path golden_file = test::source_file("tests/golden/" + name);
    const char* const update = std::getenv("RAYDIX_UPDATE_GOLDEN");
    if (update && std::string_view(update) == "1") save_picture(golden_file, picture, false);
    const test::TempFolder scratch;
    save_picture(scratch.path() / name, picture, false);
    const Picture now = load_picture(scratch.path() / name), golden = load_picture(golden_file);
    ASSERT_EQ(now.width, golden.width);
    ASSERT_EQ(now.height, golden.height);
    EXPECT_LE(count_far_apart(now, golden), now.pixels.size() / 1000);
}

TEST(TreeView, GoldenPictures) {
    const Mesh mesh = test::ball_and_boxes();
    const Bvh bvh = build_bvh(mesh);
    const KdTree tree = build_kdtree(mesh);
    const Camera camera{"golden", {1.5f, 3.0f, 7.5f}, {0.1f, 0.9f, 0}, {0, 1, 0}, 40};
    RenderOptions options = small_picture(256, 192);
    options.samples = 32;
    expect_golden("tree_bvh.png", render_tree(bvh, camera, level_boxes(bvh, {0, 7}), options));
    expect_golden("tree_kdtree.png", render_tree(bvh, camera, level_boxes(tree, {0, 7}), options));
    const SliceOptions slice{.axis = 1, .at = 0.3f, .width = 256, .height = 192};
    expect_golden("slice_bvh.png", render_slice(bvh, level_boxes(bvh), slice));
    expect_golden("slice_kdtree.png", render_slice(bvh, level_boxes(tree), slice));
}

}  // namespace
}  // namespace raydix
