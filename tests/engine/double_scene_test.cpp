// Scenes in double against every mesh on every path on its own.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/model.h>
#include <raydix/result_limit.h>
#include <raydix/scene.h>

#include <algorithm>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "engine/double_world.h"
#include "support/message.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr double far_away = 1e7;
constexpr int worlds = 3 * static_cast<int>(thorough);

SceneOptions options_of(int k) {
    return {.quality = static_cast<Quality>(k % 3),
            .usage = k % 2 == 0 ? Usage::fixed : Usage::moving,
            .compact = k % 5 == 0,
            .threads = k % 3};
}

TEST(DoubleScene, AnswersAreThoseOfEveryMeshOnEveryPath) {
    std::size_t hits = 0;
    for (std::uint32_t levels = 0; levels < 4; ++levels)
        for (int k = 0; k < worlds; ++k) {
            RandomWorlds random(100 * levels + static_cast<std::uint64_t>(k));
            const std::uint32_t items = random.under(levels == 3 ? 4 : 7);
            const auto world = random.world(
                {levels, items + (levels != 0), 0, k % 2 == 0 ? 0 : far_away, options_of(k)});
            EXPECT_EQ(differences_with_ends(*world, random, 150, hits), 0u)
                << "levels " << levels << ", world " << k;
        }
    EXPECT_GT(hits, 200u * thorough);
}

TEST(DoubleScene, ShearedInstancesLoseNoHits) {
    std::size_t hits = 0;
    for (const double shear : {10.0, 1e2, 1e3, 1e4})
        for (int k = 0; k < worlds; ++k) {
            RandomWorlds random(static_cast<std::uint64_t>(shear) + static_cast<std::uint64_t>(k));
            const auto world = random.world(
                {1 + random.under(3), 4, shear, k % 2 == 0 ? 0 : far_away, options_of(k)});
            EXPECT_EQ(differences_with_ends(*world, random, 100, hits), 0u)
                << "shear " << shear << ", world " << k;
        }
    EXPECT_GT(hits, 200u * thorough);
}

TEST(DoubleScene, AllHitsAreThoseOfEveryMeshOnEveryPath) {
    std::size_t found = 0;
    for (std::uint64_t seed = 0; seed < 2 * thorough; ++seed) {
        RandomWorlds random(1000 + seed);
        const auto world =
            random.world({static_cast<std::uint32_t>(seed % 4), 4, seed % 3 == 0 ? 100.0 : 0.0,
                          seed % 2 == 0 ? 0 : far_away, options_of(static_cast<int>(seed))});
        const std::vector<RayD> rays = random.rays(150, world->home);
        const std::uint32_t mask = seed % 5 == 0 ? 2u : every_mask;
        const auto rows = look_for_all(*world, rays, mask);
        const AllHitsD all = trace_all(world->scene, rays,
                                       {.mask = mask, .threads = 1 + static_cast<int>(seed % 2)});
        ASSERT_EQ(all.offsets.size(), rays.size() + 1);
        EXPECT_EQ(all.counts.hits, all.hits.size());
        EXPECT_EQ(all.counts.rays, rays.size());
        for (std::size_t i = 0; i < rays.size(); ++i) {
            const auto first = all.hits.begin() + static_cast<std::ptrdiff_t>(all.offsets[i]),
                       end = all.hits.begin() + static_cast<std::ptrdiff_t>(all.offsets[i + 1]);
            EXPECT_TRUE(std::ranges::equal(std::vector<HitD>(first, end), rows[i]))
                << "seed " << seed << ", ray " << i;
            found += rows[i].size();
        }
    }
    EXPECT_GT(found, 40u * thorough);
}

/// What the filter of the next test takes.
bool takes(std::size_t place, const HitD& hit) {
    return (hit.prim + hit.instance + hit.geometry + place) % 3 != 0;
}

/// The least hit of ray `i` that it takes: refused triangles have no area.
std::vector<HitD> look_at_taken(const WorldD& world, std::span<const RayD> rays) {
    std::vector<HitD> best(rays.size());
    for_each_mesh(
        world, rays, every_mask,
        [&](const WorldD::Item& item, const std::vector<RayD>& entering, std::uint32_t number) {
            for (std::size_t rest = 0; rest < 3; ++rest) {
                MeshD mesh = item.mesh;
                for (std::uint32_t prim = 0; prim < mesh.triangles.size(); ++prim) {
                    Triangle& t = mesh.triangles[prim];
                    if (!takes(rest, {TreeHitD{1, prim, 0, 0}, item.id, number}))
                        t = {t[0], t[0], t[0]};
                }
                const std::vector<HitD> hits = trace_brute_force(mesh, entering, 1);
                for (std::size_t i = rest; i < rays.size(); i += 3) {
                    const HitD found{hits[i], item.id, number};
                    if (found.hit() && (!best[i].hit() || key_of(found) < key_of(best[i])))
                        best[i] = found;
                }
            }
        });
    return best;
}

