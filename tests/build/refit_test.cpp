// Refit: the boxes a build with the same hierarchy would have, the hits of a new tree, and one
// clear error for what does not fit.
#include <gtest/gtest.h>
#include <raydix/check.h>
#include <raydix/closest.h>
#include <raydix/error.h>
#include <raydix/model.h>
#include <raydix/rdx.h>
#include <raydix/refit.h>
#include <raydix/trace.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <random>

#include "base/math.h"
#include "support/message.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"
#include "tree/bvh_internals.h"

namespace raydix {
namespace {

using test::message_of;

constexpr std::uint64_t refit_seed = 20061113;
constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr const char* whole_builders[] = {"karras", "lauterbach", "garanzha", "apetrei",
                                          "ploc",   "hploc",      "binned",   "sweep"};

/// Twists and swells.
Mesh deformed(Mesh mesh, float by) {
    for (Vec3& p : mesh.vertices) {
        const float angle = by * p.y, c = std::cos(angle), s = std::sin(angle);
        p = {c * p.x - s * p.z + 0.1f * by, p.y * (1 + 0.2f * by), s * p.x + c * p.z};
    }
    return mesh;
}

std::vector<Ray> rays_at(const Aabb& box, std::size_t count) {
    std::mt19937_64 random(refit_seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    const auto place = [&] {
        const Vec3 size = box.hi - box.lo;
        return Vec3{box.lo.x + unit() * size.x, box.lo.y + unit() * size.y,
                    box.lo.z + unit() * size.z};
    };
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 from = place() + 2.0f * (box.hi - box.lo);
        rays.push_back({from, 0, place() - from});
    }
    return rays;
}

bool same_hits(const std::vector<Hit>& a, const std::vector<Hit>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Hit)) == 0;
}

TEST(Refit, GivesTheHitsOfANewTree) {
    const Mesh mesh = load_model(test::sanitized ? "builtin:figure?triangles=5000"
                                                 : "builtin:figure?triangles=20000")
                          .mesh();
    for (const char* builder : whole_builders)
        for (const int threads : {1, 2, 7}) {
            if (test::thorough == 1 && threads == 2) continue;
            Bvh bvh = build_bvh(mesh, {.builder = builder_from_name(builder)});
            const std::uint32_t depth = bvh.max_depth();
            const Refitter refitter(bvh);
            for (const float by : {0.3f, 1.0f}) {
                // Sanitizers take one of them for each number of threads.
                if (test::sanitized && (by == 1.0f) == (threads == 1)) continue;
                const Mesh now = deformed(mesh, by);
                const RefitQuality quality = refitter.refit(bvh, now, threads);
                EXPECT_EQ(check(bvh, now).broken, "") << builder;
                EXPECT_TRUE(bvh.refitted());
                EXPECT_EQ(bvh.max_depth(), depth);
                const std::vector<Ray> rays = rays_at(bvh.bounds(), test::fewer(2000, 4));
                EXPECT_TRUE(same_hits(trace(bvh, rays), trace(build_bvh(now), rays))) << builder;
                const double sah = *tree_stats(bvh).sah;
                EXPECT_NEAR(quality.sah, sah, 1e-9 * sah);
                EXPECT_NEAR(quality.ratio, quality.sah / quality.sah_at_build, 1e-12);
            }
            // Back again: the very tree that was built.
            const RefitQuality back = refitter.refit(bvh, mesh, threads);
            EXPECT_NEAR(back.ratio, 1.0, 1e-9);
            const Bvh built = build_bvh(mesh, {.builder = builder_from_name(builder)});
            EXPECT_TRUE(check_same(bvh, built).ok) << builder;
        }
}

TEST(Refit, QualityTellsWhenATreeHasGoneBad) {
    Mesh mesh = test::random_soup(5000, refit_seed);
    Bvh bvh = build_bvh(mesh, {.builder = Builder::binned});
    const Refitter refitter(bvh);
    EXPECT_NEAR(refitter.refit(bvh, mesh).ratio, 1.0, 1e-9);
    for (Vec3& p : mesh.vertices) p = p + Vec3{1000, -500, 1};
    EXPECT_NEAR(refitter.refit(bvh, mesh).ratio, 1.0, 0.01) << "moved as a whole";
    std::mt19937_64 random(refit_seed);
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {  // each to another's place
        const std::size_t j = random() % mesh.triangles.size();
        for (std::size_t k = 0; k < 3; ++k)
            std::swap(mesh.vertices[3 * i + k], mesh.vertices[3 * j + k]);
    }
    EXPECT_GT(refitter.refit(bvh, mesh).ratio, 5.0);
    // The free function compares with the tree before.
    EXPECT_NEAR(refit(bvh, mesh).ratio, 1.0, 1e-9);
}

