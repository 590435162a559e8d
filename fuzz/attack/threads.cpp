// Several threads at once, each with all of the library: builds, traces and refits of its own and
// of shared trees. Answers must be those of one thread; the thread sanitizer watches.
#include <raydix/closest.h>
#include <raydix/points.h>
#include <raydix/refit.h>
#include <raydix/trace.h>
#include <raydix/wide.h>

#include <atomic>
#include <thread>

#include "attack/attack.h"
#include "attack/ray_families.h"

namespace raydix::attack {
namespace {

/// What all threads share, and what one thread alone answered.
struct Shared {
    TestMesh made;
    Mesh moved;
    BuildOptions build;
    std::vector<Ray> rays;
    Bvh tree;
    WideBvh wide;
    Points points;
    std::vector<Hit> hits, moved_hits;
    std::vector<ClosestPoint> closest;
    std::string hash;
};

Shared make_shared_work(Random& random) {
    Shared shared;
    shared.made = make_mesh(random, Family::soup, 100 + random.below(400));
    shared.moved = shared.made.mesh;
    for (Vec3& p : shared.moved.vertices) p = {p.y, p.z * 2, p.x + p.y};
    do shared.build = any_build_options(random);
    while (shared.build.builder == Builder::split || shared.build.builder == Builder::sbvh);
    shared.rays = make_rays(random, shared.made.mesh, 500);
    shared.build.threads = 1;
    shared.tree = build_bvh(shared.made.mesh, shared.build);
    shared.wide = WideBvh(shared.tree, {.threads = 1});
    shared.points = build_points(std::span<const Vec3>(shared.made.mesh.vertices), {.threads = 1});
    shared.hits = trace(shared.wide, shared.rays, {.threads = 1});
    shared.closest = closest_points(shared.tree, shared.made.mesh.vertices, {.threads = 1});
    shared.hash = tree_hash(shared.tree);
    Bvh fitted = build_bvh(shared.made.mesh, shared.build);
    refit(fitted, shared.moved, 1);
    shared.moved_hits = trace(fitted, shared.rays, {.threads = 1});
    return shared;
}

/// One thread's share of a round; false if an answer differs.
bool work(const Shared& shared, std::uint64_t seed) {
    Random random(seed);
    BuildOptions build = shared.build;
    build.threads = random.whole(1, 3);
    const int threads = random.whole(1, 3);
    bool right = true;
    for (int i = 0; i < 4; ++i) {
        switch (random.below(5)) {
            case 0: {
                const Bvh own = build_bvh(shared.made.mesh, build);
                right = right && tree_hash(own) == shared.hash;
                break;
            }
            case 1: {
                TraceOptions options{.threads = threads};
                options.path = static_cast<SimdPath>(random.below(5));
                right = right && same_bytes(trace(shared.wide, shared.rays, options), shared.hits);
                break;
            }
            case 2: {
                Bvh own = build_bvh(shared.made.mesh, build);
                refit(own, shared.moved, threads);
                right = right && same_bytes(trace(own, shared.rays, {.threads = threads}),
                                            shared.moved_hits);
                break;
            }
            case 3:
                right = right && same_bytes(closest_points(shared.tree, shared.made.mesh.vertices,
                                                           {.threads = threads}),
                                            shared.closest);
                break;
            default:
                right =
                    right && knn(shared.points, shared.made.mesh.vertices, 4, {.threads = threads})
                                     .counts.invalid_queries == 0;
        }
    }
    return right;
}

}  // namespace

static void attack_threads(Case& c) {
    const Shared shared = make_shared_work(c.random);
    std::atomic<std::uint32_t> wrong{0};
    std::vector<std::thread> threads;
    const std::uint64_t seed = c.random.bits();
    for (std::uint64_t i = 0; i < 4; ++i)
        threads.emplace_back([&, i] {
            try {
                if (!work(shared, seed + i)) ++wrong;
            } catch (const std::exception&) {
                ++wrong;
            }
        });
    for (std::thread& thread : threads) thread.join();
    c.compared("threads", 16);
    if (wrong != 0)
        c.found("an answer depends on what other threads do",
                "    " + text_of(shared.build) + "\n");
}

static const Kind threads_kind("threads", attack_threads, 0.3);

}  // namespace raydix::attack