TEST(DoubleScene, FiltersSayWhichHitsCount) {
    std::size_t found = 0;
    for (std::uint64_t seed = 0; seed < thorough; ++seed) {
        RandomWorlds random(300 + seed);
        const auto world =
            random.world({static_cast<std::uint32_t>(seed % 3), 5, 0, seed % 2 == 0 ? 0 : far_away,
                          options_of(static_cast<int>(seed))});
        const std::vector<RayD> rays = random.rays(150, world->home);
        const std::vector<HitD> wanted = look_at_taken(*world, rays);
        SceneTraceOptionsD options;
        options.threads = 1 + static_cast<int>(seed % 2);
        options.filter = [&](std::size_t place, const RayD& ray, const HitD& hit) {
            EXPECT_TRUE(ray.origin == rays[place].origin && ray.tmax == rays[place].tmax);
            EXPECT_TRUE(hit.t <= ray.tmax && hit.t >= ray.tmin);
            return takes(place, hit);
        };
        EXPECT_EQ(trace(world->scene, rays, options), wanted) << "seed " << seed;
        std::vector<std::uint8_t> occluded(rays.size());
        trace_any(world->scene, rays, occluded, options);
        const AllHitsD all = trace_all(world->scene, rays, options);
        const auto rows = look_for_all(*world, rays, every_mask);
        for (std::size_t i = 0; i < rays.size(); ++i) {
            EXPECT_EQ(occluded[i] != 0, wanted[i].hit());
            found += wanted[i].hit();
            std::vector<HitD> row;
            std::ranges::copy_if(rows[i], std::back_inserter(row),
                                 [&](const HitD& hit) { return takes(i, hit); });
            EXPECT_TRUE(
                std::equal(row.begin(), row.end(),
                           all.hits.begin() + static_cast<std::ptrdiff_t>(all.offsets[i]),
                           all.hits.begin() + static_cast<std::ptrdiff_t>(all.offsets[i + 1])));
            const HitFilterD one = [&](std::size_t place, const RayD&, const HitD& hit) {
                EXPECT_EQ(place, 0u);
                return takes(i, hit);
            };
            EXPECT_EQ(closest_hit(world->scene, rays[i], one), wanted[i]);
            EXPECT_EQ(any_hit(world->scene, rays[i], one), wanted[i].hit());
        }
    }
    EXPECT_GT(found, 10u * thorough);
    const SceneD scene(one_triangle());
    struct Refusal {};
    SceneTraceOptionsD options;
    options.filter = [](std::size_t, const RayD&, const HitD&) -> bool { throw Refusal{}; };
    EXPECT_THROW(static_cast<void>(trace(scene, std::vector<RayD>(3, down), options)), Refusal);
    EXPECT_EQ(closest_hit(scene, down, HitFilterD()).t, 10);
}

TEST(DoubleScene, OfOneMeshGivesTheHitsOfItsTree) {
    Model model;
    model.meshes = {random_soup(1000, 5, 0.2f)};
    const MeshD mesh = in_double(model.mesh());
    RandomWorlds random(6);
    const std::vector<RayD> rays = random.rays(2000, {0.5, 0.5, 0.5});
    const BvhD tree = build_bvh(mesh);
    const std::vector<HitD> expected = trace(tree, rays);
    const AllHitsD all = trace_all(tree, rays);
    std::size_t found = 0;
    for (const HitD& hit : expected) found += hit.hit();
    EXPECT_GT(found, 100u);
    for (const SceneD& scene : {SceneD(mesh), SceneD(model, {.quality = Quality::high})}) {
        EXPECT_EQ(trace(scene, rays), expected);
        EXPECT_EQ(trace_all(scene, rays).hits, all.hits);
        EXPECT_EQ(trace_all(scene, rays).offsets, all.offsets);
        const AabbD box = scene.bounds(), wanted = box_of_mesh(mesh);
        EXPECT_TRUE(box.lo == wanted.lo && box.hi == wanted.hi);
    }
}

