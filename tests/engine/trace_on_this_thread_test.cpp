// src/engine/trace_on_this_thread.h: the answers of batches, and counted nodes.
#include "engine/trace_on_this_thread.h"

#include <gtest/gtest.h>
#include <raydix/scene.h>
#include <raydix/wide.h>

#include <cstring>
#include <numeric>
#include <vector>

#include "engine/scene_state.h"
#include "support/random.h"
#include "support/support.h"
#include "trace/simd/simd_kernels.h"

namespace raydix {
namespace {

const SceneTree& tree_below(const Scene& scene) { return *SceneInternals::tree(scene); }

/// All in one direction, all from one place, or neither.
enum class Kind { packet, stream, apart };

std::vector<Ray> rays_of(Kind kind, std::size_t count) {
    test::Random random(17);
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 from = kind == Kind::apart ? random.in(-1, 2) : Vec3{0.5f, 0.5f, -2},
                   to = kind == Kind::packet ? random.in(0.4f, 0.6f) : random.in(-6, 7);
        rays.push_back({from, 0, {to.x - from.x, to.y - from.y, to.z - from.z}});
        if (i % 50 == 3) rays.back().tmax = 1;
        if (i % 70 == 3) rays.back().direction = {0, 0, 0};
    }
    return rays;
}

std::vector<Scene> some_scenes() {
    std::vector<Scene> scenes;
    const Mesh mesh = test::random_soup(500, 1, 0.3f);
    scenes.emplace_back(mesh);
    scenes.emplace_back(mesh, SceneOptions{.compact = true});
    scenes.emplace_back(Mesh{});
    Scene masked, several, placed;
    masked.add(mesh, {.mask = 0});
    masked.commit();
    for (std::uint64_t k = 0; k < 4; ++k) several.add(test::random_soup(100, k, 0.3f));
    several.commit({.usage = Usage::moving});
    for (int k = 0; k < 6; ++k) {
        Transform t;
        t.m[k % 3][3] = static_cast<float>(k) - 2;
        t.m[0][1] = 0.3f;
        placed.add(k % 2 == 0 ? several : scenes[1], t);
    }
    placed.add(mesh);
    placed.commit();
    scenes.push_back(std::move(masked));
    scenes.push_back(std::move(several));
    scenes.push_back(std::move(placed));
    return scenes;
}

TEST(TraceHere, AnswersAsBatchesDo) {
    const std::vector<Scene> scenes = some_scenes();
    for (std::size_t s = 0; s < scenes.size(); ++s)
        for (const Kind kind : {Kind::packet, Kind::stream, Kind::apart})
            for (const std::size_t count : {std::size_t{0}, std::size_t{5}, max_job_rays + 100}) {
                const std::vector<Ray> rays = rays_of(kind, count);
                const std::vector<Hit> wanted = trace(scenes[s], rays);
                std::vector<Hit> hits(count);
                closest_on_this_thread(tree_below(scenes[s]), rays, hits);
                EXPECT_EQ(std::memcmp(hits.data(), wanted.data(), count * sizeof(Hit)), 0) << s;
                std::vector<std::uint8_t> expected(count), found(count);
                trace_any(scenes[s], rays, expected);
                occluded_on_this_thread(tree_below(scenes[s]), rays, found);
                EXPECT_EQ(found, expected) << s;
            }
}

TEST(TraceHere, CountsTheNodesOfOneTree) {
    const std::vector<Ray> rays = rays_of(Kind::apart, 3000);
    const Mesh mesh = test::random_soup(500, 1, 0.3f);
    for (const bool compact : {false, true}) {
        const Scene scene(mesh, {.compact = compact});
        const WideBvh wide =
            build_wide_bvh(mesh, build_options_for(Quality::balanced), {.compact = compact});
        std::vector<std::uint32_t> visits(rays.size());
        count_steps_on_this_thread(tree_below(scene), rays, visits);
        std::vector<Hit> hits(rays.size());
        // Rays in turn take children in the order of single calls, whatever vectors do it; but for
        // three or more of which a ray enters some at the same place.
        for (const std::string& isa : simd_instruction_sets()) {
            const TraceCounts counts =
                trace(wide, rays, hits, {.counters = true, .path = SimdPath::single, .isa = isa});
            EXPECT_GT(counts.node_visits, rays.size());
            const auto in_turn = static_cast<double>(counts.node_visits);
            EXPECT_NEAR(std::accumulate(visits.begin(), visits.end(), 0.0), in_turn, in_turn / 1000)
                << isa;
        }
        EXPECT_EQ(visits[3], 0u);  // an invalid ray
    }
}

TEST(TraceHere, CountsNodesAboveTheTreesToo) {
    const std::vector<Ray> rays = rays_of(Kind::stream, 5000);
    Scene alone(test::random_soup(300, 4, 0.3f)), below, above;
    below.add(alone, Transform{});
    below.commit();
    // Two of them far apart: a ray that meets one enters what is above as well.
    Transform far;
    far.m[0][3] = 1000;
    above.add(below, Transform{});
    above.add(below, far);
    above.commit();
    std::vector<std::uint32_t> one(rays.size()), two(rays.size()), three(rays.size());
    count_steps_on_this_thread(tree_below(alone), rays, one);
    count_steps_on_this_thread(tree_below(below), rays, two);
    count_steps_on_this_thread(tree_below(above), rays, three);
    std::size_t entered = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (one[i] < 2) continue;
        ++entered;
        EXPECT_GT(two[i], one[i]) << i;
        EXPECT_GE(three[i], two[i]) << i;
    }
    EXPECT_GT(entered, 100u);
    std::vector<std::uint32_t> none(rays.size(), 7);
    count_steps_on_this_thread(tree_below(Scene(Mesh{})), rays, none);
    EXPECT_EQ(std::accumulate(none.begin(), none.end(), 0u), 0u);
}

}  // namespace
}  // namespace raydix
