// A mesh that moves from commit to commit: the hits of a new scene each time, whatever became of
// the trees; other threads that still read what was; commits that end early.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/model.h>
#include <raydix/scene.h>
#include <raydix/trace.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <thread>
#include <utility>
#include <vector>

#include "base/math.h"
#include "support/random.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix {
namespace {

const SceneOptions moving{.usage = Usage::moving};

bool same(const Hit& a, const Hit& b) { return std::memcmp(&a, &b, sizeof(Hit)) == 0; }

std::vector<Ray> rays_into(const Aabb& box, test::Random& random, std::size_t count) {
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 from = random.in(box), to = random.in(box), out = random.in(-1, 1);
        const Vec3 origin = i % 2 == 0 ? from : from + out * 3.0f;
        rays.push_back({origin, 0, {to.x - origin.x, to.y - origin.y, to.z - origin.z}});
    }
    return rays;
}

Mesh figure(std::size_t triangles) {
    return load_flat_model("builtin:figure?triangles=" + std::to_string(triangles)).mesh();
}
void wave(const Mesh& still, float phase, float by, Mesh& out) {
    for (std::size_t i = 0; i < still.vertices.size(); ++i) {
        const Vec3 v = still.vertices[i];
        out.vertices[i] = {v.x + by * std::sin(4 * v.y + phase), v.y,
                           v.z + by * std::cos(5 * v.y + phase)};
    }
}

/// Hits of batches and of calls, and bounds, are those of a scene that was made now.
void expect_like_a_new_one(const Scene& scene, const Mesh& mesh, test::Random& random) {
    const Scene fresh(mesh);
    const Aabb box = scene.bounds(), wanted_box = fresh.bounds();
    EXPECT_EQ(std::memcmp(&box, &wanted_box, sizeof box), 0);
    const std::vector<Ray> rays = rays_into(box, random, test::fewer(2000, 200));
    const std::vector<Hit> hits = trace(scene, rays), wanted = trace(fresh, rays);
    std::vector<std::uint8_t> found(rays.size()), wanted_found(rays.size());
    trace_any(scene, rays, found);
    trace_any(fresh, rays, wanted_found);
    EXPECT_EQ(found, wanted_found);
    std::size_t different = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        different += !same(hits[i], wanted[i]);
        if (i % 16 == 0) different += !same(closest_hit(scene, rays[i]), wanted[i]);
    }
    EXPECT_EQ(different, 0u);
}

TEST(MovingMesh, RandomSequencesOfChangesAnswerAsNewScenes) {
    for (const std::uint64_t seed : {1, 2, 3, 4}) {
        SCOPED_TRACE(seed);
        test::Random random(seed);
        const Mesh still = seed % 2 == 0 ? figure(5000) : test::random_soup(700, seed, 0.1f);
        Mesh mesh = still;
        const bool shares = seed > 2;
        Mesh shared[2] = {mesh, mesh};  // what a shared mesh is stays until the next commit
        Scene scene;
        shares ? scene.share(shared[0]) : scene.add(mesh);
        scene.commit(moving);
        std::uint64_t refitted = 0;
        for (int turn = 1; turn < static_cast<int>(test::fewer(30, 4)); ++turn) {
            SCOPED_TRACE(turn);
            const std::size_t odd = random.below(mesh.vertices.size());
            wave(still, static_cast<float>(turn), 0.05f, mesh);
            if (turn % 7 == 3) mesh.vertices[odd].y = std::numeric_limits<float>::quiet_NaN();
            if (turn % 7 == 4) mesh.vertices[odd].x += 100;
            if (turn % 7 == 5) std::fill(mesh.vertices.begin(), mesh.vertices.end(), Vec3{1, 1, 1});
            if (turn % 5 == 4) std::swap(mesh.triangles[0], mesh.triangles[random.below(99) + 1]);
            if (turn % 11 == 7) mesh.triangles.pop_back();
            shared[turn % 2] = mesh;
            shares ? scene.update(0, shared[turn % 2]) : scene.update(0, mesh);
            SceneOptions options = moving;
            options.threads = turn % 3;
            refitted += scene.commit(options).trees_refitted;
            expect_like_a_new_one(scene, mesh, random);
        }
        EXPECT_GE(refitted, 2u);
    }
}

