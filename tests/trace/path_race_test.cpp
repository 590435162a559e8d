// Which of streams and packets the jobs of a batch take, and that no answer depends on it.
#include "trace/simd/path_race.h"

#include <gtest/gtest.h>
#include <raydix/model.h>
#include <raydix/rays.h>
#include <raydix/wide.h>

#include <cstring>
#include <ctime>
#include <utility>
#include <vector>

#include "support/support.h"

namespace raydix::test {
namespace {

/// What a race of `likely` and `others` ways gives a job of rays 100 to 100 + rays - 1.
struct Share {
    std::size_t way, begin, end;
};
std::vector<Share> shares_of(PathRace& race, std::size_t rays) {
    std::vector<Share> shares;
    race.run(100, 100 + rays, [&](std::size_t way, std::size_t begin, std::size_t end) {
        shares.push_back({way, begin, end});
    });
    return shares;
}

constexpr std::pair<std::uint32_t, std::uint32_t> kinds[] = {{2, 0}, {2, 1}, {1, 2}, {3, 0}};

TEST(PathRace, EveryRayGoesOneWayAndTrialsGoAllWays) {
    for (const auto& [likely, others] : kinds)
        for (const std::size_t rays : {0u, 1u, 2u, 63u, 64u, 1000u, 1024u, 6144u, 8192u}) {
            PathRace race(likely, others);
            const std::uint32_t firsts = 2 * likely;
            std::vector<std::size_t> whole(likely + others);
            for (std::uint32_t job = 0; job < 40; ++job) {
                const bool trial = race.is_trial(job);
                EXPECT_EQ(trial, job < firsts || job % 4 == 0);
                const std::size_t main = race.main_way(job);
                if (job >= firsts) {
                    EXPECT_EQ(main, race.fastest());
                }
                const std::vector<Share> shares = shares_of(race, rays);
                ASSERT_EQ(shares.empty(), rays == 0);
                std::size_t at = 100;
                for (const Share& share : shares) {
                    EXPECT_EQ(share.begin, at);
                    at = share.end;
                    if (share.way == main) continue;
                    EXPECT_TRUE(trial);
                    EXPECT_GE(share.way, likely);
                    EXPECT_LE(share.end - share.begin, 128u);
                }
                EXPECT_EQ(at, 100 + rays);
                if (job < firsts) ++whole[main];
                if (trial && rays >= 1000) {
                    EXPECT_EQ(shares.size(), others + (main < likely));
                }
            }
            for (std::size_t way = 0; way < likely; ++way) EXPECT_EQ(whole[way], 2u);
        }
}

TEST(PathRace, TakesTheFastest) {
    for (const auto& [likely, others] : kinds) {
        const std::size_t count = likely + others;
        for (std::size_t faster = 0; faster < count; ++faster) {
            PathRace race(likely, others);
            EXPECT_EQ(race.fastest(), 0u);  // none has ended
            // The first of each, with whatever memory was like then, says nothing.
            for (std::size_t way = 0; way < count; ++way)
                race.add(way, 1000, faster == way ? 900000 : 1);
            EXPECT_EQ(race.fastest(), 0u);
            for (std::size_t way = 0; way < count; ++way)
                race.add(way, 500 * (way + 1),
                         (faster == way ? 500 : 1500) * (static_cast<std::int64_t>(way) + 1));
            EXPECT_EQ(race.fastest(), faster);
            // What follows counts as much.
            race.add(faster, 10000, 100000);
            EXPECT_NE(race.fastest(), faster);
        }
    }
}

TEST(PathRace, JobsAfterTheTrialsTakeTheWayThatTookLeast) {
    PathRace race(1, 2);
    const auto slow_but = [](std::size_t fast) {
        return [fast](std::size_t way, std::size_t begin, std::size_t end) {
            std::timespec now{}, start{};
            clock_gettime(CLOCK_THREAD_CPUTIME_ID, &start);
            const auto spent = [&] {
                clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
                return (now.tv_sec - start.tv_sec) * 1000000000 + (now.tv_nsec - start.tv_nsec);
            };
            const auto least = static_cast<std::int64_t>((end - begin) * (way == fast ? 10 : 1000));
            while (spent() < least) {
            }
        };
    };
    for (int job = 0; job < 2; ++job) race.run(0, 3000, slow_but(2));
    for (const Share& share : shares_of(race, 3000)) EXPECT_EQ(share.way, 2u);
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
    ManyRays out{WideBvh(bvh), make_secondary_rays(bvh, primary, trace(bvh, primary), pixels,
                                                   {.kind = kind, .samples = 8, .seed = 3})};
    EXPECT_GE(out.rays.size(), 100000u);  // jobs enough for a race
    EXPECT_EQ(choose_simd_path(out.tree, out.rays),
              kind == RayKind::diffuse_shuffled ? SimdPath::sorted : SimdPath::stream);
    return out;
}

TEST(PathRace, ChangesNoClosestHit) {
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

TEST(PathRace, ChangesNoAnswer) {
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
