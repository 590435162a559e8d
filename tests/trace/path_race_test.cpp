// Which of streams and packets the jobs of a batch take, and that no answer depends on it.
#include "trace/simd/path_race.h"

#include <gtest/gtest.h>
#include <raydix/model.h>
#include <raydix/rays.h>
#include <raydix/wide.h>

#include <cstring>
#include <vector>

namespace raydix::test {
namespace {

TEST(PathRace, TriesAllAndTakesTheFastest) {
    for (const std::size_t count : {2u, 3u})
        for (std::size_t faster = 0; faster < count; ++faster) {
            PathRace race(count);
            EXPECT_EQ(race.trials(), 2 * count);
            for (std::uint32_t k = 0; k < race.trials(); ++k) EXPECT_EQ(race.next(), k % count);
            EXPECT_EQ(race.next(), 0u);  // none has ended
            // The first of each, with whatever memory was like then, says nothing.
            for (std::size_t way = 0; way < count; ++way)
                race.add(way, 1000, faster == way ? 900000 : 1);
            EXPECT_EQ(race.next(), 0u);
            for (std::size_t way = 0; way < count; ++way)
                race.add(way, 500 * (way + 1),
                         (faster == way ? 500 : 1500) * (static_cast<std::int64_t>(way) + 1));
            EXPECT_EQ(race.next(), faster);
            // The trials were no measure of the jobs that followed.
            race.add(faster, 10000, 100000);
            EXPECT_NE(race.next(), faster);
        }
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
