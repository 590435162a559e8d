// The kernel `simd` against `scalar`, bit for bit: every instruction set that the machine has,
// every path, scenes of every size, all kinds of rays, nasty meshes, any thread count.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <raydix/raydix.h>
#include <raydix/wide.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iostream>
#include <random>

#include "layout/wide_bvh.h"
#include "support/bits.h"
#include "support/float_control.h"
#include "support/ray_sets.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"
#include "tree/bvh_internals.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t simd_seed = 2021;
constexpr SimdPath paths[] = {SimdPath::automatic, SimdPath::single, SimdPath::packet,
                              SimdPath::stream, SimdPath::sorted};

/// Everything that `simd` can do with a batch, by one path and instruction set.
void expect_like(const std::string& what, const WideBvh& tree, std::span<const Ray> rays,
                 std::span<const Hit> wanted, const TraceCounts& counts,
                 const TraceOptions& options) {
    SCOPED_TRACE(what + ", path " + std::string(simd_path_name(options.path)) + ", " + options.isa +
                 ", seed " + std::to_string(simd_seed));
    std::vector<Hit> hits(rays.size());
    const TraceCounts own = trace(tree, rays, hits, options);
    std::uint64_t different = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) different += !same_bits(hits[i], wanted[i]);
    EXPECT_EQ(different, 0u);
    EXPECT_EQ(own.rays, rays.size());
    EXPECT_EQ(own.hits, counts.hits);
    EXPECT_EQ(own.invalid_rays, counts.invalid_rays);
    if (options.counters && counts.hits > 0) {
        EXPECT_GE(own.triangle_tests, own.hits);
    }
    if (!options.counters) {
        EXPECT_EQ(own.node_visits, 0u);
        EXPECT_EQ(own.triangle_tests, 0u);
    }
    std::vector<std::uint8_t> occluded(rays.size(), 2);
    const TraceCounts any = trace_any(tree, rays, occluded, options);
    EXPECT_EQ(any.hits, counts.hits);
    EXPECT_EQ(any.invalid_rays, counts.invalid_rays);
    different = 0;
    for (std::size_t i = 0; i < rays.size(); ++i)
        different += occluded[i] != (wanted[i].hit() ? 1 : 0);
    EXPECT_EQ(different, 0u) << "any hit";
}

void expect_like_scalar(const std::string& what, const Bvh& bvh, std::span<const Ray> rays,
                        bool some_hit = true) {
    std::vector<Hit> wanted(rays.size());
    const TraceCounts counts = trace(bvh, rays, wanted);
    std::cout << what << ": " << rays.size() << " rays, " << counts.hits << " hits (seed "
              << simd_seed << ")\n";
    if (some_hit) {
        EXPECT_GT(counts.hits, 0u);
    }
    for (const WideBvhOptions layout :
         {WideBvhOptions{}, WideBvhOptions{.width = 4}, WideBvhOptions{.compact = true}}) {
        const WideBvh tree(bvh, layout);
        const bool is_default = layout.width == 8 && !layout.compact;
        const std::string what_layout = what + (layout.compact      ? ", compact"
                                                : layout.width == 4 ? ", wide4"
                                                                    : "");
        for (const std::string& isa : simd_instruction_sets())
            for (const SimdPath path : paths) {
                // What a layout changes is the same code for each instruction set.
                if (!is_default && isa == "avx2") continue;
                expect_like(what_layout, tree, rays, wanted, counts,
                            {.counters = path == SimdPath::stream, .path = path, .isa = isa});
            }
    }
}

void expect_like_scalar(const Model& scene, std::size_t rays, const BuildOptions& options = {}) {
    expect_like_scalar(scene.name, build_bvh(scene.mesh(), options),
                       make_mixed_rays(scene, rays, simd_seed));
}

constexpr std::size_t many = sanitized ? 500 : thorough == 1 ? 2'000 : 4'000 * thorough;