TEST(DoubleScene, NodesOfModelsAreNotRounded) {
    Model model;
    model.meshes = {in_float(one_triangle(0))};
    model.nodes.resize(2);
    model.nodes[0].transform = moved(far_away, 0, 0);
    model.nodes[1].transform = moved(1e-6, 0, 0);
    model.nodes[1].parent = 0;
    model.nodes[1].mesh_count = 1;
    const SceneD scene(model);
    const auto at = [&](double x) {
        return closest_hit(scene, {{far_away + x, 0.25, 1}, 0, {0, 0, -1}});
    };
    EXPECT_FALSE(at(5e-7).hit());
    const HitD hit = at(2e-6);
    EXPECT_EQ(hit.t, 1);
    EXPECT_EQ(hit.geometry, 0u);
    EXPECT_EQ(scene.path(hit.instance), (std::vector<std::uint32_t>{1, 2}));
}

TEST(DoubleScene, PlacesFarFromTheOriginCostNoDigits) {
    // A step of 1e-6 at 1e7, which floats would round to none.
    MeshD step = one_triangle(far_away);
    for (const Vec3d v : one_triangle(far_away + 1e-6).vertices)
        step.vertices.push_back({v.x, v.y, v.z});
    step.triangles.push_back({3, 4, 5});
    const SceneD object(step);
    SceneD scene;
    scene.add(object, moved(-far_away, 3 * far_away, 0));
    scene.commit();
    const RayD ray{{-far_away + 0.25, 3 * far_away + 0.25, far_away + 10}, 0, {0, 0, -1}};
    const HitD hit = closest_hit(scene, ray);
    EXPECT_EQ(hit.prim, 1u);
    EXPECT_EQ(hit.t, (far_away + 10) - (far_away + 1e-6));
    EXPECT_EQ(hit.instance, 1u);
}

TEST(DoubleScene, TiesGoToTheLeastInstanceThenGeometryThenTriangle) {
    MeshD twice = one_triangle(0);
    twice.triangles.push_back(twice.triangles[0]);
    SceneD inner(twice), scene;
    scene.add(inner, TransformD{});
    scene.add(inner, TransformD{});
    EXPECT_EQ(scene.commit().paths, 2u);
    EXPECT_EQ(closest_hit(scene, down), (HitD{{10, 0, 0.25, 0.25}, 0, 1}));
    scene.add(one_triangle(0));
    scene.add(one_triangle(0));
    scene.commit();
    EXPECT_EQ(closest_hit(scene, down), (HitD{{10, 0, 0.25, 0.25}, 2, 0}));
    for (const Usage usage : {Usage::fixed, Usage::moving}) {
        scene.commit({.usage = usage});
        for (const HitD& hit : trace(scene, std::vector<RayD>(100, down)))
            EXPECT_EQ(hit.geometry, 2u);
    }
    const AllHitsD all = trace_all(scene, std::vector<RayD>{down});
    ASSERT_EQ(all.hits.size(), 6u);
    EXPECT_TRUE(std::ranges::is_sorted(all.hits, {}, key_of));
    // Directions so long that all t are subnormal, and equal in the caller's units.
    const RayD long_ray{{0.25, 0.25, 1}, 0, {0, 0, -1e308}};
    SceneD stack;
    stack.add(SceneD(one_triangle(1 - 4 * 0x1p-53)), TransformD{});
    stack.add(SceneD(one_triangle(1 - 3 * 0x1p-53)), TransformD{});
    stack.commit();
    const HitD hit = closest_hit(stack, long_ray);
    EXPECT_EQ(hit.t, 0x1p-1074);
    EXPECT_EQ(hit.instance, 1u);
}

TEST(DoubleScene, PathsAreCountedDepthFirst) {
    SceneD mesh(one_triangle(0)), pair, scene;
    pair.add(mesh, moved(0, 0, 0), {.id = 3});
    pair.add(mesh, moved(2, 0, 0));  // id 0
    pair.commit();
    scene.add(pair, moved(0, 0, 0), {.id = 7});
    scene.add(pair, moved(10, 0, 0));
    EXPECT_EQ(scene.commit().paths, 6u);
    const auto at = [&](double x) {
        return closest_hit(scene, {{x + 0.25, 0.25, 1}, 0, {0, 0, -1}});
    };
    EXPECT_EQ(at(12).instance, 2u);
    EXPECT_EQ(at(10).instance, 3u);
    EXPECT_EQ(at(2).instance, 5u);
    EXPECT_EQ(at(0).instance, 6u);
    EXPECT_EQ(scene.path(0), std::vector<std::uint32_t>{});
    EXPECT_EQ(scene.path(2), (std::vector<std::uint32_t>{0, 0}));
    EXPECT_EQ(scene.path(6), (std::vector<std::uint32_t>{7, 3}));
    EXPECT_THROW(static_cast<void>(scene.path(7)), InputError);
}

