// build_bvh and BvhBuilder as their users see them: options, kept memory, the caller's
// floating-point state.
#include <raydix/bvh.h>
#include <raydix/check.h>
#include <raydix/error.h>
#include <raydix/trace.h>

#include <cstring>
#include <thread>

#include "support/message.h"
#include "support/scenes.h"
#include "support/support.h"

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

namespace raydix {
namespace {

std::string input_error_of(const MeshView& mesh, const BuildOptions& options) {
    try {
        static_cast<void>(build_bvh(mesh, options));
    } catch (const InputError& error) {
        return error.what();
    }
    return "";
}

TEST(BuildBvh, OptionsOutOfRangeAreNamed) {
    const Mesh mesh = test::random_soup(10, 1);
    EXPECT_NE(input_error_of(mesh, {.bits = 31}).find("bits is 31"), std::string::npos);
    EXPECT_NE(input_error_of(mesh, {.max_leaf = 0}).find("max_leaf is 0"), std::string::npos);
    EXPECT_NE(input_error_of(mesh, {.max_leaf = 256}).find("max_leaf is 256"), std::string::npos);
}

TEST(BuildMany, AreTheTreesOfEachMesh) {
    std::vector<Mesh> meshes;
    for (std::size_t i = 0; i < 300; ++i) meshes.push_back(test::random_soup(i % 40, 20 + i));
    const std::vector<MeshView> views(meshes.begin(), meshes.end());
    for (const int threads : {1, 2, 7})
        for (const Builder builder : {Builder::apetrei, Builder::ploc, Builder::sbvh}) {
            const std::vector<Bvh> trees =
                build_many(views, {.builder = builder, .threads = threads});
            ASSERT_EQ(trees.size(), meshes.size());
            for (std::size_t i = 0; i < trees.size(); ++i)
                EXPECT_EQ(tree_hash(trees[i]),
                          tree_hash(build_bvh(meshes[i], {.builder = builder})));
        }
    meshes[123].triangles[0][0] = 100000;
    const std::vector<MeshView> broken(meshes.begin(), meshes.end());
    EXPECT_EQ(test::message_of([&] { static_cast<void>(build_many(broken, {})); }).substr(0, 23),
              "mesh 123: triangle 0: i");
    EXPECT_TRUE(build_many(std::span<const MeshView>(), {}).empty());
}

TEST(BuildBvh, IndexPastTheVerticesNamesTheTriangle) {
    Mesh mesh = test::random_soup(100, 1);
    mesh.triangles[57][1] = 300;
    EXPECT_NE(input_error_of(mesh, {}).find("triangle 57: index 300 is past the last of 300"),
              std::string::npos);
}

TEST(BuildBvh, StrictNamesTheFirstInvalidTriangle) {
    Mesh mesh = test::random_soup(100, 1);
    mesh.vertices[3 * 40].y = std::nanf("");
    mesh.vertices[3 * 70 + 2].z = infinity;
    mesh.vertices[3 * 80].x = 2e12f;
    const Bvh bvh = build_bvh(mesh);
    EXPECT_EQ(bvh.left_out(), 3u);
    EXPECT_EQ(bvh.order().size(), 97u);
    EXPECT_TRUE(check(bvh, mesh).ok) << check(bvh, mesh).broken;
    EXPECT_NE(input_error_of(mesh, {.strict = true}).find("triangle 40"), std::string::npos);
}

TEST(BuildBvh, FewAndNoPrimitives) {
    for (std::size_t n = 0; n <= 9; ++n) {
        const Mesh mesh = test::random_soup(n, 7);
        for (const int max_leaf : {1, 2, 4}) {
            const Bvh bvh = build_bvh(mesh, {.max_leaf = max_leaf});
            EXPECT_EQ(bvh.order().size(), n);
            EXPECT_TRUE(check(bvh, mesh).ok) << n << ": " << check(bvh, mesh).broken;
        }
    }
    EXPECT_TRUE(build_bvh(std::span<const Vec3>{}).empty());
    EXPECT_TRUE(build_bvh(std::span<const Aabb>{}).empty());
    EXPECT_FALSE(closest_hit(build_bvh(Mesh{}), {{0, 0, 0}, 0, {0, 0, 1}}).hit());
}

TEST(BuildBvh, PeakMemoryIsWithinThreeTrees) {
    const Mesh mesh = test::random_soup(200000, 3);
    for (const int bits : {30, 63}) {
        const Bvh bvh = build_bvh(mesh, {.bits = bits});
        EXPECT_GT(bvh.peak_bytes(), bvh.bytes());
        EXPECT_LE(bvh.peak_bytes(), 3 * bvh.bytes());
    }
}

TEST(BvhBuilder, RebuildsInPlaceWhateverCameBefore) {
    BvhBuilder builder;
    Bvh tree;
    const std::vector<Aabb> boxes{
        {{0, 0, 0}, {1, 1, 1}}, {{2, 0, 0}, {1, 1, 1}}, {{3, 3, 3}, {4, 4, 4}}};
    for (const std::size_t n : {5000u, 100u, 0u, 1u, 20000u, 3u}) {
        const Mesh mesh = test::random_soup(n, n + 1);
        for (const int bits : {63, 30}) {
            builder.build(mesh, {.bits = bits}, tree);
            EXPECT_EQ(tree_hash(tree), tree_hash(build_bvh(mesh, {.bits = bits}))) << n;
        }
        builder.build(boxes, {}, tree);
        EXPECT_EQ(tree.left_out(), 1u);
        EXPECT_TRUE(check(tree).ok);
        builder.build(MeshView(mesh.vertices, {}), {}, tree);
        EXPECT_EQ(tree_hash(tree), tree_hash(build_bvh(std::span<const Vec3>(mesh.vertices))));
    }
}

TEST(BvhBuilder, BoxesAndPointsMayBeThoseOfTheTree) {
    const Mesh mesh = test::random_soup(2000, 5);
    std::vector<Aabb> boxes;
    for (const Vec3 p : mesh.vertices) boxes.push_back({p, {p.x + 0.1f, p.y + 0.2f, p.z + 0.1f}});
    for (std::uint32_t number = 0; number < 10; ++number) {
        const BuildOptions options{.builder = static_cast<Builder>(number)};
        BvhBuilder builder;
        Bvh tree = build_bvh(boxes, options);
        const std::vector<Aabb> in_leaf_order(tree.boxes().begin(), tree.boxes().end());
        builder.build(tree.boxes(), options, tree);
        EXPECT_EQ(check_same(tree, build_bvh(in_leaf_order, options)).broken, "") << number;
        tree = build_bvh(std::span<const Vec3>(mesh.vertices), options);
        const std::vector<Vec3> points(tree.points().begin(), tree.points().end());
        builder.build(MeshView(tree.points(), {}), options, tree);
        EXPECT_EQ(check_same(tree, build_bvh(std::span<const Vec3>(points), options)).broken, "")
            << number;
    }
}

TEST(BvhBuilder, OneThatWasMovedFromBuildsAgain) {
    const Mesh mesh = test::random_soup(300, 5);
    BvhBuilder builder;
    Bvh tree;
    builder.build(mesh, {}, tree);
    const BvhBuilder other = std::move(builder);
    const Bvh first = std::move(tree);
    builder.build(mesh, {}, tree);
    EXPECT_EQ(check_same(tree, first).broken, "");
}

TEST(BvhBuilder, ABuildThatFailsLeavesAnEmptyTree) {
    BvhBuilder builder;
    Bvh tree;
    Mesh mesh = test::random_soup(100, 1);
    builder.build(mesh, {}, tree);
    mesh.vertices[5].x = infinity;
    EXPECT_THROW(builder.build(mesh, {.strict = true}, tree), InputError);
    EXPECT_TRUE(tree.empty());
    EXPECT_TRUE(check(tree).ok);
    builder.build(mesh, {}, tree);
    EXPECT_EQ(tree.left_out(), 1u);
}

TEST(BuildBvh, ManyThreadsAtOnce) {
    const Mesh mesh = test::random_soup(20000, 11);
    const std::string expected = tree_hash(build_bvh(mesh));
    std::vector<std::string> hashes(4);
    std::vector<std::thread> threads;
    for (std::string& hash : hashes)
        threads.emplace_back([&] { hash = tree_hash(build_bvh(mesh, {.threads = 2})); });
    for (std::thread& thread : threads) thread.join();
    for (const std::string& hash : hashes) EXPECT_EQ(hash, expected);
}

#if defined(__SSE2__)
/// Coordinates so small that boxes, codes and edge functions meet denormal numbers.
Mesh tiny_soup() {
    Mesh mesh = test::random_soup(2000, 5, 0.3f);
    for (Vec3& v : mesh.vertices) v = {v.x * 1e-9f, v.y * 1e-9f, v.z * 1e-9f};
    return mesh;
}

TEST(FloatEnvironment, FlushedDenormalsOfTheCallerChangeNothing) {
    const Mesh mesh = tiny_soup();
    std::vector<Ray> rays;
    for (const Vec3& v : mesh.vertices)
        rays.push_back({{v.x, v.y + 1e-12f, -1e-9f}, 0, {0, 1e-39f, 1e-38f}});
    const std::string plain_hash = tree_hash(build_bvh(mesh));
    const std::vector<Hit> plain_hits = trace(build_bvh(mesh), rays);

    constexpr unsigned flush_both = 0x8040;
    const unsigned before = _mm_getcsr();
    _mm_setcsr(before | flush_both);
    const Bvh bvh = build_bvh(mesh);
    const std::vector<Hit> hits = trace(bvh, rays);
    const unsigned after = _mm_getcsr();
    _mm_setcsr(before);

    EXPECT_EQ(after & flush_both, flush_both) << "the caller's setting was not restored";
    EXPECT_EQ(tree_hash(bvh), plain_hash);
    std::size_t found = 0;
    for (std::size_t i = 0; i < hits.size(); ++i) {
        EXPECT_EQ(std::memcmp(&hits[i], &plain_hits[i], sizeof(Hit)), 0) << i;
        found += hits[i].hit();
    }
    EXPECT_GT(found, rays.size() / 4);
}
#endif

}  // namespace
}  // namespace raydix