TEST(Simd, HasCodeForThisProcessor) {
    const auto sets = simd_instruction_sets();
    ASSERT_FALSE(sets.empty());
    for (const std::string& isa : sets) std::cout << isa << "\n";
#if defined(__aarch64__)
    EXPECT_EQ(sets, std::vector<std::string>{"neon"});
#elif defined(RAYDIX_SETS_ONE)
    EXPECT_EQ(sets.size(), 1u) << "that of the baseline alone";
#elif defined(__x86_64__)
    EXPECT_EQ(sets.back(), "sse4");
#if defined(RAYDIX_SETS_ALL)
    EXPECT_EQ(std::ranges::count(sets, "avx2"), __builtin_cpu_supports("avx2") ? 1 : 0);
#endif
    if (__builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl")) {
        EXPECT_EQ(sets.front(), "avx512");
    }
#endif
}

TEST(Simd, SoupsLikeScalar) {
    expect_like_scalar(scene_of(random_soup(2000, 1), "soup"), many);
    expect_like_scalar(scene_of(random_soup(2000, 2, 1.0f), "soup of large ones"), many / 4);
    expect_like_scalar(scene_of(lattice_mesh(2000, 20, 5), "lattice"), many);
    expect_like_scalar(scene_of(moved(random_soup(2000, 4), {1e5f, -2e5f, 5e6f}), "soup far off"),
                       many);
    expect_like_scalar(scene_of(scaled(random_soup(2000, 4), 1e-6f), "small soup"), many);
    expect_like_scalar(scene_of(scaled(random_soup(2000, 4), 1e-9f), "tiny soup"), many);
    expect_like_scalar(scene_of(scaled(random_soup(2000, 4), 1e12f), "huge soup"), many);
}