TEST(DoubleScene, NothingToHit) {
    SceneD empty;
    EXPECT_THROW(static_cast<void>(closest_hit(empty, down)), InputError);
    empty.commit();
    EXPECT_FALSE(closest_hit(empty, down).hit());
    EXPECT_FALSE(any_hit(empty, down));
    EXPECT_GT(empty.bounds().lo.x, empty.bounds().hi.x);
    SceneD scene;
    scene.add(empty, TransformD{});
    scene.add(MeshD{});
    scene.add(one_triangle(0), {.mask = 0, .id = {}});
    const CommitReport report = scene.commit();
    EXPECT_EQ(report.meshes, 1u);
    EXPECT_EQ(report.instances, 1u);
    EXPECT_EQ(report.triangles, 1u);
    for (const HitD& hit : trace(scene, std::vector<RayD>(50, down))) EXPECT_EQ(hit, HitD{});
    EXPECT_TRUE(trace_all(scene, std::vector<RayD>(50, down)).hits.empty());
    EXPECT_TRUE(trace(scene, std::vector<RayD>{}).empty());
    // A mesh of triangles that are all left out.
    MeshD bad = one_triangle(0);
    bad.vertices[0].x = std::numeric_limits<double>::infinity();
    const SceneD out(bad);
    EXPECT_FALSE(closest_hit(out, down).hit());
    SceneD around;
    around.add(out, TransformD{});
    around.commit();
    EXPECT_FALSE(closest_hit(around, down).hit());
}

TEST(DoubleScene, CallsRefuseWhatScenesInFloatRefuse) {
    const SceneD one(one_triangle(0));
    const auto message = [](const auto& call) { return message_of(call); };
    const std::vector<RayD> two(2);
    const std::vector<std::uint32_t> masks(3);
    EXPECT_EQ(message([&] { static_cast<void>(trace(one, two, {.masks = masks})); }),
              "trace: 2 rays, but 3 masks");
    EXPECT_EQ(message([&] { static_cast<void>(trace_all(one, two, {.masks = masks})); }),
              "trace: 2 rays, but 3 masks");
    std::vector<HitD> room(1);
    EXPECT_EQ(message([&] { trace(one, two, room); }), "trace: 2 rays, but room for 1 results");
    const Scene of_floats(in_float(one_triangle(0)));
    const std::vector<Ray> floats(2);
    Scene placed;
    placed.add(of_floats, Transform{});
    placed.commit();
    struct Wrong {
        int threads = 0;
        SimdPath path = SimdPath::automatic;
        const char* isa = "";
    };
    for (const Wrong& wrong :
         {Wrong{.threads = -1}, Wrong{.isa = "mmx"}, Wrong{.path = static_cast<SimdPath>(9)}}) {
        const SceneTraceOptions options{
            .threads = wrong.threads, .path = wrong.path, .isa = wrong.isa};
        const SceneTraceOptionsD in_double{
            .threads = wrong.threads, .path = wrong.path, .isa = wrong.isa};
        const std::string said =
            message([&] { static_cast<void>(trace(of_floats, floats, options)); });
        EXPECT_NE(said, "no error");
        EXPECT_EQ(message([&] { static_cast<void>(trace(one, two, in_double)); }), said);
        EXPECT_EQ(message([&] { static_cast<void>(trace_all(one, two, in_double)); }), said);
        EXPECT_EQ(message([&] { static_cast<void>(trace_all(of_floats, floats, options)); }), said);
        EXPECT_EQ(message([&] { static_cast<void>(trace_all(placed, floats, options)); }), said);
    }
    room.resize(3);
    const TraceCounts counts = trace(one, std::vector<RayD>{down, {}, down}, room);
    EXPECT_EQ(counts.rays, 3u);
    EXPECT_EQ(counts.hits, 2u);
    EXPECT_EQ(counts.invalid_rays, 1u);
    EXPECT_THROW(static_cast<void>(
                     trace_all(one, std::vector<RayD>(1000, down), {.max_result_bytes = 20000})),
                 ResultTooLarge);
}

}  // namespace
}  // namespace raydix::test