/// Meshes of few triangles are side by side, each on one thread; large ones are one by one.
TEST(MovingMesh, ManyMeshesOfAllSizesAreTheSameForEveryNumberOfThreads) {
    test::Random random(8);
    std::vector<Mesh> meshes;
    for (std::uint32_t k = 0; k < 80; ++k) {
        Mesh mesh = k % 20 == 7 ? figure(5000) : test::random_soup(k % 5 == 1 ? 700 : 12, k, 0.5f);
        const Vec3 at = random.in(-3, 3);
        for (Vec3& v : mesh.vertices) v = v + at;
        meshes.push_back(std::move(mesh));
    }
    meshes[12].vertices[3].x = std::numeric_limits<float>::quiet_NaN();  // left out
    const std::vector<Ray> rays = rays_into({{-3, -3, -3}, {4, 4, 4}}, random, 3000);
    std::vector<std::vector<Hit>> hits;
    std::vector<CommitReport> reports;
    for (const int threads : {1, 2, 3, 8}) {
        SceneOptions options = moving;
        options.threads = threads;
        Scene scene;
        for (std::uint32_t k = 0; k < meshes.size(); ++k)
            scene.add(meshes[k], {.mask = k % 3 == 0 ? 1u : 3u, .id = 100 - k});
        reports.push_back(scene.commit(options));
        hits.push_back(trace(scene, rays));
        for (std::uint32_t k = 0; k < meshes.size(); k += 2) {
            Mesh moved = meshes[k];
            wave(meshes[k], 1.0f, k % 8 == 4 ? 3.0f : 0.1f, moved);  // many are built again
            scene.update(100 - k, moved);
        }
        reports.push_back(scene.commit(options));
        hits.push_back(trace(scene, rays));
    }
    EXPECT_EQ(reports[0].trees_built, 80u);
    EXPECT_EQ(reports[0].left_out, 1u);
    EXPECT_EQ(reports[1].trees_built + reports[1].trees_refitted, 40u);
    EXPECT_GT(reports[1].trees_built, 0u);
    EXPECT_GT(reports[1].trees_refitted, 10u);
    for (std::size_t k = 2; k < hits.size(); ++k) {
        EXPECT_TRUE(std::ranges::equal(hits[k], hits[k % 2], same)) << k;
        EXPECT_EQ(reports[k].trees_built, reports[k % 2].trees_built);
        EXPECT_EQ(reports[k].trees_refitted, reports[k % 2].trees_refitted);
        EXPECT_EQ(reports[k].sah_ratio, reports[k % 2].sah_ratio);
        EXPECT_EQ(reports[k].left_out, reports[k % 2].left_out);
        EXPECT_EQ(reports[k].bytes, reports[k % 2].bytes);
    }
}