TEST(Simd, BuiltinScenesLikeScalar) {
    const auto scenes = builtin_triangle_scenes(20'000);
    EXPECT_GE(scenes.size(), 4u);
    for (const Model& scene : scenes) expect_like_scalar(scene, many);
}

TEST(Simd, EveryBuilderAndLeafSize) {
    const Model scene = scene_of(random_soup(3000, 8, 0.2f), "soup");
    for (const Builder builder : {Builder::karras, Builder::ploc, Builder::binned, Builder::sweep,
                                  Builder::split, Builder::sbvh})
        for (const int max_leaf : {1, 4, 255})
            expect_like_scalar(scene, thorough == 1 ? 200 : 500 * thorough,
                               {.builder = builder, .max_leaf = max_leaf});
}

TEST(Simd, FewTriangles) {
    const Mesh all = random_soup(30, simd_seed, 1.0f);
    for (std::size_t n = 0; n <= 30; ++n) {
        Mesh mesh = all;
        mesh.triangles.resize(n);
        if (n == 0) mesh.vertices.clear();
        expect_like_scalar(std::to_string(n) + " triangles", build_bvh(mesh),
                           make_mixed_rays(scene_of(all, "few"), 1000, simd_seed), n > 0);
    }
}

/// Limits beside t: what floats decide of any hit must be what the whole test says. Large and thin
/// triangles, rays that start next to them and far off, scenes of all sizes.
TEST(Simd, LimitsBesideTheHit) {
    std::mt19937_64 random(simd_seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    const auto point = [&](float size) {
        return Vec3{size * (2 * unit() - 1), size * (2 * unit() - 1), size * (2 * unit() - 1)};
    };
    for (const float size : {1.0f, 1e-6f, 1e-11f, 1e9f})
        for (const float thin : {1.0f, 1e-2f, 1e-5f}) {
            Mesh mesh = random_soup(60, 12, 1.5f);
            for (std::size_t v = 0; v < mesh.vertices.size();
                 v += 3)  // one corner close to another
                mesh.vertices[v + 1] =
                    mesh.vertices[v] + thin * (mesh.vertices[v + 1] - mesh.vertices[v]);
            for (Vec3& v : mesh.vertices) v = size * v;
            const Bvh bvh = build_bvh(mesh);
            std::vector<Ray> rays;
            constexpr int most = thorough > 1 ? 6'000 : sanitized ? 300 : 1'000;
            for (int k = 0; k < most; ++k) {
                const Triangle& t = mesh.triangles[random() % mesh.triangles.size()];
                const float u = unit(), v = (1 - u) * unit();
                const Vec3 target = mesh.vertices[t[0]] * (1 - u - v) + mesh.vertices[t[1]] * u +
                                    mesh.vertices[t[2]] * v;
                const int away = -static_cast<int>(random() % 26);
                Ray ray{target + point(std::ldexp(size, away + (k % 16 == 0 ? 40 : 2))),
                        0,
                        {},
                        infinity};
                ray.direction = k % 3 == 0 ? point(1) : target - ray.origin;
                const Hit hit = closest_hit(bvh, ray);
                const float at = hit.hit() ? hit.t : 1.0f;
                const auto beside = [&] {
                    const float step = std::ldexp(1.0f, -1 - static_cast<int>(random() % 26));
                    const float moved[] = {at, std::nextafter(at, 0.0f),
                                           std::nextafter(at, infinity), at * (1 - step),
                                           at * (1 + step)};
                    return moved[random() % 5];
                };
                (k % 2 == 0 ? ray.tmax : ray.tmin) = beside();
                rays.push_back(ray);
            }
            expect_like_scalar(fmt::format("size {}, thin {}", size, thin), bvh, rays);
        }
}

/// Around the sizes of vectors, packets and jobs.
TEST(Simd, BatchesOfEverySize) {
    const Model scene = scene_of(random_soup(2000, 9, 0.2f), "soup");
    const Bvh bvh = build_bvh(scene.mesh());
    const std::size_t most = sanitized ? 10'000 : 40'000;
    const auto rays = make_mixed_rays(scene, most, simd_seed);
    for (const std::size_t n : std::initializer_list<std::size_t>{0, 1, 2, 3, 4, 5, 15, 16, 17, 63,
                                                                  64, 65, 1023, 1024, 1025, most})
        expect_like_scalar(std::to_string(n) + " rays", bvh, std::span(rays).first(n), n > 60);
}

TEST(Simd, NastyRays) {
    const Model scene = scene_of(random_soup(500, 3, 0.5f), "soup");
    const float nan = std::nanf(""), most = std::numeric_limits<float>::max();
    std::vector<Ray> rays{{{0, 0, 0}, 0, {0, 0, 0}, infinity},
                          {{nan, 0, 0}, 0, {1, 0, 0}, infinity},
                          {{0, infinity, 0}, 0, {1, 0, 0}, infinity},
                          {{0, 0, 0}, nan, {1, 0, 0}, infinity},
                          {{0, 0, 0}, 0, {1, nan, 0}, infinity},
                          {{0, 0, 0}, 0, {nan, 1, 0}, infinity},
                          {{0, 0, 0}, 0, {1, 0, infinity}, infinity},
                          {{0, 0, 0}, 0, {1, 0, 0}, nan},
                          {{0, 0, 0}, 2, {1, 0, 0}, 1},
                          {{0, 0, 0}, -2, {1, 0, 0}, -1},
                          {{0, 0, 0}, -5, {1, 1, 1}, infinity},
                          {{most, most, most}, 0, {-1, -1, -1}, infinity},
                          {{-most, 0.5f, 0.5f}, 0, {1, 0, -0.0f}, infinity},
                          {{0.5f, 0.5f, -1e30f}, 0, {0, -0.0f, 1}, infinity},
                          {{0.5f, 0.5f, -1}, 0, {1e-40f, -1e-44f, 1}, infinity},
                          {{0.5f, 0.5f, -1}, 0, {1e-30f, 1e-25f, 1e-20f}, infinity},
                          {{0.5f, 0.5f, -1}, 0, {1e-45f, 0, 1e-44f}, infinity},
                          {{0.5f, 0.5f, 2}, 0, {0, 0, -most}, infinity}};
    std::mt19937_64 random(simd_seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    for (int k = 0; k < 20'000; ++k) {  // along axes, from within and from far off
        Ray ray{{unit(), unit(), unit()}, 0, {0, -0.0f, 0}, infinity};
        const std::size_t axis = k % 3;
        (&ray.direction.x)[axis] = k % 2 == 0 ? 1.0f : -1.0f;
        if (k % 4 < 2) (&ray.origin.x)[axis] -= 1000.0f * (&ray.direction.x)[axis];
        if (k % 5 == 0) (&ray.direction.x)[(axis + 1) % 3] = std::ldexp(unit() - 0.5f, -k % 149);
        if (k % 7 == 0) ray.direction = std::ldexp(1.0f, k % 200 - 100) * ray.direction;
        if (k % 11 == 0) ray.tmax = unit();
        rays.push_back(ray);
    }
    expect_like_scalar("nasty rays", build_bvh(scene.mesh()), rays);
}

/// Each ray as a call of its own, by every instruction set and by closest_hit.
void expect_alone_like_scalar(const Bvh& bvh, std::span<const Ray> rays) {
    const std::vector<Hit> wanted = trace(bvh, rays);
    for (const WideBvhOptions layout : {WideBvhOptions{}, WideBvhOptions{.compact = true}}) {
        const WideBvh tree(bvh, layout);
        for (std::size_t i = 0; i < rays.size(); ++i) {
            SCOPED_TRACE(testing::Message() << "ray " << i << ", compact " << layout.compact);
            std::vector<Hit> hits{closest_hit(tree, rays[i])};
            std::vector<std::uint8_t> any{any_hit(tree, rays[i])};
            for (const std::string& isa : simd_instruction_sets()) {
                Hit hit;
                std::uint8_t occluded = 0;
                trace(tree, rays.subspan(i, 1), std::span(&hit, 1), {.isa = isa});
                trace_any(tree, rays.subspan(i, 1), std::span(&occluded, 1), {.isa = isa});
                hits.push_back(hit), any.push_back(occluded);
            }
            for (const Hit& hit : hits) {
                ASSERT_EQ(hit.prim, wanted[i].prim);
                ASSERT_EQ(hit.t, wanted[i].t);
            }
            for (const std::uint8_t found : any) ASSERT_EQ(found != 0, wanted[i].hit());
        }
    }
}

TEST(Simd, RaysThatEndWhereTheyBegin) {
    std::vector<Ray> rays;
    std::mt19937_64 random(simd_seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    for (int k = 0; k < 800; ++k) {
        const auto zero = [&](int bit) { return k >> bit & 1 ? -0.0f : 0.0f; };
        rays.push_back({{unit(), unit(), zero(0)},
                        zero(1),
                        {unit() - 0.5f, unit() - 0.5f, k & 16 ? -1.0f : 1.0f},
                        k & 8 ? 0x1p-149f * static_cast<float>(k % 3) : zero(2)});
    }
    Mesh flat = random_soup(500, 3, 0.5f);
    for (Vec3& v : flat.vertices) v.z = 0;
    const Bvh bvh = build_bvh(flat);
    expect_like_scalar("rays that end where they begin", bvh, rays);
    expect_alone_like_scalar(bvh, rays);
}

TEST(Simd, RaysAloneLikeScalar) {
    for (const std::uint64_t number : {1, 2, 3}) {
        const Model scene = scene_of(random_soup(2000, number, number == 3 ? 1.0f : 0.2f), "soup");
        expect_alone_like_scalar(build_bvh(scene.mesh()), make_mixed_rays(scene, 400, simd_seed));
    }
}

TEST(Simd, NastyMeshes) {
    const Mesh soup = random_soup(500, 6, 0.3f);
    Mesh laced = soup;
    for (std::size_t i = 0; i < laced.vertices.size(); i += 7) laced.vertices[i].y = std::nanf("");
    Mesh with_points = soup;  // zero areas
    for (std::size_t k = 0; k < with_points.triangles.size(); k += 3)
        with_points.triangles[k][1] = with_points.triangles[k][0];
    Mesh twice = soup;  // ties
    twice.triangles.insert(twice.triangles.end(), soup.triangles.rbegin(), soup.triangles.rend());
    Mesh piled = soup;
    for (std::size_t k = 0; k < piled.triangles.size(); ++k)
        piled.triangles[k] = soup.triangles[k % 2];
    Mesh flat = soup;
    for (Vec3& v : flat.vertices) v.z = -0.25f;
    for (const Mesh& mesh : {laced, with_points, twice, piled, flat}) {
        Model whole = scene_of(soup, "soup");
        whole.mesh().triangles = {soup.triangles.begin(), soup.triangles.begin() + 400};
        expect_like_scalar("nasty mesh", build_bvh(mesh),
                           make_mixed_rays(whole, sanitized ? 2'000 : 10'000, simd_seed));
    }
    Mesh none = soup;  // all without area: a tree without leaves
    for (Triangle& t : none.triangles) t[2] = t[1];
    const Bvh bvh = build_bvh(none);
    const WideBvh tree(bvh);
    EXPECT_TRUE(tree.empty());
    expect_like_scalar("flat triangles", bvh,
                       make_mixed_rays(scene_of(soup, "soup"), 3000, simd_seed), false);
}

/// All rays go through all of a deep tree: the lists of a stream grow beyond what they may waste.
TEST(Simd, DeepTreesWithAllRaysEverywhere) {
    Mesh mesh;  // one behind the other, each in a cell of its own, ever closer together
    for (int k = 0; k < 120; ++k) {
        const float z = std::ldexp(1.0f, -k / 2) * (k % 2 == 0 ? 1.0f : 1.4f);
        const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
        for (const Vec3 v : {Vec3{-9, -9, z}, Vec3{9, -9, z}, Vec3{0, 9, z}})
            mesh.vertices.push_back(v);
        mesh.triangles.push_back({first, first + 1, first + 2});
    }
    const Bvh bvh = build_bvh(mesh, {.max_leaf = 1});
    const WideBvh tree(bvh);
    std::mt19937_64 random(simd_seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    std::vector<Ray> rays;
    for (int k = 0; k < 300'000; ++k)  // one class, few of them blocked early
        rays.push_back({{unit(), unit(), 3.0f},
                        k % 10 == 0 ? 0.0f : 2.9f + 0.1f * unit(),
                        {0.01f * unit(), 0.01f * unit(), -1},
                        infinity});
    std::vector<Hit> hits(rays.size());
    const TraceCounts wanted = trace(bvh, rays, hits, {.threads = 2});
    EXPECT_GT(wanted.hits, 0u);
    for (const std::string& isa : simd_instruction_sets())
        expect_like("deep tree", tree, rays, hits, wanted, {.path = SimdPath::stream, .isa = isa});
}

/// As a builder that splits triangles leaves it: several references to one triangle.
TEST(Simd, DuplicatedReferences) {
    const Model scene = scene_of(random_soup(1000, 5, 0.3f), "soup");
    const auto n = static_cast<std::uint32_t>(scene.mesh().triangles.size());
    Mesh doubled = scene.mesh();
    doubled.triangles.insert(doubled.triangles.end(), scene.mesh().triangles.begin(),
                             scene.mesh().triangles.end());
    Bvh bvh = build_bvh(doubled);
    for (std::uint32_t& prim : BvhInternals{bvh}.order().span()) prim %= n;
    BvhInternals{bvh}.input_count() = n;
    const WideBvh tree(bvh);
    EXPECT_EQ(tree.stats().references, 2 * n);
    const auto rays = make_mixed_rays(scene, 20'000, simd_seed);
    const Bvh plain = build_bvh(scene.mesh());
    for (const SimdPath path : paths)
        EXPECT_TRUE(
            std::ranges::equal(trace(tree, rays, {.path = path}), trace(plain, rays), same_bits));
    const AllHits all = trace_all(tree, rays), wanted = trace_all(plain, rays);
    EXPECT_EQ(all.offsets, wanted.offsets);
    EXPECT_TRUE(std::ranges::equal(all.hits, wanted.hits, same_bits));
}

TEST(Simd, AllHitsLikeScalar) {
    for (const Model& scene : builtin_triangle_scenes(5'000)) {
        const Bvh bvh = build_bvh(scene.mesh());
        const WideBvh tree(bvh);
        const auto rays = make_mixed_rays(scene, 1000 * thorough, simd_seed);
        const AllHits wanted = trace_all(bvh, rays);
        EXPECT_GT(wanted.hits.size(), 0u);
        for (const std::string& isa : simd_instruction_sets())
            for (const SimdPath path : {SimdPath::automatic, SimdPath::packet, SimdPath::single})
                for (const bool counters : {false, true}) {
                    const AllHits all =
                        trace_all(tree, rays, {.counters = counters, .path = path, .isa = isa});
                    EXPECT_EQ(all.offsets, wanted.offsets) << isa;
                    EXPECT_TRUE(std::ranges::equal(all.hits, wanted.hits, same_bits)) << isa;
                    EXPECT_EQ(all.counts.hits, wanted.counts.hits);
                    EXPECT_EQ(all.counts.invalid_rays, wanted.counts.invalid_rays);
                    EXPECT_EQ(all.counts.node_visits > 0, counters);
                }
    }
}

/// Rays of one class and of several, each through so many triangles that jobs sort their hits in
/// place; some of them at the same distance.
TEST(Simd, AllHitsOfManyLayers) {
    Mesh mesh;
    for (std::uint32_t k = 0; k < 400; ++k) {
        const auto z = static_cast<float>(k / 2);  // in pairs
        for (const Vec3 v : {Vec3{-9, -9, z}, Vec3{27, -9, z}, Vec3{-9, 27, z}})
            mesh.vertices.push_back(v);
        mesh.triangles.push_back({3 * k, 3 * k + 1, 3 * k + 2});
    }
    const Bvh bvh = build_bvh(mesh);
    constexpr std::size_t count = fewer(1500, 5);
    for (const bool mixed : {false, true}) {
        std::vector<Ray> rays;
        for (std::uint32_t k = 0; k < count; ++k) {
            const bool up = mixed && k % 3 == 0;
            const auto x = 0.001f * static_cast<float>(k);
            rays.push_back(
                {{x, 0.5f * x, up ? -1.0f : 201.0f}, 0, {0, 0, up ? 1.0f : -1}, infinity});
            if (k % 7 == 0) rays.back().tmax = 0.5f;  // hits nothing
        }
        const AllHits wanted = trace_all(bvh, rays);
        EXPECT_EQ(wanted.hits.size(), 400u * (count - (count + 6) / 7));
        for (const bool compact : {false, true})
            for (const SimdPath path : {SimdPath::packet, SimdPath::single}) {
                const AllHits all =
                    trace_all(WideBvh(bvh, {.compact = compact}), rays, {.path = path});
                EXPECT_EQ(all.offsets, wanted.offsets);
                EXPECT_TRUE(std::ranges::equal(all.hits, wanted.hits, same_bits));
            }
    }
}

TEST(Simd, OneRayLikeBatches) {
    const Model scene = load_model("builtin:atrium?triangles=10000");
    const Bvh bvh = build_bvh(scene.mesh());
    const WideBvh tree(bvh);
    const auto rays = make_mixed_rays(scene, 2000, simd_seed);
    const auto wanted = trace(bvh, rays);
    for (std::size_t i = 0; i < rays.size(); ++i) {
        ASSERT_TRUE(same_bits(closest_hit(tree, rays[i]), wanted[i])) << i;
        ASSERT_EQ(any_hit(tree, rays[i]), wanted[i].hit()) << i;
    }
    const WideBvh empty(build_bvh(Mesh{}));
    EXPECT_FALSE(closest_hit(empty, rays[0]).hit());
    EXPECT_FALSE(any_hit(empty, rays[0]));
}

#if defined(RAYDIX_FLUSHES_DENORMALS)
/// Callers may have told their thread to flush denormals; the hits are the same, and so is the
/// setting afterwards.
TEST(Simd, OneRayOfACallerThatFlushesDenormals) {
    const Mesh mesh = scaled(random_soup(300, 4, 0.3f), 1e-11f);
    const WideBvh tree(build_bvh(mesh));
    auto rays = make_mixed_rays(scene_of(mesh, "tiny"), 3000, simd_seed);
    for (Ray& ray : rays) ray.direction = 1e-30f * ray.direction;  // t beyond the usual too
    std::vector<Hit> wanted(rays.size()), hits(rays.size());
    for (std::size_t i = 0; i < rays.size(); ++i) wanted[i] = closest_hit(tree, rays[i]);
    {
        const FlushedDenormals flushed;
        for (std::size_t i = 0; i < rays.size(); ++i) hits[i] = closest_hit(tree, rays[i]);
        EXPECT_TRUE(FlushedDenormals::still());
    }
    EXPECT_TRUE(std::ranges::equal(hits, wanted, same_bits));
    EXPECT_GT(std::ranges::count_if(wanted, [](const Hit& h) { return h.hit(); }), 0);
}
#endif

TEST(Simd, SameCountsForEveryThreadCount) {
    const Model scene = load_model("builtin:atrium?triangles=10000");
    const auto rays = make_mixed_rays(scene, 2000 * thorough, simd_seed);
    const WideBvh tree(build_bvh(scene.mesh()));
    for (const SimdPath path : paths) {
        std::vector<Hit> wanted(rays.size()), hits(rays.size());
        const TraceCounts one =
            trace(tree, rays, wanted, {.threads = 1, .counters = true, .path = path});
        for (const int threads : {2, 7, 0}) {
            const TraceCounts counts =
                trace(tree, rays, hits, {.threads = threads, .counters = true, .path = path});
            EXPECT_TRUE(std::ranges::equal(hits, wanted, same_bits));
            EXPECT_EQ(counts.node_visits, one.node_visits) << simd_path_name(path);
            EXPECT_EQ(counts.triangle_tests, one.triangle_tests) << simd_path_name(path);
        }
    }
}

/// Children are ordered in a way of its own by each: a wrong order costs visits, not hits.
TEST(Simd, VisitsAboutAsManyNodesWithEveryInstructionSet) {
    const Model scene = load_model("builtin:atrium?triangles=20000");
    const Bvh bvh = build_bvh(scene.mesh());
    const WideBvh tree(bvh);
    std::vector<std::uint32_t> pixels;
    std::vector<Ray> rays = make_primary_rays(scene.cameras.cameras.at(0), 160, 120, &pixels);
    const auto secondary = make_secondary_rays(bvh, rays, trace(bvh, rays), pixels,
                                               {.kind = RayKind::diffuse, .samples = 2});
    rays.insert(rays.end(), secondary.begin(), secondary.end());
    std::vector<Hit> hits(rays.size());
    for (const SimdPath path : {SimdPath::single, SimdPath::packet, SimdPath::stream}) {
        std::vector<std::uint64_t> visits;
        for (const std::string& isa : simd_instruction_sets())
            visits.push_back(
                trace(tree, rays, hits, {.counters = true, .path = path, .isa = isa}).node_visits);
        const auto [least, most] = std::ranges::minmax(visits);
        EXPECT_LE(static_cast<double>(most), 1.02 * static_cast<double>(least))
            << simd_path_name(path);
    }
}

TEST(Simd, EachPathWhereItBelongs) {
    const Model scene = load_model("builtin:atrium?triangles=20000");
    const Bvh bvh = build_bvh(scene.mesh());
    const WideBvh tree(bvh);
    std::vector<std::uint32_t> pixels;
    const auto primary = make_primary_rays(scene.cameras.cameras.at(0), 256, 192, &pixels);
    EXPECT_EQ(choose_simd_path(tree, primary), SimdPath::packet);
    SecondaryOptions secondary;
    secondary.kind = RayKind::diffuse;
    secondary.samples = 8;
    secondary.sorted = false;
    const auto hits = trace(bvh, primary);
    EXPECT_EQ(choose_simd_path(tree, make_secondary_rays(bvh, primary, hits, pixels, secondary)),
              SimdPath::stream);
    secondary.kind = RayKind::diffuse_shuffled;
    EXPECT_EQ(choose_simd_path(tree, make_secondary_rays(bvh, primary, hits, pixels, secondary)),
              SimdPath::sorted);
    EXPECT_EQ(choose_simd_path(tree, {}), SimdPath::packet);
}

/// Fewer nodes than `scalar` enters, since each has up to eight children.
TEST(Simd, EntersFewerNodesThanScalar) {
    const Model scene = load_model("builtin:atrium?triangles=20000");
    const Bvh bvh = build_bvh(scene.mesh());
    const auto rays = make_mixed_rays(scene, 10'000, simd_seed);
    std::vector<Hit> hits(rays.size());
    const TraceCounts binary = trace(bvh, rays, hits, {.counters = true});
    const WideBvh tree(bvh);
    for (const SimdPath path : paths) {
        const TraceCounts wide = trace(tree, rays, hits, {.counters = true, .path = path});
        EXPECT_LT(2 * wide.node_visits, binary.node_visits) << simd_path_name(path);
    }
}

TEST(Simd, RefusesWhatItCannotDo) {
    const std::vector<Aabb> boxes(4, Aabb{{0, 0, 0}, {1, 1, 1}});
    EXPECT_THROW(WideBvh{build_bvh(boxes)}, InputError);
    const Bvh bvh = build_bvh(random_soup(100, 1));
    EXPECT_THROW((WideBvh{bvh, {.width = 5}}), InputError);
    const WideBvh tree(bvh);
    const std::vector<Ray> rays(3, Ray{{0, 0, 0}, 0, {0, 0, 1}, 1});
    std::vector<Hit> two(2);
    std::vector<std::uint8_t> four(4);
    EXPECT_THROW(trace(tree, rays, two), InputError);
    EXPECT_THROW(trace_any(tree, rays, four), InputError);
    try {
        static_cast<void>(trace(tree, rays, {.isa = "mmx"}));
        ADD_FAILURE();
    } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find(simd_instruction_sets().back()), std::string::npos)
            << error.what();
    }
    const WideBvh empty(build_bvh(Mesh{}));
    EXPECT_THROW(static_cast<void>(trace(empty, rays, {.isa = "mmx"})), InputError);
    EXPECT_THROW(static_cast<void>(trace_all(empty, rays, {.isa = "mmx"})), InputError);
    EXPECT_THROW(static_cast<void>(simd_path_from_name("fast")), InputError);
    EXPECT_EQ(simd_path_from_name("sorted"), SimdPath::sorted);
}

/// Rays from the middle of a closed surface, at vertices and edges, wherever it lies.
TEST(Simd, NoRayLeavesAClosedSurface) {
    for (const Vec3 move : {Vec3{0, 0, 0}, Vec3{1e5f, 1e5f, -1e5f}}) {
        const Mesh mesh = ball_mesh(move);
        const WideBvh tree(build_bvh(mesh, {.max_leaf = 1}));
        std::mt19937_64 random(simd_seed);
        std::vector<Ray> rays;
        for (std::size_t k = 0; k < 10'000 * thorough; ++k) {
            const Triangle& t = mesh.triangles[random() % mesh.triangles.size()];
            const Vec3 a = mesh.vertices[t[0]], b = mesh.vertices[t[1]];
            rays.push_back({move, 0, (k % 2 == 0 ? a : 0.5f * (a + b)) - move, infinity});
        }
        for (const std::string& isa : simd_instruction_sets())
            for (const SimdPath path : paths) {
                const auto hits = trace(tree, rays, {.path = path, .isa = isa});
                EXPECT_EQ(std::ranges::count_if(hits, [](const Hit& h) { return !h.hit(); }), 0)
                    << isa << ", " << simd_path_name(path);
            }
    }
}

}  // namespace
}  // namespace raydix::test
