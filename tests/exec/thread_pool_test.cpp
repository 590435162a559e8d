// Loops on a pool of the caller's: all of a loop is done, within limits and on the pool's threads,
// exceptions come out, and no answer changes.
#include <gtest/gtest.h>
#include <raydix/bvh.h>
#include <raydix/double.h>
#include <raydix/raydix.h>
#include <raydix/scene_queries.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <deque>
#include <functional>
#include <mutex>
#include <set>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "base/float_env.h"
#include "exec/parallel.h"
#include "support/message.h"

namespace raydix {
namespace {

/// A thread for each job, and what was seen of them.
struct Seen {
    std::atomic<int> loops{0};
    std::atomic<std::size_t> most_jobs{0};
    std::mutex lock;
    std::set<std::thread::id> threads;
};

/// In use for its lifetime.
class PoolInUse {
public:
    explicit PoolInUse(int workers) {
        use_thread_pool({.workers = [workers] { return workers; },
                         .run = [this](std::size_t jobs, const auto& job) { run(jobs, job); }});
    }
    ~PoolInUse() { use_thread_pool({}); }
    PoolInUse(const PoolInUse&) = delete;
    PoolInUse& operator=(const PoolInUse&) = delete;

    Seen seen;

private:
    void run(std::size_t jobs, const std::function<void(std::size_t)>& job) {
        ++seen.loops;
        for (std::size_t before = seen.most_jobs; jobs > before;)
            if (seen.most_jobs.compare_exchange_weak(before, jobs)) break;
        std::vector<std::thread> threads;
        for (std::size_t i = 0; i < jobs; ++i)
            threads.emplace_back([this, &job, i] {
                {
                    const std::scoped_lock held(seen.lock);
                    seen.threads.insert(std::this_thread::get_id());
                }
                job(i);
            });
        for (std::thread& thread : threads) thread.join();
    }
};

TEST(ThreadPool, RunsAllOfALoopOnItsThreads) {
    PoolInUse pool(4);
    EXPECT_EQ(thread_count(), 4);
    std::vector<std::atomic<int>> visits(10'007);
    std::atomic<int> elsewhere{0}, flushed{0};
    for_each_index(
        visits.size(),
        [&](std::size_t i) {
            ++visits[i];
            flushed += !FloatEnvironment::is_plain();
            const std::scoped_lock held(pool.seen.lock);
            elsewhere += pool.seen.threads.count(std::this_thread::get_id()) == 0;
        },
        10);
    for (std::size_t i = 0; i < visits.size(); ++i) ASSERT_EQ(visits[i], 1) << i;
    EXPECT_EQ(elsewhere, 0);
    EXPECT_EQ(flushed, 0);
    EXPECT_EQ(pool.seen.loops, 1);
    EXPECT_EQ(pool.seen.most_jobs, 4u);
}

TEST(ThreadPool, LoopsInsideOfAJobStayOnItsThread) {
    PoolInUse pool(3);
    std::atomic<std::uint64_t> sum{0};
    std::atomic<int> strayed{0};
    for_each_index(
        16,
        [&](std::size_t i) {
            const auto here = std::this_thread::get_id();
            EXPECT_EQ(thread_count(), 1);
            for_each_index(
                100,
                [&](std::size_t k) {
                    sum += i * k;
                    strayed += std::this_thread::get_id() != here;
                },
                1);
        },
        1);
    EXPECT_EQ(sum, (15u * 16 / 2) * (99 * 100 / 2));
    EXPECT_EQ(strayed, 0);
    EXPECT_EQ(pool.seen.loops, 1);
}

TEST(ThreadPool, CallsInsideOfAJobGetNoMoreThreadsForTheAsking) {
    PoolInUse pool(3);
    std::atomic<int> strayed{0};
    for_each_index(
        16,
        [&](std::size_t) {
            const auto here = std::this_thread::get_id();
            with_threads(2, [&] {
                EXPECT_EQ(thread_count(), 1);
                for_each_index(
                    100, [&](std::size_t) { strayed += std::this_thread::get_id() != here; }, 1);
            });
        },
        1);
    EXPECT_EQ(strayed, 0);
    EXPECT_EQ(pool.seen.loops, 1);
}

TEST(ThreadPool, LimitsHold) {
    PoolInUse pool(6);
    for (const int threads : {1, 2, 5, 64}) {
        pool.seen.most_jobs = 0;
        std::atomic<int> count{0};
        with_threads(threads, [&] {
            EXPECT_EQ(thread_count(), std::min(threads, 6));
            for_each_index(
                1000, [&](std::size_t) { ++count; }, 1);
        });
        EXPECT_EQ(count, 1000);
        EXPECT_EQ(pool.seen.most_jobs, threads == 1 ? 0u : std::min<std::size_t>(threads, 6));
    }
}

TEST(ThreadPool, ExceptionsComeOut) {
    PoolInUse pool(3);
    const auto loop = [] {
        for_each_index(
            100,
            [](std::size_t i) {
                if (i == 50) throw InputError("mine");
            },
            1);
    };
    EXPECT_EQ(test::message_of(loop), "mine");
}

TEST(ThreadPool, APoolThatSaysNoneHasOne) {
    PoolInUse pool(0);
    EXPECT_EQ(thread_count(), 1);
    int count = 0;
    for_each_index(
        100, [&](std::size_t) { ++count; }, 1);
    EXPECT_EQ(count, 100);
}

TEST(ThreadPool, HalfOfOneIsRefused) {
    EXPECT_EQ(test::message_of([] { use_thread_pool({.workers = [] { return 2; }}); }),
              "a thread pool needs both functions, workers and run; one is missing");
}

/// Runs loops on the calling thread, and throws in place of one of them.
class RefusingPool {
public:
    explicit RefusingPool(int refused) {
        use_thread_pool({.workers = [] { return 4; },
                         .run =
                             [this, refused](std::size_t jobs, const auto& job) {
                                 if (loops++ == refused) throw std::runtime_error("no room");
                                 for (std::size_t i = 0; i < jobs; ++i) job(i);
                             }});
    }
    ~RefusingPool() { use_thread_pool({}); }
    RefusingPool(const RefusingPool&) = delete;
    RefusingPool& operator=(const RefusingPool&) = delete;

    int loops = 0;
};

/// How many loops `call` has that the pool is asked to run.
template <class Call>
int loops_of(const Call& call) {
    const RefusingPool pool(-1);
    call();
    return pool.loops;
}
/// Whether `call` throws what the pool throws.
template <class Call>
bool is_refused(int loop, const Call& call) {
    const RefusingPool pool(loop);
    try {
        call();
    } catch (const std::runtime_error&) {
        return true;
    }
    return false;
}

/// A thread that takes up other tasks while it waits for a loop of its own.
class HelpingPool {
public:
    HelpingPool() {
        use_thread_pool({.workers = [] { return 2; },
                         .run =
                             [this](std::size_t jobs, const auto& job) {
                                 std::size_t left = jobs;
                                 for (std::size_t i = 0; i < jobs; ++i)
                                     tasks.push_back([&job, &left, i] { job(i), --left; });
                                 while (left > 0) run_one();
                             }});
    }
    ~HelpingPool() { use_thread_pool({}); }
    HelpingPool(const HelpingPool&) = delete;
    HelpingPool& operator=(const HelpingPool&) = delete;

    void run_one() {
        const auto task = std::move(tasks.front());
        tasks.pop_front();
        task();
    }

    std::deque<std::function<void()>> tasks;
};

/// What a scene makes for the first query of distance must not wait for a second one that the pool
/// hands to the same thread.
TEST(ThreadPool, FirstQueriesOfDistanceDoNotWaitForEachOther) {
    std::vector<Vec3> corners;  // of triangles without area, which such queries list in a loop
    std::vector<Triangle> triangles;
    for (std::uint32_t i = 0; i < 40000; ++i) {
        const auto x = static_cast<float>(i);
        corners.insert(corners.end(), {{x, 0, 0}, {x + 1, 0, 0}, {x + 1, 0, 0}});
        triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    const Scene scene(MeshView{corners, triangles});
    HelpingPool pool;
    int answered = 0;
    for (int k = 0; k < 2; ++k)
        pool.tasks.push_back([&] {
            answered += closest_point(scene, {5.25f, 3, 0}).distance == 3.0f;
        });
    while (!pool.tasks.empty()) pool.run_one();
    EXPECT_EQ(answered, 2);
}

/// So many points that the loops over groups of them are more than one thread's.
TEST(ThreadPool, ChangingPointsStayWholeWhenALoopIsRefused) {
    std::vector<Vec3> points;
    for (std::uint32_t i = 0; i < 120'000; ++i)
        points.push_back({float(i % 311), float(i % 353), float(i % 397)});
    const std::span all(points), first = all.first(100'000), rest = all.subspan(100'000),
                                 queries = all.first(20);
    const Points built = build_points(first);
    Points grown = build_points(first);
    const int loops = loops_of([&] { grown.insert(rest); });
    EXPECT_GT(loops, 3);
    for (int loop = 0; loop < loops; ++loop) {
        Points index = build_points(first);
        const bool thrown = is_refused(loop, [&] { index.insert(rest); });
        EXPECT_EQ(index.size(), thrown ? 100'000u : 120'000u) << loop;
        EXPECT_EQ(index.order().size(), index.size()) << loop;
        const auto found = knn(index, queries, 3), wanted = knn(thrown ? built : grown, queries, 3);
        EXPECT_TRUE(std::ranges::equal(found.indices.view(), wanted.indices.view())) << loop;
    }
}

/// What was taken out is told, whether or not the rest could be built again.
TEST(ThreadPool, RemovalsAreDoneWhereALoopIsRefused) {
    std::vector<Vec3> points;
    std::vector<std::uint32_t> even;
    for (std::uint32_t i = 0; i < 60'000; ++i) {
        points.push_back({float(i % 311), float(i % 353), float(i % 397)});
        if (i % 2 == 0) even.push_back(i);
    }
    const std::span queries = std::span<const Vec3>(points).first(20);
    Points wanted = build_points(points);
    const int loops = loops_of([&] { EXPECT_EQ(wanted.remove(even), 30'000u); });
    EXPECT_GT(loops, 3) << "all is built again";
    const auto nearest = knn(wanted, queries, 3);
    for (int loop = 0; loop < loops; ++loop) {
        Points index = build_points(points);
        EXPECT_FALSE(is_refused(loop, [&] { EXPECT_EQ(index.remove(even), 30'000u); })) << loop;
        EXPECT_EQ(index.size(), 30'000u) << loop;
        const auto found = knn(index, queries, 3);
        EXPECT_TRUE(std::ranges::equal(found.indices.view(), nearest.indices.view())) << loop;
        EXPECT_EQ(index.remove(std::span(even).first(1)), 0u);
    }
}

TEST(ThreadPool, RefitsInDoubleStayWholeWhenALoopIsRefused) {
    MeshD mesh;
    for (std::uint32_t i = 0; i < 20'000; ++i) {
        const double x = i % 100, y = i / 100;
        mesh.vertices.insert(mesh.vertices.end(), {{x, y, 0}, {x + 1, y, 0}, {x, y + 1, 1}});
        mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    MeshD moved = mesh;
    for (Vec3d& p : moved.vertices) p.x += 1000;
    const RayD at_old{{50.25, 50.25, -9}, 0, {0, 0, 1}}, at_new{{1050.25, 50.25, -9}, 0, {0, 0, 1}};
    BvhD refitted = build_bvh(mesh);
    const int loops = loops_of([&] { refit(refitted, moved); });
    EXPECT_GT(loops, 3);
    for (int loop = 0; loop < loops; ++loop) {
        BvhD tree = build_bvh(mesh);
        const bool thrown = is_refused(loop, [&] { refit(tree, moved); });
        EXPECT_EQ(any_hit(tree, at_old), thrown) << loop;
        EXPECT_EQ(any_hit(tree, at_new), !thrown) << loop;
    }
}

/// A scene's tree and hits, and neighbours of its vertices, as bytes.
std::string answers() {
    const Model model = load_model("builtin:figure?triangles=5000");
    const Scene scene(model);
    const auto rays = make_primary_rays(model.cameras.cameras[0], 64, 64);
    const std::vector<Hit> hits = trace(scene, rays);
    const Mesh mesh = load_flat_model("builtin:figure?triangles=5000").mesh();
    const auto near = knn(build_points(mesh.vertices), mesh.vertices, 4);
    std::string bytes(reinterpret_cast<const char*>(hits.data()), hits.size() * sizeof(Hit));
    bytes.append(reinterpret_cast<const char*>(near.indices.data()),
                 near.indices.size() * sizeof(std::uint32_t));
    return bytes + tree_hash(build_bvh(mesh));
}

TEST(ThreadPool, NoAnswerDependsOnIt) {
    const std::string own = answers();
    PoolInUse pool(4);
    EXPECT_EQ(answers(), own);
    EXPECT_GT(pool.seen.loops, 10);
}

}  // namespace
}  // namespace raydix
