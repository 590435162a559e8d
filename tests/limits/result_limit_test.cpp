// max_result_bytes of every call whose result can have any length: the least limit that a call
// passes with is its peak, one byte less is refused, and a refusal takes neither more memory nor
// long. All memory of this program is counted.
#include <gtest/gtest.h>
#include <malloc.h>
#include <raydix/double.h>
#include <raydix/kdtree.h>
#include <raydix/octree.h>
#include <raydix/overlap.h>
#include <raydix/pairs.h>
#include <raydix/raydix.h>
#include <raydix/wide.h>

#include <cstdlib>
#include <functional>
#include <new>
#include <string>
#include <vector>

#include "exec/memory.h"
#include "limits/memory_end.h"
#include "support/double_scenes.h"
#include "support/sanitized.h"
#include "support/support.h"

// What the library's arrays take is counted by itself; here comes what containers take.
void* operator new(std::size_t bytes) {
    if (raydix::MemoryEnd::is_here()) throw std::bad_alloc();
    void* const memory = std::malloc(bytes == 0 ? 1 : bytes);
    if (memory == nullptr) throw std::bad_alloc();
    raydix::memory_count().take(malloc_usable_size(memory));
    return memory;
}
void operator delete(void* memory) noexcept {
    if (memory == nullptr) return;
    raydix::memory_count().give_back(malloc_usable_size(memory));
    std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept { operator delete(memory); }

namespace raydix {
namespace {

/// Stacks of walks, lists of tasks, the thread pool: for up to seven threads.
constexpr std::uint64_t not_counted = 256 << 10, not_counted_alone = 64 << 10;

/// Bytes that a call holds at most beside what was there before it.
template <class Call>
std::uint64_t peak_of(const Call& call) {
    const std::uint64_t before = memory_count().now();
    memory_count().restart_peak();
    call();
    return memory_count().peak() - before;
}

float at_random(std::uint32_t& state) {
    state = state * 1664525u + 1013904223u;
    return static_cast<float>(state >> 8) * 0x1p-24f;
}
Vec3 place_at_random(std::uint32_t& state) {
    const float x = at_random(state), y = at_random(state);
    return {x, y, at_random(state)};
}

/// Large triangles, all over each other.
Mesh tangle(std::uint32_t n, float size) {
    std::uint32_t state = 7;
    Mesh mesh;
    for (std::uint32_t i = 0; i < n; ++i) {
        const Vec3 from = place_at_random(state);
        for (int corner = 0; corner < 3; ++corner) {
            const Vec3 to = place_at_random(state);
            mesh.vertices.push_back({from.x + size * (to.x - 0.5f), from.y + size * (to.y - 0.5f),
                                     from.z + size * (to.z - 0.5f)});
        }
        mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    return mesh;
}

/// Triangles one behind the other, all met by rays along z.
Mesh stack_of_triangles(std::uint32_t n) {
    Mesh mesh;
    for (std::uint32_t i = 0; i < n; ++i) {
        const auto z = static_cast<float>(i);
        for (const Vec3 corner : {Vec3{-10, -10, z}, Vec3{10, -10, z}, Vec3{0, 10, z}})
            mesh.vertices.push_back(corner);
        mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    return mesh;
}

BvhD build_in_double(const Mesh& mesh, const BuildOptions& options = {}) {
    const MeshD d = test::in_double(mesh);
    return build_bvh(d, options);
}

/// A call with a limit and a number of threads -> a number that its result decides.
struct Case {
    std::string name;
    std::function<std::uint64_t(std::uint64_t limit, int threads)> call;
};

std::uint64_t mixed(std::uint64_t sum, std::uint64_t value) {
    return (sum ^ value) * 0x9E3779B97F4A7C15u + (sum >> 29);
}
template <class List>
std::uint64_t digest_ids(const List& ids, std::uint64_t sum) {
    for (std::size_t i = 0; i < ids.size(); ++i) sum = mixed(sum, ids[i]);
    return sum;
}
template <class All>
std::uint64_t digest_hits(const All& all) {
    std::uint64_t sum = digest_ids(all.offsets, 1);
    for (const auto& hit : all.hits) sum = mixed(sum, hit.prim);
    return sum;
}
std::uint64_t digest_pairs(const std::vector<PrimitivePair>& pairs) {
    std::uint64_t sum = 1;
    for (const PrimitivePair& pair : pairs)
        sum = mixed(sum, pair.first * 0x100000001u + pair.second);
    return sum;
}
template <class Lists>
std::uint64_t digest_lists(const Lists& lists) {
    return digest_ids(lists.indices, digest_ids(lists.offsets, 1));
}

/// Everything that the calls ask. Fewer under sanitizers: each limit that is tried asks for all.
constexpr bool many = test::thorough > 1;
struct Inputs {
    Mesh mesh = tangle(many ? 600 : 250, 1.0f);
    Bvh bvh = build_bvh(mesh);
    Bvh parts = build_bvh(mesh, {.builder = Builder::sbvh});
    Bvh other = build_bvh(tangle(many ? 500 : 200, 0.8f));
    WideBvh wide{bvh};
    WideBvh compact{bvh, {.compact = true}};
    BvhD bvh_d = build_in_double(mesh);
    BvhD parts_d = build_in_double(mesh, {.builder = Builder::sbvh});
    BvhD other_d = build_in_double(tangle(many ? 500 : 200, 0.8f));
    std::vector<Vec3> places;
    std::vector<Ray> rays;
    std::vector<RayD> rays_d;
    std::vector<Segment> segments;
    std::vector<SegmentD> segments_d;
    std::vector<Sphere> spheres;
    std::vector<SphereD> spheres_d;
    std::vector<Vec3> cloud;
    std::vector<Vec2> cloud2;
    std::vector<Vec3d> cloud_d;
    std::vector<Aabb> boxes;
    Points points;
    Points2 points2;
    PointsD points_d;
    Octree octree;
    KdTree kdtree;

    Inputs() {
        std::uint32_t state = 3;
        constexpr int most = many ? 3000 : 300;
        for (int i = 0; i < most; ++i) {
            const Vec3 a = place_at_random(state), b = place_at_random(state);
            const Vec3 d{b.x - a.x, b.y - a.y, b.z - a.z};
            rays.push_back({{a.x - 3 * d.x, a.y - 3 * d.y, a.z - 3 * d.z}, 0, d, infinity});
            rays_d.push_back(
                {{a.x - 3. * d.x, a.y - 3. * d.y, a.z - 3. * d.z}, 0, {d.x, d.y, d.z}, infinity});
            segments.push_back({a, b});
            segments_d.push_back({{a.x, a.y, a.z}, {b.x, b.y, b.z}});
            spheres.push_back({a, 0.2f});
            spheres_d.push_back({{a.x, a.y, a.z}, 0.2});
            cloud.push_back(a);
            cloud2.push_back({a.x, a.y});
            cloud_d.push_back({a.x, a.y, a.z});
            boxes.push_back(
                {{a.x - 0.2f, a.y - 0.2f, a.z - 0.2f}, {a.x + 0.2f, a.y + 0.2f, a.z + 0.2f}});
        }
        points = build_points(std::span<const Vec3>(cloud));
        points2 = build_points(std::span<const Vec2>(cloud2));
        points_d = build_points(std::span<const Vec3d>(cloud_d));
        octree = build_octree(std::span<const Vec3>(cloud));
        kdtree = build_kdtree(std::span<const Vec3>(cloud));
    }
};

std::vector<Case> cases_of_rays(const Inputs& in) {
    return {{"trace_all",
             [&](std::uint64_t limit, int threads) {
                 return digest_hits(
                     trace_all(in.bvh, in.rays, {.threads = threads, .max_result_bytes = limit}));
             }},
            {"trace_all, parts",
             [&](std::uint64_t limit, int threads) {
                 return digest_hits(
                     trace_all(in.parts, in.rays,
                               {.threads = threads, .counters = true, .max_result_bytes = limit}));
             }},
            {"trace_all, wide",
             [&](std::uint64_t limit, int threads) {
                 return digest_hits(
                     trace_all(in.wide, in.rays, {.threads = threads, .max_result_bytes = limit}));
             }},
            {"trace_all, compact",
             [&](std::uint64_t limit, int threads) {
                 return digest_hits(trace_all(in.compact, in.rays,
                                              {.threads = threads, .max_result_bytes = limit}));
             }},
            {"trace_all, double", [&](std::uint64_t limit, int threads) {
                 return digest_hits(trace_all(in.bvh_d, in.rays_d,
                                              {.threads = threads, .max_result_bytes = limit}));
             }}};
}

std::vector<Case> cases_of_pairs(const Inputs& in) {
    const auto one = [](std::string name, const auto& tree, bool narrow) -> Case {
        return {std::move(name), [&tree, narrow](std::uint64_t limit, int threads) {
                    return digest_pairs(overlapping_pairs(
                        tree, {.narrow = narrow, .max_result_bytes = limit, .threads = threads}));
                }};
    };
    const auto two = [](std::string name, const auto& a, const auto& b, bool narrow) -> Case {
        return {std::move(name), [&a, &b, narrow](std::uint64_t limit, int threads) {
                    return digest_pairs(overlapping_pairs(
                        a, b, {.narrow = narrow, .max_result_bytes = limit, .threads = threads}));
                }};
    };
    return {one("pairs", in.bvh, false),
            one("pairs, narrow", in.bvh, true),
            one("pairs, parts", in.parts, false),
            one("pairs, double", in.bvh_d, false),
            one("pairs, double, parts, narrow", in.parts_d, true),
            two("pairs of two", in.bvh, in.other, false),
            two("pairs of two, parts, narrow", in.parts, in.other, true),
            two("pairs of two, double", in.bvh_d, in.other_d, false)};
}

template <class Tree, class Query>
Case touching(std::string name, const Tree& tree, const std::vector<Query>& queries) {
    return {std::move(name), [&](std::uint64_t limit, int threads) {
                const OverlapLists lists =
                    touch_all(tree, queries, {.max_result_bytes = limit, .threads = threads});
                return digest_ids(lists.prims, digest_ids(lists.offsets, 1));
            }};
}

template <class Index, class Point>
Case within(std::string name, const Index& index, const std::vector<Point>& queries,
            typename Index::Scalar radius, QueryOrder order) {
    return {std::move(name), [&index, &queries, radius, order](std::uint64_t limit, int threads) {
                return digest_lists(
                    radius_search(index, queries, radius,
                                  {.threads = threads, .order = order, .max_result_bytes = limit}));
            }};
}

std::vector<Case> cases_of_points(const Inputs& in) {
    return {
        within("radius", in.points, in.cloud, 0.2f, QueryOrder::as_given),
        within("radius, sorted", in.points, in.cloud, 0.2f, QueryOrder::sorted),
        within("radius, all", in.points, in.cloud, infinity, QueryOrder::automatic),
        within("radius, flat", in.points2, in.cloud2, 0.2f, QueryOrder::automatic),
        within("radius, double", in.points_d, in.cloud_d, 0.2, QueryOrder::automatic),
        {"box",
         [&](std::uint64_t limit, int threads) {
             return digest_lists(
                 box_search(in.points, in.boxes, {.threads = threads, .max_result_bytes = limit}));
         }},
        {"neighbours, half",
         [&](std::uint64_t limit, int threads) {
             return digest_lists(neighbour_lists(in.points, 0.2f, PairRows::half,
                                                 {.threads = threads, .max_result_bytes = limit}));
         }},
        {"neighbours, full",
         [&](std::uint64_t limit, int threads) {
             return digest_lists(neighbour_lists(in.points_d, 0.2, PairRows::full,
                                                 {.threads = threads, .max_result_bytes = limit}));
         }},
        {"knn",
         [&](std::uint64_t limit, int threads) {
             const auto nearest =
                 knn(in.points, in.cloud, 50, {.threads = threads, .max_result_bytes = limit});
             return digest_ids(nearest.indices, 1);
         }},
        {"kd_nearest",
         [&](std::uint64_t limit, int threads) {
             std::uint64_t sum = 1;
             for (const KdNeighbor& found : kd_nearest(
                      in.kdtree, in.cloud, 50, {.threads = threads, .max_result_bytes = limit}))
                 sum = mixed(sum, found.point);
             return sum;
         }},
        {"points_in_boxes",
         [&](std::uint64_t limit, int threads) {
             const PointsInBoxes found = points_in_boxes(in.octree, in.boxes, threads, limit);
             return digest_ids(found.ids, digest_ids(found.offsets, 1));
         }},
        {"points_in_box", [&](std::uint64_t limit, int) {
             return digest_ids(points_in_box(in.octree, in.octree.bounds(), limit), 1);
         }}};
}

std::vector<Case> all_cases(const Inputs& in) {
    std::vector<Case> cases = cases_of_rays(in);
    for (const auto& more : {cases_of_pairs(in), cases_of_points(in)})
        cases.insert(cases.end(), more.begin(), more.end());
    cases.push_back(touching("touch_all, segments", in.bvh, in.segments));
    cases.push_back(touching("touch_all, spheres", in.parts, in.spheres));
    cases.push_back(touching("touch_all, segments in double", in.bvh_d, in.segments_d));
    cases.push_back(touching("touch_all, spheres in double", in.parts_d, in.spheres_d));
    return cases;
}

class Limits : public testing::Test {
protected:
    static void SetUpTestSuite() { inputs = new Inputs; }
    static void TearDownTestSuite() {
        delete inputs;
        inputs = nullptr;
    }
    static Inputs* inputs;
};
Inputs* Limits::inputs = nullptr;

bool passes(const Case& c, std::uint64_t limit, int threads) {
    try {
        c.call(limit, threads);
        return true;
    } catch (const ResultTooLarge&) {
        return false;
    }
}

/// The least limit that a call passes with on one thread.
std::uint64_t least_limit(const Case& c) {
    std::uint64_t refused = 0, passed = 1 << 20;
    for (; !passes(c, passed, 1); passed *= 2) refused = passed;
    while (passed - refused > 1) {
        const std::uint64_t middle = refused + (passed - refused) / 2;
        (passes(c, middle, 1) ? passed : refused) = middle;
    }
    return passed;
}

TEST_F(Limits, TheLeastIsThePeakAndHoldsForAnyNumberOfThreads) {
    for (const Case& c : all_cases(*inputs)) {
        const std::uint64_t wanted = c.call(0, 1), least = least_limit(c);
        std::uint64_t found = 0;
        const std::uint64_t peak = peak_of([&] { found = c.call(least, 1); });
        EXPECT_EQ(found, wanted) << c.name;
        EXPECT_LE(peak, least + not_counted_alone) << c.name;
        EXPECT_GE(2 * peak, least) << c.name << " charges too much";
        const std::uint64_t before = memory_count().now();
        try {
            c.call(least - 1, 1);
            ADD_FAILURE() << c.name << " passes with less than the least";
        } catch (const ResultTooLarge& error) {
            EXPECT_GE(error.bytes(), least - 1) << c.name;
            const std::string text = error.what();
            EXPECT_NE(text.find(std::to_string(error.bytes()) + " bytes"), std::string::npos);
            EXPECT_NE(text.find("max_result_bytes lets it have " + std::to_string(least - 1)),
                      std::string::npos)
                << text;
        }
        EXPECT_EQ(memory_count().now(), before) << c.name << " leaks";
        for (const int threads : {1, 2, 7}) {
            EXPECT_EQ(c.call(4 * least, threads), wanted) << c.name;
            for (const std::uint64_t limit : {least / 100 + 1, least / 10, least / 3}) {
                bool refused = false;
                const std::uint64_t most = peak_of([&] { refused = !passes(c, limit, threads); });
                EXPECT_TRUE(refused) << c.name << ", " << threads << " threads";
                EXPECT_LE(most, limit + not_counted)
                    << c.name << ", " << threads << " threads, " << limit << " bytes";
            }
        }
    }
}

/// Refuses `call` with the limits; within the memory.
template <class Call>
void expect_quick_refusal(const char* name, const Call& call) {
    for (const std::uint64_t limit : {std::uint64_t{1} << 20, std::uint64_t{16} << 20})
        for (const int threads : {1, 2, 7}) {
            const std::uint64_t peak = peak_of([&] {
                try {
                    call(limit, threads);
                    ADD_FAILURE() << name << " is not refused";
                } catch (const ResultTooLarge&) {
                }
            });
            EXPECT_LE(peak, limit + not_counted) << name << ", " << threads << " threads";
        }
}

TEST(HugeResults, OfRaysAreRefusedAtOnce) {
    const Mesh mesh = stack_of_triangles(test::fewer(20'000, 10));
    const std::vector<Ray> rays(200'000, Ray{{0, 0, -1}, 0, {0, 0, 1}, infinity});
    const Bvh bvh = build_bvh(mesh);
    const WideBvh wide(bvh);
    expect_quick_refusal("trace_all", [&](std::uint64_t limit, int threads) {
        (void)trace_all(bvh, rays, {.threads = threads, .max_result_bytes = limit});
    });
    expect_quick_refusal("trace_all, wide", [&](std::uint64_t limit, int threads) {
        (void)trace_all(wide, rays, {.threads = threads, .max_result_bytes = limit});
    });
    const std::vector<RayD> rays_d(200'000, RayD{{0, 0, -1}, 0, {0, 0, 1}, infinity});
    const BvhD bvh_d = build_in_double(mesh);
    expect_quick_refusal("trace_all, double", [&](std::uint64_t limit, int threads) {
        (void)trace_all(bvh_d, rays_d, {.threads = threads, .max_result_bytes = limit});
    });
    const std::vector<Segment> segments(100'000, Segment{{0, 0, -1}, {0, 0, 20'001}});
    expect_quick_refusal("touch_all", [&](std::uint64_t limit, int threads) {
        (void)touch_all(bvh, segments, {.max_result_bytes = limit, .threads = threads});
    });
    const std::vector<SphereD> spheres(100'000, SphereD{{0, 0, 0}, 1e5});
    expect_quick_refusal("touch_all, double", [&](std::uint64_t limit, int threads) {
        (void)touch_all(bvh_d, spheres, {.max_result_bytes = limit, .threads = threads});
    });
}

TEST(HugeResults, OfPairsAreRefusedAtOnce) {
    const std::vector<Aabb> boxes(200'000, Aabb{{0, 0, 0}, {1, 1, 1}});
    const Bvh bvh = build_bvh(std::span<const Aabb>(boxes));
    expect_quick_refusal("pairs", [&](std::uint64_t limit, int threads) {
        (void)overlapping_pairs(bvh, {.max_result_bytes = limit, .threads = threads});
    });
    expect_quick_refusal("pairs of two", [&](std::uint64_t limit, int threads) {
        (void)overlapping_pairs(bvh, bvh, {.max_result_bytes = limit, .threads = threads});
    });
}

TEST(HugeResults, OfPointsAreRefusedAtOnce) {
    const std::vector<Vec3> cloud(300'000, Vec3{1, 2, 3});
    const Points points = build_points(std::span<const Vec3>(cloud));
    const PointQueryOptions plain;
    const auto with = [&](std::uint64_t limit, int threads) {
        PointQueryOptions options = plain;
        options.threads = threads;
        options.max_result_bytes = limit;
        return options;
    };
    expect_quick_refusal("radius", [&](std::uint64_t limit, int threads) {
        (void)radius_search(points, cloud, 1.0f, with(limit, threads));
    });
    expect_quick_refusal("neighbours", [&](std::uint64_t limit, int threads) {
        (void)neighbour_lists(points, 1.0f, PairRows::full, with(limit, threads));
    });
    const std::vector<Aabb> boxes(300'000, Aabb{{0, 0, 0}, {9, 9, 9}});
    expect_quick_refusal("boxes", [&](std::uint64_t limit, int threads) {
        (void)box_search(points, boxes, with(limit, threads));
    });
    expect_quick_refusal("knn", [&](std::uint64_t limit, int threads) {
        (void)knn(points, cloud, 0xFFFFFFFE, with(limit, threads));
    });
    const KdTree kdtree = build_kdtree(std::span<const Vec3>(cloud));
    expect_quick_refusal("kd_nearest", [&](std::uint64_t limit, int threads) {
        (void)kd_nearest(kdtree, cloud, 0xFFFFFFFF,
                         {.threads = threads, .max_result_bytes = limit});
    });
    const Octree octree = build_octree(std::span<const Vec3>(cloud));
    expect_quick_refusal("octree", [&](std::uint64_t limit, int threads) {
        (void)points_in_boxes(octree, boxes, threads, limit);
    });
    EXPECT_THROW(static_cast<void>(knn(points, cloud, 0xFFFFFFFE)), ResultTooLarge);
}

}  // namespace
}  // namespace raydix
