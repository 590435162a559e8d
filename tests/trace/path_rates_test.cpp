// Which way the jobs of a batch take, and that no answer depends on it.
#include "exec/path_rates.h"

#include <gtest/gtest.h>
#include <raydix/model.h>
#include <raydix/rays.h>
#include <raydix/wide.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <random>
#include <span>
#include <thread>
#include <vector>

#include "support/sanitized.h"
#include "support/support.h"
#include "trace/simd/ray_order.h"
#include "trace/simd/wide_batch.h"

namespace raydix::test {
namespace {

/// Time that passes when a test says so.
struct HandClock {
    using duration = std::chrono::nanoseconds;
    using rep = duration::rep;
    using period = duration::period;
    using time_point = std::chrono::time_point<HandClock>;
    static time_point now() { return time_point(passed); }
    static inline duration passed{0};
};
using Rates = WayRates<PathWay, 4, HandClock>;

struct Share {
    PathWay way;
    std::size_t begin, end;
};
/// What a ray takes by each way, in nanoseconds.
using Costs = std::array<int, 4>;
constexpr Costs all_alike{100, 100, 100, 100};
/// Of a job of rays 100 to 100 + rays - 1.
std::vector<Share> shares_of(Rates& rates, std::span<const PathWay> ways, std::size_t rays,
                             const Costs& costs = all_alike) {
    std::vector<Share> shares;
    rates.run(ways, 100, 100 + rays, [&](PathWay way, std::size_t begin, std::size_t end) {
        shares.push_back({way, begin, end});
        HandClock::passed += std::chrono::nanoseconds(costs[static_cast<std::size_t>(way)]) *
                             static_cast<std::int64_t>(end - begin);
    });
    return shares;
}

constexpr PathWay three_ways[] = {PathWay::packets, PathWay::streams, PathWay::turns};

TEST(PathRates, EveryRayGoesOneWay) {
    for (std::size_t count = 1; count <= 3; ++count)
        for (const std::size_t rays : {0u, 1u, 2u, 63u, 64u, 511u, 512u, 513u, 1024u, 8192u}) {
            Rates rates;
            for (int job = 0; job < 40; ++job) {
                std::size_t at = 100;
                for (const Share& share :
                     shares_of(rates, std::span(three_ways).first(count), rays)) {
                    EXPECT_EQ(share.begin, at);
                    EXPECT_LT(share.begin, share.end);
                    at = share.end;
                }
                EXPECT_EQ(at, 100 + rays);
            }
        }
}

TEST(PathRates, TheFirstJobGoesTheFirstWayAndTrialsGoAllWays) {
    for (const std::size_t rays : {64u, 8192u}) {
        Rates rates;
        for (const Share& share : shares_of(rates, three_ways, rays))
            EXPECT_EQ(share.way, PathWay::packets);
        std::size_t tried[4] = {};
        for (int job = 0; job < 30; ++job)
            for (const Share& share : shares_of(rates, three_ways, rays))
                ++tried[static_cast<std::size_t>(share.way)];
        for (const PathWay way : three_ways) EXPECT_GE(tried[static_cast<std::size_t>(way)], 2u);
    }
}

TEST(PathRates, MostRaysGoTheFastestWay) {
    for (const std::size_t rays : {64u, 8192u})
        for (const PathWay faster : three_ways) {
            Rates rates;
            Costs costs{300, 400, 500, 600};
            costs[static_cast<std::size_t>(faster)] = 100;
            std::size_t fastest = 0, all = 0;
            for (int job = 0; job < 400; ++job)
                for (const Share& share : shares_of(rates, three_ways, rays, costs)) {
                    all += share.end - share.begin;
                    if (share.way == faster) fastest += share.end - share.begin;
                }
            EXPECT_GT(fastest * 10, all * 9);
            EXPECT_LT(fastest, all);  // the others are tried
        }
}

TEST(PathRates, AWayThatNeedsManyRaysIsNotJudgedByFew) {
    // 156 ns a ray in a share of 256, 112 in one of 1,024; the other one takes 135 always.
    Rates rates;
    constexpr PathWay two[] = {PathWay::turns, PathWay::packets};
    std::size_t last = 0;
    for (int job = 0; job < 200; ++job) {
        last = 0;
        rates.run(two, 0, 1024, [&](PathWay way, std::size_t begin, std::size_t end) {
            const auto rays = static_cast<std::int64_t>(end - begin);
            if (way == PathWay::packets) last += end - begin;
            HandClock::passed +=
                std::chrono::nanoseconds(way == PathWay::packets ? 98 * rays + 15000 : 135 * rays);
        });
    }
    EXPECT_GE(last, 512u);
    EXPECT_EQ(rates.fastest(two), PathWay::packets);
}

TEST(PathRates, StreamsAreTriedOnHalfOfALargeJobHoweverSlow) {
    Rates rates;
    std::size_t trials = 0;
    for (int job = 0; job < 200; ++job) {
        std::size_t streamed = 0;
        for (const Share& share : shares_of(rates, three_ways, 8192, {100, 500, 200, 100}))
            if (share.way == PathWay::streams) streamed += share.end - share.begin;
        if (streamed == 0) continue;
        EXPECT_EQ(streamed, 4096u) << job;
        ++trials;
    }
    EXPECT_GE(trials, 3u);
}

TEST(PathRates, OrdersOfLargeBatchesBeginAsNeighboursStart) {
    const auto first_order = [](std::uint32_t apart, std::size_t n) {
        OrderRates rates;
        BatchKind kind;
        kind.apart = apart;
        std::optional<RayOrder> first;
        run_in_better_order(rates, kind, n, [&](RayOrder order, std::size_t, std::size_t) {
            if (!first) first = order;
        });
        return *first;
    };
    EXPECT_EQ(first_order(BatchKind::anywhere, 65'536), RayOrder::sorted);
    EXPECT_EQ(first_order(BatchKind::anywhere, 65'535), RayOrder::given);
    EXPECT_EQ(first_order(BatchKind::anywhere - 1, 1'000'000), RayOrder::given);
}

TEST(PathRates, WaysAreJudgedAlikeWhereverTheDearRaysLie) {
    // By its place in the job a ray takes up to nine times as long; by the second way a fifth less,
    // or more.
    constexpr std::int64_t n = 65'537;
    constexpr PathWay two[] = {PathWay::packets, PathWay::turns};
    for (const bool rising : {false, true})
        for (const int percent : {80, 120}) {
            Rates rates;
            std::int64_t by_second = 0;
            for (int job = 0; job < 100; ++job) {
                std::size_t at = 0;
                rates.run(two, 0, n, [&](PathWay way, std::size_t begin, std::size_t end) {
                    EXPECT_EQ(begin, at);
                    at = end;
                    const auto from = static_cast<std::int64_t>(begin),
                               to = static_cast<std::int64_t>(end);
                    const std::int64_t middle = (from + to) / 2;
                    const std::int64_t each = 100 + 800 * (rising ? middle : n - middle) / n;
                    const bool second = way == PathWay::turns;
                    if (second) by_second += to - from;
                    HandClock::passed +=
                        std::chrono::nanoseconds(each * (to - from) * (second ? percent : 100));
                });
                EXPECT_EQ(at, std::size_t{n});
                EXPECT_EQ(rates.fastest(two),
                          job > 0 && percent < 100 ? PathWay::turns : PathWay::packets);
            }
            EXPECT_GT(by_second, 0);
            EXPECT_EQ(by_second > 50 * n, percent < 100);
        }
}

TEST(PathRates, OfTwoFasterWaysTheFasterOneLeads) {
    Rates rates;
    rates.add(PathWay::streams, PathWay::packets, 0.5f);
    rates.add(PathWay::turns, PathWay::packets, 0.6f);
    EXPECT_EQ(rates.fastest(three_ways), PathWay::streams);
    constexpr PathWay without_streams[] = {PathWay::packets, PathWay::turns};
    EXPECT_EQ(rates.fastest(without_streams), PathWay::turns);
    // Two are tried at once, beside the first way.
    constexpr PathWay two_and_first[] = {PathWay::packets, PathWay::turns, PathWay::alone};
    for (const std::size_t rays : {1024u, 8192u}) {
        Rates measured;
        for (int job = 0; job < 100; ++job) {
            static_cast<void>(shares_of(measured, two_and_first, rays, {1000, 1, 300, 280}));
            EXPECT_EQ(measured.fastest(two_and_first), job > 0 ? PathWay::alone : PathWay::packets)
                << job;
        }
    }
}

TEST(PathRates, ASmallJobTriesAnotherWayOnAQuarterOfItsRays) {
    Rates rates;
    Costs costs{100, 400, 400, 400};
    std::size_t tried = 0;
    for (int job = 0; job < 40; ++job)
        for (const Share& share : shares_of(rates, three_ways, 200, costs))
            if (share.way != PathWay::packets) {
                EXPECT_EQ(share.end - share.begin, 50u);
                ++tried;
            }
    EXPECT_GE(tried, 4u);
    EXPECT_LE(tried, 10u);
}

TEST(PathRates, TakesTheFastest) {
    for (const PathWay faster : three_ways) {
        Rates rates;
        EXPECT_EQ(rates.fastest(three_ways), PathWay::packets);  // nothing is known
        for (const PathWay way : three_ways)
            if (way != PathWay::packets)
                for (int trial = 0; trial < 8; ++trial)
                    rates.add(way, PathWay::packets, way == faster ? 0.5f : 1.5f);
        EXPECT_EQ(rates.fastest(three_ways), faster);
    }
    // Others are compared through what both were timed beside.
    Rates rates;
    rates.add(PathWay::streams, PathWay::packets, 0.5f);
    rates.add(PathWay::turns, PathWay::streams, 0.8f);
    EXPECT_EQ(rates.fastest(three_ways), PathWay::turns);
    constexpr PathWay two[] = {PathWay::packets, PathWay::streams};
    EXPECT_EQ(rates.fastest(two), PathWay::streams);
}

TEST(PathRates, ForgetsWhatNoLongerHolds) {
    Rates rates;
    for (int trial = 0; trial < 50; ++trial) rates.add(PathWay::streams, PathWay::packets, 0.5f);
    EXPECT_EQ(rates.fastest(three_ways), PathWay::streams);
    for (int trial = 0; trial < 10; ++trial) rates.add(PathWay::streams, PathWay::packets, 3.0f);
    EXPECT_EQ(rates.fastest(three_ways), PathWay::packets);
}

TEST(PathRates, OneThatStoodStillForAWhileDecidesLittle) {
    Rates rates;
    for (int trial = 0; trial < 8; ++trial) rates.add(PathWay::streams, PathWay::packets, 0.25f);
    rates.add(PathWay::streams, PathWay::packets, 1e9f);
    for (int trial = 0; trial < 8; ++trial) rates.add(PathWay::streams, PathWay::packets, 0.25f);
    EXPECT_EQ(rates.fastest(three_ways), PathWay::streams);
    for (const float nonsense : {0.0f, -1.0f, std::numeric_limits<float>::quiet_NaN()})
        rates.add(PathWay::packets, PathWay::streams, nonsense);
    EXPECT_EQ(rates.fastest(three_ways), PathWay::streams);
}

constexpr BatchView one_view{{0.5f, 0.5f, 0.5f}, {0, 0, 1}},
    other_view{{0.5f, 0.5f, 0.5f}, {1, 0, 0}};

TEST(PathRates, AnotherViewIsLearntWithinItsFirstJobs) {
    const auto run = [](Rates& rates, int jobs, const Costs& costs) {
        for (int job = 0; job < jobs; ++job) shares_of(rates, three_ways, 1024, costs);
    };
    constexpr Costs one{100, 300, 200, 100}, other{200, 300, 100, 100};
    Rates sees, blind;
    for (Rates* const rates : {&sees, &blind}) {
        rates->see(one_view);
        run(*rates, 2000, one);
        EXPECT_EQ(rates->fastest(three_ways), PathWay::packets);
    }
    sees.see(other_view);
    run(sees, 8, other);
    run(blind, 8, other);
    EXPECT_EQ(sees.fastest(three_ways), PathWay::turns);
    EXPECT_EQ(blind.fastest(three_ways), PathWay::packets);
    // Back again, and as soon: another way was the best.
    run(sees, 32, other);
    sees.see(one_view);
    run(sees, 8, one);
    EXPECT_EQ(sees.fastest(three_ways), PathWay::packets);
}

TEST(PathRates, ViewsThatChangeNothingCostLittle) {
    Rates rates;
    std::mt19937 random(7);
    std::lognormal_distribution<float> noise(0.0f, 0.3f);
    constexpr std::array<float, 4> costs{100, 300, 150, 100};
    std::size_t others = 0, all = 0;
    for (int job = 0; job < 20000; ++job) {
        rates.see(job % 2 == 0 ? one_view : other_view);
        rates.run(three_ways, 0, 1024, [&](PathWay way, std::size_t begin, std::size_t end) {
            const float time = costs[static_cast<std::size_t>(way)] * noise(random);
            HandClock::passed += std::chrono::nanoseconds(
                static_cast<std::int64_t>(time * static_cast<float>(end - begin)));
            all += end - begin;
            others += way == PathWay::packets ? 0 : end - begin;
        });
    }
    EXPECT_LT(others * 50, all);
}

TEST(PathRates, ATreeHearsOfViewsThroughKinds) {
    for (const bool seen : {false, true}) {
        PathRates rates;
        BatchKind kind;
        kind.size = 3;
        if (seen) kind.view = one_view;
        for (int trial = 0; trial < 8; ++trial)
            rates.ways(kind).add(PathWay::turns, PathWay::packets, 0.5f);
        if (seen) kind.view = other_view;
        rates.ways(kind).add(PathWay::turns, PathWay::packets, 3.0f);
        EXPECT_EQ(rates.ways(kind).fastest(three_ways), seen ? PathWay::packets : PathWay::turns);
    }
}

TEST(PathRates, OnlyBatchesFromOnePlaceInOneDirectionAreViews) {
    const Aabb bounds{{0, 0, 0}, {2, 1, 1}};
    const auto view = [&](Vec3 from, Vec3 to, std::size_t rays) {
        return look_at(bounds, std::vector<Ray>(rays, Ray{from, 0, to})).kind.view;
    };
    const Vec3 place{0.5f, 0.5f, 0.5f}, along{0, 0, 1};
    const auto first = view(place, along, 10000);
    ASSERT_TRUE(first);
    EXPECT_FALSE(first->is_far_from(*first));
    EXPECT_FALSE(first->is_far_from(*view({0.6f, 0.5f, 0.5f}, {0.1f, -0.2f, 1}, 20000)));
    EXPECT_FALSE(first->is_far_from(*view(place, {0, 0, 100}, 10000)));
    EXPECT_TRUE(first->is_far_from(*view({0.5f, 0.64f, 0.5f}, along, 10000)));
    EXPECT_TRUE(first->is_far_from(*view(place, {0, 0.3f, 1}, 10000)));
    EXPECT_TRUE(first->is_far_from(*view({1e30f, 1e30f, -1e30f}, along, 10000)));
    EXPECT_FALSE(view(place, along, 8191));
    EXPECT_FALSE(view(place, {0, 0, 0}, 10000));
    EXPECT_TRUE(look_at(bounds, std::vector<Ray>(2048, Ray{place, 0, along}), 8192).kind.view);
    std::vector<Ray> apart(10000, Ray{place, 0, along});
    for (std::size_t i = 0; i < apart.size(); i += 2) apart[i].origin.x = 0.1f;
    EXPECT_FALSE(look_at(bounds, apart).kind.view);
}

TEST(PathRates, FewRaysThatStartApartNeedNoPlan) {
    const Aabb bounds{{0, 0, 0}, {2, 1, 1}};
    const auto few = [&](std::size_t n, float step, SimdPath path = SimdPath::automatic) {
        std::vector<Ray> rays;
        for (std::size_t i = 0; i < n; ++i)
            rays.push_back({{step * static_cast<float>(i), 0, 0}, 0, {0, 0, 1}});
        return are_few(bounds, rays, path);
    };
    EXPECT_TRUE(few(0, 0));
    EXPECT_TRUE(few(11, 0));
    EXPECT_TRUE(few(11, 0, SimdPath::single));
    EXPECT_FALSE(few(11, 1, SimdPath::packet));
    EXPECT_FALSE(few(12, 0));
    EXPECT_FALSE(few(12, 0.009f));
    EXPECT_TRUE(few(12, 0.01f));
    EXPECT_TRUE(few(31, 0.01f));
    EXPECT_FALSE(few(32, 0.01f));
    EXPECT_FALSE(few(31, 0.01f, SimdPath::single));
    EXPECT_FALSE(few(31, std::numeric_limits<float>::quiet_NaN()));
}

TEST(PathRates, TimesFarOffEitherWayCancel) {
    // 0.77 in the geometric mean, 1.15 in the arithmetic one.
    for (const bool long_ones_first : {false, true}) {
        Rates rates;
        for (int trial = 0; trial < 60; ++trial)
            rates.add(PathWay::streams, PathWay::packets,
                      (trial % 2 == 0) == long_ones_first ? 2.0f : 0.3f);
        rates.add(PathWay::streams, PathWay::packets, 0.8f);
        EXPECT_EQ(rates.fastest(three_ways), PathWay::streams);
    }
}

TEST(PathRates, LearnsAfterAMillionJobsOfWaysThatAreAlike) {
    for (unsigned seed = 1; seed <= fewer(6, 6); ++seed) {
        Rates rates;
        std::mt19937 random(seed);
        std::lognormal_distribution<float> noise(0.0f, 0.3f);
        const auto run = [&](const std::array<float, 4>& costs) {
            rates.run(three_ways, 0, 1024, [&](PathWay way, std::size_t begin, std::size_t end) {
                const float time = costs[static_cast<std::size_t>(way)] * noise(random);
                HandClock::passed += std::chrono::nanoseconds(
                    static_cast<std::int64_t>(time * static_cast<float>(end - begin)));
            });
        };
        for (int job = 0; job < 1'000'000; ++job) run({100, 100, 100, 100});
        for (int job = 0; job < 4000; ++job) run({100, 20, 100, 100});
        EXPECT_EQ(rates.fastest(three_ways), PathWay::streams) << seed;
    }
}

TEST(PathRates, EachWayHasItsTurnInSmallJobs) {
    // Two that are close to the best one, and behind them the fastest.
    constexpr PathWay four[] = {PathWay::packets, PathWay::streams, PathWay::turns, PathWay::alone};
    for (const std::size_t rays : {64u, 128u, 200u, 511u, 512u}) {
        Rates rates;
        for (int job = 0; job < 2000; ++job)
            static_cast<void>(shares_of(rates, four, rays, {100, 103, 104, 50}));
        EXPECT_EQ(rates.fastest(four), PathWay::alone) << rays << " rays";
    }
}

TEST(PathRates, ALongTimeInOneOfTheFirstTrialsIsMadeGood) {
    constexpr PathWay two[] = {PathWay::turns, PathWay::packets};
    for (int long_trial = 0; long_trial < 3; ++long_trial) {
        Rates rates;
        int trials = 0;
        for (int job = 0; job < 100; ++job)
            rates.run(two, 0, 1024, [&](PathWay way, std::size_t begin, std::size_t end) {
                int cost = 100;
                if (way == PathWay::packets) {
                    cost = trials == long_trial ? 800 : trials < 2 ? 110 : 40;
                    ++trials;
                }
                HandClock::passed +=
                    std::chrono::nanoseconds(cost * static_cast<std::int64_t>(end - begin));
            });
        EXPECT_EQ(rates.fastest(two), PathWay::packets) << "trial " << long_trial;
    }
}

TEST(PathRates, ASlowWayIsTriedLessAndLess) {
    Rates rates;
    const Costs costs{100, 150, 150, 150};
    std::size_t tried[3] = {};
    for (std::size_t& of_part : tried)
        for (int job = 0; job < 500; ++job)
            for (const Share& share : shares_of(rates, three_ways, 1024, costs))
                of_part += share.way != PathWay::packets ? 1 : 0;
    EXPECT_LT(2 * tried[1], tried[0]);
    EXPECT_GT(tried[2], 0u);
}

TEST(PathRates, AJobThatIsNoTrialGoesTheFastestWay) {
    for (const std::size_t rays : {64u, 8192u})
        for (const PathWay faster : three_ways) {
            Rates rates;
            for (const PathWay way : three_ways)
                if (way != PathWay::packets)
                    for (int trial = 0; trial < 8; ++trial)
                        rates.add(way, PathWay::packets, way == faster ? 0.1f : 10.0f);
            for (const Share& share : shares_of(rates, three_ways, rays))
                EXPECT_EQ(share.way, faster);
        }
}

TEST(PathRates, ManyThreadsMayAskAndAdd) {
    PathRates rates;
    std::atomic<std::size_t> traced{0};
    constexpr std::size_t threads = 4, jobs = 200, rays = 600;
    {
        std::vector<std::jthread> all;
        for (std::size_t t = 0; t < threads; ++t)
            all.emplace_back([&, t] {
                for (std::size_t job = 0; job < jobs; ++job) {
                    const BatchKind kind{.any = job % 2 == 0, .size = BatchKind::size_of(rays)};
                    rates.ways(kind).run(three_ways, 0, job % 3 == t % 3 ? rays : 100,
                                         [&](PathWay, std::size_t begin, std::size_t end) {
                                             traced += end - begin;
                                         });
                }
            });
    }
    std::size_t given = 0;
    for (std::size_t t = 0; t < threads; ++t)
        for (std::size_t job = 0; job < jobs; ++job) given += job % 3 == t % 3 ? rays : 100;
    EXPECT_EQ(traced, given);
}

TEST(PathRates, ThoseThatShareKnowWhatEitherLearns) {
    constexpr PathWay ways[] = {PathWay::packets, PathWay::turns};
    PathRates first, second;
    first.ways({}).add(PathWay::turns, PathWay::packets, 0.5f);
    EXPECT_EQ(second.ways({}).fastest(ways), PathWay::packets);
    second.share(first);
    EXPECT_EQ(second.ways({}).fastest(ways), PathWay::turns);
    for (int k = 0; k < 9; ++k) second.ways({}).add(PathWay::turns, PathWay::packets, 3.0f);
    EXPECT_EQ(first.ways({}).fastest(ways), PathWay::packets);
    second.ways({}).add(PathWay::turns, PathWay::packets, 0.1f);
    const PathRates copy = second;
    PathRates assigned;
    assigned = second;
    second = PathRates();
    EXPECT_EQ(PathRates(copy).ways({}).fastest(ways), PathWay::packets);
    EXPECT_EQ(assigned.ways({}).fastest(ways), PathWay::packets);
    EXPECT_EQ(second.ways({}).fastest(ways), PathWay::packets);
}

TEST(PathRates, EachKindHasItsOwnPlace) {
    std::vector<bool> taken(BatchKind::count);
    for (const bool any : {false, true})
        for (const bool sorted : {false, true})
            for (std::uint32_t apart = 0; apart < 4; ++apart)
                for (std::uint32_t spread = 0; spread < 3; ++spread)
                    for (std::uint32_t size = 0; size < 5; ++size) {
                        const std::size_t place =
                            BatchKind{any, sorted, apart, spread, size}.index();
                        ASSERT_LT(place, taken.size());
                        EXPECT_FALSE(taken[place]);
                        taken[place] = true;
                    }
    EXPECT_EQ(BatchKind::size_of(0), 0u);
    EXPECT_EQ(BatchKind::size_of(127), 0u);
    EXPECT_EQ(BatchKind::size_of(128), 1u);
    EXPECT_EQ(BatchKind::size_of(1000000), 4u);
}

/// Rays of which many jobs are made, and for which streams would be taken, or sorted streams.
struct ManyRays {
    WideBvh tree;
    std::vector<Ray> rays;
};
ManyRays many_rays(RayKind kind) {
    const Model scene = load_model("builtin:atrium?triangles=20000", 5);
    const Bvh bvh = build_bvh(scene.mesh());
    std::vector<std::uint32_t> pixels;
    const auto primary = make_primary_rays(scene.cameras.cameras.at(0), 160, 120, &pixels);
    ManyRays out{WideBvh(bvh),
                 make_secondary_rays(
                     bvh, primary, trace(bvh, primary), pixels,
                     {.kind = kind, .samples = 8, .seed = 3, .sorted = kind == RayKind::ao})};
    EXPECT_GE(out.rays.size(), 100000u);  // jobs enough for a race
    EXPECT_EQ(choose_simd_path(out.tree, out.rays),
              kind == RayKind::diffuse_shuffled ? SimdPath::sorted : SimdPath::stream);
    return out;
}

TEST(PathRates, ChangesNoClosestHit) {
    for (const RayKind kind : {RayKind::diffuse, RayKind::diffuse_shuffled}) {
        const auto [tree, rays] = many_rays(kind);
        std::vector<Hit> expected(rays.size()), found(rays.size());
        const TraceCounts counts = trace(tree, rays, expected, {.path = SimdPath::single});
        EXPECT_GT(counts.hits, rays.size() / 20);
        for (const SimdPath path : {SimdPath::automatic, SimdPath::packet, SimdPath::sorted})
            for (const int threads : {1, 2, 7}) {
                if (thorough == 1 && threads != 7) continue;
                const TraceCounts own =
                    trace(tree, rays, found, {.threads = threads, .path = path});
                EXPECT_EQ(own.hits, counts.hits);
                EXPECT_EQ(std::memcmp(found.data(), expected.data(), rays.size() * sizeof(Hit)), 0);
            }
    }
}

TEST(PathRates, ChangesNoAnswer) {
    const auto [tree, rays] = many_rays(RayKind::ao);
    std::vector<std::uint8_t> expected(rays.size()), found(rays.size());
    const TraceCounts counts = trace_any(tree, rays, expected, {.path = SimdPath::stream});
    EXPECT_GT(counts.hits, rays.size() / 20);
    for (const int threads : {1, 2, 7})
        for (int round = 0; round < 3; ++round) {
            const TraceCounts own = trace_any(tree, rays, found, {.threads = threads});
            EXPECT_EQ(found, expected);
            EXPECT_EQ(own.hits, counts.hits);
        }
}

}  // namespace
}  // namespace raydix::test