TEST(MovingMesh, OneTriangleIsRefitted) {
    test::Random random(5);
    Mesh mesh{{}, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
    Scene scene;
    scene.add(mesh);
    scene.commit(moving);
    for (int turn = 0; turn < 5; ++turn) {
        for (Vec3& v : mesh.vertices) v = random.in(-1, 1);
        scene.update(0, mesh);
        EXPECT_EQ(scene.commit(moving).trees_refitted, 1u);
        expect_like_a_new_one(scene, mesh, random);
    }
}

TEST(MovingMesh, ATreeThatWasBuiltAgainIsRefittedByItsOwnLinks) {
    test::Random random(6);
    const Mesh still = figure(5000);
    Mesh mesh = still;
    Scene scene;
    scene.add(mesh);
    scene.commit(moving);
    for (int turn = 0; turn < 3; ++turn) {
        for (std::size_t i = mesh.vertices.size(); i > 1; --i)  // worse than a new tree
            std::swap(mesh.vertices[i - 1], mesh.vertices[random.below(i)]);
        scene.update(0, mesh);
        const CommitReport report = scene.commit(moving);
        EXPECT_EQ(report.trees_built, 1u);
        EXPECT_GT(report.sah_ratio, turn == 0 ? 1.5 : 0.0);
        for (Vec3& v : mesh.vertices) v.x += 0.01f * v.y;
        scene.update(0, mesh);
        EXPECT_EQ(scene.commit(moving).trees_refitted, 1u);
        expect_like_a_new_one(scene, mesh, random);
    }
}

TEST(MovingMesh, UpdatesThatAreRefusedChangeNothing) {
    test::Random random(7);
    const Mesh mesh = figure(5000);
    Scene scene;
    scene.add(mesh);
    scene.commit(moving);
    Mesh wrong = mesh;
    wrong.vertices.pop_back();
    EXPECT_THROW(scene.update(0, wrong), InputError);  // the same triangles, fewer vertices
    wrong = mesh;
    wrong.triangles[900][1] = static_cast<std::uint32_t>(mesh.vertices.size());
    EXPECT_THROW(scene.update(0, wrong), InputError);
    wrong.triangles.clear();
    EXPECT_THROW(scene.update(0, wrong), InputError);
    EXPECT_TRUE(scene.committed());
    scene.update(0, *scene.mesh(0));  // its own arrays
    EXPECT_EQ(scene.commit(moving).trees_refitted, 1u);
    expect_like_a_new_one(scene, mesh, random);
    scene.update(0, MeshView{});
    scene.commit(moving);
    wrong = {};
    wrong.vertices = mesh.vertices;
    EXPECT_THROW(scene.update(0, wrong), InputError);  // vertices without triangles
}

TEST(MovingMesh, ThreadsThatReadTheLastFrameAreNotDisturbed) {
    test::Random random(8);
    const Mesh still = figure(5000);
    Mesh mesh = still;
    Scene inner;
    inner.add(mesh);
    inner.commit(moving);
    Scene outer;
    outer.add(inner, Transform{});
    for (int turn = 0; turn < 3; ++turn) {
        outer.commit();
        const std::vector<Ray> rays = rays_into(outer.bounds(), random, 200);
        const std::vector<Hit> wanted = trace(outer, rays, {.threads = 1});
        std::atomic<bool> done = false;
        std::atomic<std::size_t> different = 0, rounds = 0;
        std::vector<std::thread> readers;
        for (int k = 0; k < 2; ++k)
            readers.emplace_back([&] {
                while (!done || rounds < 4) {
                    const std::vector<Hit> hits = trace(outer, rays, {.threads = 1});
                    for (std::size_t i = 0; i < rays.size(); ++i)
                        different += !same(hits[i], wanted[i]);
                    ++rounds;
                }
            });
        for (int frame = 0; frame < 8; ++frame) {
            wave(still, static_cast<float>(8 * turn + frame), 0.05f, mesh);
            inner.update(0, mesh);
            EXPECT_EQ(inner.commit({.usage = Usage::moving, .threads = 2}).trees_refitted, 1u);
        }
        done = true;
        for (std::thread& reader : readers) reader.join();
        EXPECT_EQ(different, 0u);
        expect_like_a_new_one(inner, mesh, random);
    }
}

TEST(MovingMesh, ACommitThatEndsEarlyLeavesTheFrameThatWas) {
    struct Enough {};
    test::Random random(9);
    const Mesh still = figure(5000);
    Mesh mesh = still, next = still;
    Scene scene;
    scene.add(mesh);
    scene.add(test::random_soup(50, 1, 0.1f));
    scene.commit(moving);
    for (int turn = 0; turn < 6; ++turn) {
        SCOPED_TRACE(turn);
        const std::vector<Ray> rays = rays_into(scene.bounds(), random, 300);
        const std::vector<Hit> before = trace(scene, rays);
        wave(still, static_cast<float>(turn), 0.05f, next);
        scene.update(0, next);
        SceneOptions ends = moving;
        ends.progress = [&, calls = 0](double) mutable {
            if (++calls > turn % 2) throw Enough{};
        };
        EXPECT_THROW(scene.commit(ends), Enough);
        const std::vector<Hit> after = trace(scene, rays);
        for (std::size_t i = 0; i < rays.size(); ++i) ASSERT_TRUE(same(before[i], after[i]));
        EXPECT_EQ(scene.commit(moving).trees_refitted, 1u);
        Scene fresh;
        fresh.add(next);
        fresh.add(test::random_soup(50, 1, 0.1f));
        fresh.commit();
        const std::vector<Hit> hits = trace(scene, rays), wanted = trace(fresh, rays);
        for (std::size_t i = 0; i < rays.size(); ++i) ASSERT_TRUE(same(hits[i], wanted[i]));
    }
}

}  // namespace
}  // namespace raydix
