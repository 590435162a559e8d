// Which of streams and packets the jobs of a batch take, and that no answer depends on it.
#include "trace/simd/path_race.h"

#include <gtest/gtest.h>
#include <raydix/rays.h>
#include <raydix/scene.h>
#include <raydix/wide.h>

#include <vector>

namespace raydix::test {
namespace {

TEST(PathRace, TriesBothAndTakesTheFaster) {
    for (const SimdPath faster : {SimdPath::stream, SimdPath::packet}) {
        PathRace race;
        EXPECT_EQ(race.next(), SimdPath::stream);
        EXPECT_EQ(race.next(), SimdPath::packet);
        EXPECT_EQ(race.next(), SimdPath::stream);  // neither has ended
        race.add(SimdPath::stream, 1000, faster == SimdPath::stream ? 1000 : 3000);
        race.add(SimdPath::packet, 500, 1000);
        EXPECT_EQ(race.next(), faster);
        // The first job was no measure of the others.
        race.add(faster, 10000, 100000);
        EXPECT_NE(race.next(), faster);
    }
}

TEST(PathRace, ChangesNoAnswer) {
    const Scene scene = load_scene("builtin:atrium?triangles=20000", 5);
    const Bvh bvh = build_bvh(scene.mesh);
    const WideBvh tree(bvh);
    std::vector<std::uint32_t> pixels;
    const auto primary = make_primary_rays(scene.cameras.cameras.at(0), 160, 120, &pixels);
    const auto rays = make_secondary_rays(bvh, primary, trace(bvh, primary), pixels,
                                          {.kind = RayKind::ao, .samples = 8, .seed = 3});
    ASSERT_EQ(choose_simd_path(tree, rays), SimdPath::stream);
    ASSERT_GE(rays.size(), 100000u);  // jobs enough for a race
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