TEST(Refit, BoxesAndPointsAndFewOfThem) {
    for (const std::size_t n : {0u, 1u, 2u, 5u, 1000u}) {
        std::mt19937_64 random(refit_seed);
        const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
        std::vector<Aabb> boxes, later;
        std::vector<Vec3> points, moved;
        for (std::size_t i = 0; i < n; ++i) {
            const Vec3 p{unit(), unit(), unit()}, q{unit(), unit(), unit()};
            boxes.push_back({p, p + Vec3{0.1f, 0.1f, 0.1f}});
            later.push_back({q, q + Vec3{0.2f, 0.1f, 0.0f}});
            points.push_back(p);
            moved.push_back(q);
        }
        Bvh of_boxes = build_bvh(boxes), of_points = build_bvh(points);
        refit(of_boxes, later);
        refit(of_points, MeshView(moved, {}));
        Aabb around{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
        for (const Vec3 p : moved)
            around = {{std::min(around.lo.x, p.x), std::min(around.lo.y, p.y),
                       std::min(around.lo.z, p.z)},
                      {std::max(around.hi.x, p.x), std::max(around.hi.y, p.y),
                       std::max(around.hi.z, p.z)}};
        EXPECT_EQ(std::memcmp(
                      &around,
                      [&] {
                          static Aabb b;
                          b = of_points.bounds();
                          return &b;
                      }(),
                      sizeof(Aabb)),
                  0);
        for (std::size_t k = 0; k < n; ++k) {
            EXPECT_EQ(of_points.points()[k].x, moved[of_points.order()[k]].x);
            EXPECT_EQ(of_boxes.boxes()[k].hi.z, later[of_boxes.order()[k]].hi.z);
        }
        Mesh mesh;
        mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
        mesh.triangles.assign(n, {0, 1, 2});
        Bvh tree = build_bvh(mesh);
        if (n == 0) continue;
        mesh.vertices[2] = {0, 5, 0};
        refit(tree, mesh);
        EXPECT_EQ(tree.bounds().hi.y, 5.0f);
        EXPECT_TRUE(check(tree, mesh).ok) << check(tree, mesh).broken;
    }
}

TEST(Refit, IsSavedAndLoadedAsWhatItIs) {
    const test::TempFolder folder;
    const Mesh mesh = test::random_soup(2000, refit_seed), now = deformed(mesh, 1.0f);
    const auto file = folder.path() / "tree.rdx";
    for (const char* builder : whole_builders)
        for (const bool strict : {false, true}) {
            const BuildOptions options{.builder = builder_from_name(builder), .strict = strict};
            Bvh bvh = build_bvh(mesh, options);
            EXPECT_FALSE(bvh.refitted());
            Model scene;
            scene.mesh() = now;
            refit(bvh, now);
            ASSERT_EQ(message_of([&] { save_rdx(file, bvh, scene); }), "no error") << builder;
            const RdxFile loaded = load_rdx(file);
            EXPECT_TRUE(loaded.bvh.refitted());
            EXPECT_EQ(loaded.bvh.options().strict, strict);
            EXPECT_EQ(check(loaded.bvh, now).broken, "");
            EXPECT_TRUE(check_same(loaded.bvh, bvh).ok);
            EXPECT_EQ(tree_hash(loaded.bvh), tree_hash(bvh));
            // Built into the same memory it is a built tree again, with the hash it always had.
            BvhBuilder().build(mesh, options, bvh);
            EXPECT_FALSE(bvh.refitted());
            EXPECT_EQ(tree_hash(bvh), tree_hash(build_bvh(mesh, options)));
            scene.mesh() = mesh;
            save_rdx(file, bvh, scene);
            EXPECT_FALSE(load_rdx(file).bvh.refitted());
        }
}

/// Everything but the order of the codes still holds, and is looked at.
TEST(Refit, CheckFindsWhatIsWrongWithARefittedTree) {
    const Mesh mesh = test::random_soup(500, refit_seed), now = deformed(mesh, 1.0f);
    Bvh good = build_bvh(mesh);
    refit(good, now);
    ASSERT_EQ(check(good, now).broken, "");
    EXPECT_NE(check(good, mesh).broken, "") << "not where the primitives were";
    const auto broken = [&](const std::function<void(const BvhInternals&)>& change) {
        Bvh bvh = build_bvh(mesh);
        refit(bvh, now);
        change(BvhInternals{bvh});
        return check(bvh, now).broken;
    };
    const auto names = [](const std::string& text, const char* what) {
        return text.find(what) != std::string::npos;
    };
    EXPECT_TRUE(names(broken([](const BvhInternals& t) { t.nodes()[2].hi.x += 1.0f; }), "box"));
    EXPECT_TRUE(names(broken([](const BvhInternals& t) { t.order()[3] = t.order()[4]; }), "order"));
    EXPECT_TRUE(names(broken([](const BvhInternals& t) { ++t.max_depth(); }), "depth"));
    EXPECT_TRUE(names(broken([](const BvhInternals& t) { t.options().max_leaf = 200; }),
                      "a leaf may hold 200"));
    EXPECT_TRUE(
        names(broken([](const BvhInternals& t) { t.refitted() = false; }), "order: positions"))
        << "a tree that says it was built";
    EXPECT_NE(broken([](const BvhInternals& t) { t.triangles()[7].v0.x += 1.0f; }), "");
}

TEST(Refit, ATreeFromAFileGetsMemoryOfItsOwn) {
    const test::TempFolder folder;
    const Mesh mesh = test::random_soup(2000, refit_seed), now = deformed(mesh, 0.5f);
    Model scene;
    scene.mesh() = mesh;
    const auto file = folder.path() / "tree.rdx";
    save_rdx(file, build_bvh(mesh), scene);
    auto loaded = load_rdx(file);
    refit(loaded.bvh, now);
    const std::vector<Ray> rays = rays_at(loaded.bvh.bounds(), 1000);
    EXPECT_TRUE(same_hits(trace(loaded.bvh, rays), trace(build_bvh(now), rays)));
    EXPECT_TRUE(check(load_rdx(file).bvh, mesh).ok) << "the file stays as it is";
}

TEST(Refit, RefusesWhatDoesNotFit) {
    const Mesh mesh = test::random_soup(500, refit_seed);
    Bvh bvh = build_bvh(mesh);
    const std::string hash = tree_hash(bvh);
    const auto refused = [&](const Mesh& other) {
        const std::string text = message_of([&] { refit(bvh, other); });
        EXPECT_EQ(tree_hash(bvh), hash) << "the tree is as it was";
        return text;
    };
    Mesh fewer = mesh;
    fewer.triangles.pop_back();
    EXPECT_EQ(refused(fewer), "refit: 499 triangles, but the tree was built from 500 triangles");
    Mesh broken = mesh;
    broken.vertices[3 * 77].y = nan;
    EXPECT_EQ(refused(broken), "refit: triangle 77 is not finite or out of range now");
    Mesh outside = mesh;
    outside.triangles[4][1] = 1500;
    EXPECT_EQ(refused(outside), "triangle 4: index past the last of 1500 vertices");
    const std::vector<Aabb> boxes(500, Aabb{{0, 0, 0}, {1, 1, 1}});
    EXPECT_NE(message_of([&] { refit(bvh, boxes); }).find("500 boxes"), std::string::npos);
    // Left out at the build, valid now.
    Bvh less = build_bvh(broken);
    EXPECT_EQ(message_of([&] { refit(less, mesh); }),
              "refit: 1 triangle(s) were left out when the tree was built, but are valid now");
    EXPECT_EQ(message_of([&] { refit(less, broken); }), "no error");
    // Too small is found late.
    Mesh tiny = mesh;
    tiny.vertices[0] = {1e-20f, 0, 0};
    tiny.vertices[1] = {0, 1e-20f, 0};
    tiny.vertices[2] = {0, 0, 0};
    Bvh emptied = build_bvh(mesh);
    EXPECT_EQ(message_of([&] { refit(emptied, tiny); }),
              "refit: triangle 0 is too small now; the tree is empty");
    EXPECT_TRUE(emptied.empty());
    EXPECT_FALSE(closest_point(emptied, {0, 0, 0}).found());
    // Parts of triangles.
    const Mesh large = load_model("builtin:atrium?triangles=20000").mesh();
    for (const Builder builder : {Builder::split, Builder::sbvh}) {
        Bvh split = build_bvh(large, {.builder = builder});
        ASSERT_TRUE(split.has_split_primitives());
        EXPECT_NE(message_of([&] { refit(split, large); }).find("holds parts of triangles"),
                  std::string::npos);
    }
}

}  // namespace
}  // namespace raydix
