// Answers of the C interface against those of the C++ one, bit for bit: scenes, rays, filters, user
// geometry, all hits, distances and points, in float and double; what it refuses, and with which
// message. libraydix_c.so has a raydix of its own, which this program's does not meet.
#include <gtest/gtest.h>
#include <raydix/double.h>
#include <raydix/raydix.h>
#include <raydix_c.h>
#include <raydix_c_double.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "support/double_scenes.h"
#include "support/random.h"
#include "support/ray_sets.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {

namespace {

template <class T>
bool same_bits(const T& a, const T& b) {
    return std::memcmp(&a, &b, sizeof(T)) == 0;
}

bool same(const raydix_hit& c, const Hit& cpp) {
    return same_bits(c.t, cpp.t) && c.prim == cpp.prim && same_bits(c.u, cpp.u) &&
           same_bits(c.v, cpp.v) && c.geometry == cpp.geometry && c.instance == cpp.instance;
}
bool same(const raydix_hit_d& c, const HitD& cpp) {
    return same_bits(c.t, cpp.t) && c.prim == cpp.prim && same_bits(c.u, cpp.u) &&
           same_bits(c.v, cpp.v) && c.geometry == cpp.geometry && c.instance == cpp.instance;
}

const raydix_ray* c_rays(const std::vector<Ray>& rays) {
    return reinterpret_cast<const raydix_ray*>(rays.data());
}
const raydix_ray_d* c_rays(const std::vector<RayD>& rays) {
    return reinterpret_cast<const raydix_ray_d*>(rays.data());
}

#define EXPECT_OK(call) EXPECT_EQ(call, RAYDIX_OK) << raydix_last_error()
#define ASSERT_OK(call) ASSERT_EQ(call, RAYDIX_OK) << raydix_last_error()

/// Refuses every third primitive.
bool counts_prim(std::uint32_t prim) { return prim % 3 != 0; }
int refuse_thirds(void* calls, std::size_t, const raydix_ray*, const raydix_hit* hit) {
    return calls != nullptr && counts_prim(hit->prim);
}
int refuse_thirds_d(void* calls, std::size_t, const raydix_ray_d*, const raydix_hit_d* hit) {
    return calls != nullptr && counts_prim(hit->prim);
}

/// A horizontal plate in the middle of each box: `user` is the boxes.
template <class Scalar, class AnyRay, class AnyHit>
int plate(const void* user, std::uint32_t prim, const AnyRay& ray, AnyHit& hit) {
    const Scalar* box = static_cast<const Scalar*>(user) + 6 * std::size_t{prim};
    const Scalar t = ((box[2] + box[5]) / 2 - ray.origin[2]) / ray.direction[2];
    const Scalar x = ray.origin[0] + t * ray.direction[0], y = ray.origin[1] + t * ray.direction[1];
    if (!(x >= box[0] && x <= box[3] && y >= box[1] && y <= box[4])) return 0;
    hit.t = t;
    hit.u = x - box[0];
    hit.v = y - box[1];
    return 1;
}
int plate_in_float(void* user, std::uint32_t prim, const raydix_ray* ray, raydix_hit* hit) {
    return plate<float>(user, prim, *ray, *hit);
}
int plate_in_double(void* user, std::uint32_t prim, const raydix_ray_d* ray, raydix_hit_d* hit) {
    return plate<double>(user, prim, *ray, *hit);
}

/// A scene of every kind of geometry, by both interfaces; the C one owns its handles.
struct Pair {
    raydix_scene *child = nullptr, *scene = nullptr;
    Scene cpp_child, cpp;
    std::vector<float> plates{-0.1f, 0.2f, 0.4f, 0.3f, 0.5f, 0.5f,
                              0.6f,  0.1f, 0.7f, 0.9f, 0.9f, 0.8f};

    void fill() {
        const Mesh mesh = random_soup(3000, 5), other = random_soup(500, 6, 0.1f);
        ASSERT_OK(raydix_scene_create(&child));
        ASSERT_OK(raydix_scene_create(&scene));
        add_mesh(child, other);
        ASSERT_OK(raydix_scene_commit(child, nullptr));
        cpp_child.add(other);
        cpp_child.commit();
        add_mesh(scene, mesh);
        cpp.add(mesh);
        const std::vector<Sphere> spheres{{{0.2f, 0.3f, 0.4f}, 0.1f}, {{0.7f, 0.8f, 0.2f}, 0.05f}};
        ASSERT_OK(raydix_scene_add_spheres(scene, &spheres[0].center.x, 2, 3u, nullptr));
        cpp.add(std::span<const Sphere>(spheres), {.mask = 3u});
        const std::vector<Capsule> capsules{{{0, 0, 0}, {1, 1, 0.5f}, 0.02f}};
        ASSERT_OK(raydix_scene_add_capsules(scene, &capsules[0].a.x, 1, RAYDIX_ALL, nullptr));
        cpp.add(std::span<const Capsule>(capsules));
        const std::vector<Vec3> points{{0.5f, 0.5f, 0.9f}, {0.1f, 0.9f, 0.9f}};
        ASSERT_OK(raydix_scene_add_points(scene, &points[0].x, 2, 0.05f, RAYDIX_ALL, nullptr));
        cpp.add(std::span<const Vec3>(points), 0.05f);
        add_plates();
        const std::array<float, 12> numbers{0.5f, 0.1f, 0, 0.2f, -0.1f, 0.6f,
                                            0,    0.1f, 0, 0,    0.5f,  0.3f};
        Transform transform;
        for (std::size_t i = 0; i < 12; ++i) transform.m[i / 4][i % 4] = numbers[i];
        std::uint32_t id = 99;
        ASSERT_OK(raydix_scene_add_instance(scene, child, numbers.data(), 2u, &id));
        EXPECT_EQ(id, 5u);
        EXPECT_EQ(cpp.add(cpp_child, transform, {.mask = 2u}), 5u);
        ASSERT_OK(raydix_scene_commit(scene, nullptr));
        cpp.commit();
    }
    ~Pair() {
        raydix_scene_destroy(scene);
        raydix_scene_destroy(child);
    }

private:
    static void add_mesh(raydix_scene* to, const Mesh& mesh) {
        ASSERT_OK(raydix_scene_add_mesh(to, &mesh.vertices[0].x, mesh.vertices.size(),
                                        mesh.triangles[0].data(), mesh.triangles.size(), RAYDIX_ALL,
                                        nullptr));
    }
    void add_plates() {
        ASSERT_OK(raydix_scene_add_user(scene, plates.data(), 2, plate_in_float, plates.data(),
                                        RAYDIX_ALL, nullptr));
        const std::vector<Aabb> boxes{
            {{plates[0], plates[1], plates[2]}, {plates[3], plates[4], plates[5]}},
            {{plates[6], plates[7], plates[8]}, {plates[9], plates[10], plates[11]}}};
        cpp.add(UserGeometry(boxes, [this](std::uint32_t prim, const Ray& ray, Hit& hit) {
            return plate<float>(plates.data(), prim, reinterpret_cast<const raydix_ray&>(ray),
                                hit) != 0;
        }));
    }
};

/// From a plane above to points of the unit cube.
std::vector<Ray> rays_around(std::size_t count) {
    Random random(11);
    std::vector<Ray> rays(count);
    for (Ray& ray : rays) {
        const Vec3 from{random.between(-0.5f, 1.5f), random.between(-0.5f, 1.5f), 2};
        ray = {from, 0, random.in(0, 1) - from, infinity};
    }
    return rays;
}

void expect_same(const std::vector<raydix_hit>& c, const std::vector<Hit>& cpp) {
    ASSERT_EQ(c.size(), cpp.size());
    for (std::size_t i = 0; i < c.size(); ++i) ASSERT_TRUE(same(c[i], cpp[i])) << i;
}

}  // namespace

TEST(Answers, HitsOfEveryKindAreThoseOfCpp) {
    Pair pair;
    pair.fill();
    const std::vector<Ray> rays = rays_around(5000);
    std::vector<raydix_hit> hits(rays.size());
    ASSERT_OK(raydix_trace_closest(pair.scene, c_rays(rays), rays.size(), hits.data(), nullptr));
    const std::vector<Hit> expected = trace(pair.cpp, rays);
    expect_same(hits, expected);
    std::array<bool, 6> met{};
    for (const Hit& hit : expected)
        if (hit.hit()) met[hit.geometry < 6 && hit.instance == 0 ? hit.geometry : 5] = true;
    for (const bool seen : met) EXPECT_TRUE(seen);

    std::vector<std::uint8_t> occluded(rays.size()), occluded_cpp(rays.size());
    ASSERT_OK(raydix_trace_any(pair.scene, c_rays(rays), rays.size(), occluded.data(), nullptr));
    trace_any(pair.cpp, rays, occluded_cpp);
    EXPECT_EQ(occluded, occluded_cpp);
    for (std::size_t i = 0; i < 100; ++i) {
        raydix_hit one;
        ASSERT_OK(raydix_trace_closest(pair.scene, c_rays(rays) + i, 1, &one, nullptr));
        EXPECT_TRUE(same(one, expected[i]));
    }
}

TEST(Answers, MasksAndFilters) {
    Pair pair;
    pair.fill();
    const std::vector<Ray> rays = rays_around(3000);
    std::vector<std::uint32_t> masks(rays.size());
    for (std::size_t i = 0; i < masks.size(); ++i) masks[i] = i % 2 == 0 ? 2u : 4u;
    int user = 0;
    raydix_trace_options options = RAYDIX_TRACE_OPTIONS;
    options.masks = masks.data();
    options.filter = refuse_thirds;
    options.user = &user;
    SceneTraceOptions cpp;
    cpp.masks = masks;
    cpp.filter = [](std::size_t, const Ray&, const Hit& hit) { return counts_prim(hit.prim); };
    std::vector<raydix_hit> hits(rays.size());
    ASSERT_OK(raydix_trace_closest(pair.scene, c_rays(rays), rays.size(), hits.data(), &options));
    const std::vector<Hit> expected = trace(pair.cpp, rays, cpp);
    expect_same(hits, expected);
    const std::vector<Hit> unfiltered = trace(pair.cpp, rays);
    EXPECT_NE(std::memcmp(expected.data(), unfiltered.data(), rays.size() * sizeof(Hit)), 0);
    options.masks = nullptr;  // the way of single rays
    for (std::size_t i = 0; i < 100; ++i) {
        raydix_hit one;
        std::uint8_t occluded = 2;
        ASSERT_OK(raydix_trace_closest(pair.scene, c_rays(rays) + i, 1, &one, &options));
        ASSERT_OK(raydix_trace_any(pair.scene, c_rays(rays) + i, 1, &occluded, &options));
        EXPECT_TRUE(same(one, closest_hit(pair.cpp, rays[i], cpp.filter)));
        EXPECT_EQ(occluded, one.prim != RAYDIX_MISSING);
    }
    // Options of a caller who knows of no filters.
    options.struct_size = offsetof(raydix_trace_options, filter);
    raydix_hit one;
    ASSERT_OK(raydix_trace_closest(pair.scene, c_rays(rays), 1, &one, &options));
    EXPECT_TRUE(same(one, closest_hit(pair.cpp, rays[0])));
}

TEST(Answers, AllHits) {
    Pair pair;
    pair.fill();
    const std::vector<Ray> rays = rays_around(1000);
    raydix_hit_lists* lists = nullptr;
    ASSERT_OK(raydix_trace_all(pair.scene, c_rays(rays), rays.size(), &lists, nullptr));
    const AllHits expected = trace_all(pair.cpp, rays);
    std::size_t count = 0;
    const std::uint64_t* offsets = nullptr;
    const raydix_hit* hits = nullptr;
    ASSERT_OK(raydix_hit_lists_arrays(lists, &count, &offsets, &hits));
    ASSERT_EQ(count, rays.size());
    EXPECT_TRUE(std::equal(expected.offsets.begin(), expected.offsets.end(), offsets));
    expect_same({hits, hits + offsets[count]}, expected.hits);
    EXPECT_GT(offsets[count], rays.size());
    raydix_hit_lists_destroy(lists);

    raydix_trace_options options = RAYDIX_TRACE_OPTIONS;
    options.max_result_bytes = 1000;
    raydix_hit_lists* none = nullptr;
    EXPECT_EQ(raydix_trace_all(pair.scene, c_rays(rays), rays.size(), &none, &options),
              RAYDIX_RESULT_TOO_LARGE);
    EXPECT_EQ(none, nullptr);
    EXPECT_NE(std::string(raydix_last_error()).find("1000"), std::string::npos)
        << raydix_last_error();
}

TEST(Answers, PositionsAndNormals) {
    Pair pair;
    pair.fill();
    const std::vector<Ray> rays = rays_around(500);
    const std::vector<Hit> hits = trace(pair.cpp, rays);
    // Normals of user geometry are unknown to both.
    std::vector<Ray> some;
    std::vector<Hit> some_hits;
    for (std::size_t i = 0; i < rays.size(); ++i)
        if (!hits[i].hit() || hits[i].geometry != 4) {
            some.push_back(rays[i]);
            some_hits.push_back(hits[i]);
        }
    const auto* c_hits = reinterpret_cast<const raydix_hit*>(some_hits.data());
    std::vector<Vec3> points(some.size()), expected_points = positions(pair.cpp, some, some_hits);
    std::vector<Vec3> vectors(some.size()), expected_vectors = normals(pair.cpp, some, some_hits);
    ASSERT_OK(raydix_hit_positions(pair.scene, c_rays(some), c_hits, some.size(), &points[0].x, 0));
    ASSERT_OK(raydix_hit_normals(pair.scene, c_rays(some), c_hits, some.size(), &vectors[0].x, 0));
    EXPECT_EQ(std::memcmp(points.data(), expected_points.data(), points.size() * sizeof(Vec3)), 0);
    EXPECT_EQ(std::memcmp(vectors.data(), expected_vectors.data(), points.size() * sizeof(Vec3)),
              0);
}

TEST(Answers, ChangesAreThoseOfCpp) {
    Pair pair;
    pair.fill();
    const std::vector<Sphere> spheres{{{0.6f, 0.3f, 0.9f}, 0.2f}};
    const std::vector<Capsule> capsules{{{0, 1, 0}, {1, 0, 1}, 0.05f}};
    const std::vector<Vec3> points{{0.5f, 0.2f, 1}};
    ASSERT_OK(raydix_scene_update_spheres(pair.scene, 1, &spheres[0].center.x, 1));
    ASSERT_OK(raydix_scene_update_capsules(pair.scene, 2, &capsules[0].a.x, 1));
    ASSERT_OK(raydix_scene_update_points(pair.scene, 3, &points[0].x, 1, 0.1f));
    ASSERT_OK(raydix_scene_remove(pair.scene, 0));
    ASSERT_OK(raydix_scene_set_mask(pair.scene, 5, 1));
    ASSERT_OK(raydix_scene_commit(pair.scene, nullptr));
    pair.cpp.update(1, std::span<const Sphere>(spheres));
    pair.cpp.update(2, std::span<const Capsule>(capsules));
    pair.cpp.update(3, std::span<const Vec3>(points), 0.1f);
    pair.cpp.remove(0);
    pair.cpp.set_mask(5, 1);
    pair.cpp.commit();
    const std::vector<Ray> rays = rays_around(2000);
    std::vector<raydix_hit> hits(rays.size());
    ASSERT_OK(raydix_trace_closest(pair.scene, c_rays(rays), rays.size(), hits.data(), nullptr));
    expect_same(hits, trace(pair.cpp, rays));
    EXPECT_EQ(raydix_scene_update_spheres(pair.scene, 2, &spheres[0].center.x, 1),
              RAYDIX_INPUT_ERROR);
}

TEST(Answers, ScenesAreSavedAndLoaded) {
    const TempFolder folder;
    const std::string file = (folder.path() / "scene.rdx").string();
    raydix_scene *scene = nullptr, *loaded = nullptr;
    ASSERT_OK(raydix_scene_create(&scene));
    const Mesh mesh = random_soup(1000, 3);
    ASSERT_OK(raydix_scene_add_mesh(scene, &mesh.vertices[0].x, mesh.vertices.size(),
                                    mesh.triangles[0].data(), mesh.triangles.size(), RAYDIX_ALL,
                                    nullptr));
    EXPECT_EQ(raydix_scene_save(scene, file.c_str()), RAYDIX_INPUT_ERROR);  // no commit
    ASSERT_OK(raydix_scene_commit(scene, nullptr));
    ASSERT_OK(raydix_scene_save(scene, file.c_str()));
    ASSERT_OK(raydix_scene_load(file.c_str(), nullptr, &loaded));
    const std::vector<Ray> rays = rays_around(2000);
    std::vector<raydix_hit> hits(rays.size()), again(rays.size());
    ASSERT_OK(raydix_trace_closest(scene, c_rays(rays), rays.size(), hits.data(), nullptr));
    ASSERT_OK(raydix_trace_closest(loaded, c_rays(rays), rays.size(), again.data(), nullptr));
    EXPECT_EQ(std::memcmp(hits.data(), again.data(), hits.size() * sizeof(raydix_hit)), 0);
    raydix_scene_destroy(loaded);
    raydix_scene_destroy(scene);

    std::ofstream(file) << "not a scene";
    raydix_scene* none = nullptr;
    EXPECT_EQ(raydix_scene_load(file.c_str(), nullptr, &none), RAYDIX_INPUT_ERROR);
    EXPECT_NE(std::string(raydix_last_error()).find("scene.rdx"), std::string::npos);
    EXPECT_EQ(none, nullptr);
}

TEST(Answers, DoubleScenesAreSavedAndLoaded) {
    const TempFolder folder;
    const std::string file = (folder.path() / "double.rdx").string(),
                      in_float = (folder.path() / "float.rdx").string();
    const MeshD mesh = random_soup_d(500, 3);
    raydix_scene_d *scene = nullptr, *loaded = nullptr, *none_d = nullptr;
    ASSERT_OK(raydix_scene_create_d(&scene));
    ASSERT_OK(raydix_scene_add_mesh_d(scene, &mesh.vertices[0].x, mesh.vertices.size(),
                                      mesh.triangles[0].data(), mesh.triangles.size(), RAYDIX_ALL,
                                      nullptr));
    ASSERT_OK(raydix_scene_commit_d(scene, nullptr));
    ASSERT_OK(raydix_scene_save_d(scene, file.c_str()));
    ASSERT_OK(raydix_scene_load_d(file.c_str(), nullptr, &loaded));
    std::vector<RayD> rays(500);
    RandomD random(6);
    const AabbD cube{{0, 0, 0}, {1, 1, 1}};
    for (RayD& ray : rays) ray = {random.in(cube), 0, random.direction(), infinity};
    std::vector<raydix_hit_d> hits(rays.size()), again(rays.size());
    ASSERT_OK(raydix_trace_closest_d(scene, c_rays(rays), rays.size(), hits.data(), nullptr));
    ASSERT_OK(raydix_trace_closest_d(loaded, c_rays(rays), rays.size(), again.data(), nullptr));
    for (std::size_t i = 0; i < rays.size(); ++i) {
        EXPECT_TRUE(same_bits(hits[i].t, again[i].t));
        EXPECT_EQ(hits[i].prim, again[i].prim);
    }
    raydix_scene_destroy_d(loaded);
    raydix_scene_destroy_d(scene);

    // Files of the other number type are refused, with what they hold.
    raydix_scene *single = nullptr, *none = nullptr;
    ASSERT_OK(raydix_scene_create(&single));
    ASSERT_OK(raydix_scene_commit(single, nullptr));
    ASSERT_OK(raydix_scene_save(single, in_float.c_str()));
    raydix_scene_destroy(single);
    EXPECT_EQ(raydix_scene_load(file.c_str(), nullptr, &none), RAYDIX_INPUT_ERROR);
    EXPECT_NE(std::string(raydix_last_error()).find("holds a scene in double"), std::string::npos)
        << raydix_last_error();
    EXPECT_EQ(raydix_scene_load_d(in_float.c_str(), nullptr, &none_d), RAYDIX_INPUT_ERROR);
    EXPECT_NE(std::string(raydix_last_error()).find("holds a scene in float"), std::string::npos)
        << raydix_last_error();
}

TEST(Answers, WhatIsMissingIsNamed) {
    raydix_scene* scene = nullptr;
    ASSERT_OK(raydix_scene_create(&scene));
    const auto expect_named = [](raydix_status status, const std::string& name) {
        EXPECT_EQ(status, RAYDIX_INPUT_ERROR);
        EXPECT_EQ(std::string(raydix_last_error()), name + " is NULL");
    };
    const std::array<float, 6> box{0, 0, 0, 1, 1, 1};
    raydix_hit hit;
    raydix_hit_lists* lists = nullptr;
    expect_named(raydix_scene_create(nullptr), "scene");
    expect_named(raydix_scene_add_points(scene, nullptr, 3, 1, RAYDIX_ALL, nullptr), "points");
    expect_named(raydix_scene_add_user(scene, box.data(), 1, nullptr, nullptr, RAYDIX_ALL, nullptr),
                 "test");
    expect_named(
        raydix_scene_add_user(scene, nullptr, 1, plate_in_float, nullptr, RAYDIX_ALL, nullptr),
        "boxes");
    expect_named(raydix_scene_save(scene, nullptr), "path");
    expect_named(raydix_trace_closest(scene, nullptr, 1, &hit, nullptr), "rays");
    expect_named(raydix_trace_all(scene, nullptr, 1, &lists, nullptr), "rays");
    expect_named(raydix_trace_all(scene, nullptr, 0, nullptr, nullptr), "lists");
    expect_named(raydix_trace_closest_d(nullptr, nullptr, 0, nullptr, nullptr), "scene");
    raydix_scene_destroy(scene);
    raydix_scene_destroy(nullptr);
    raydix_hit_lists_destroy(nullptr);
    raydix_hit_lists_destroy_d(nullptr);
    raydix_scene_destroy_d(nullptr);
}

TEST(Answers, DoubleIsDouble) {
    const MeshD mesh = random_soup_d(2000, 8), moved = [&] {
        MeshD far = mesh;
        for (Vec3d& p : far.vertices) p = p + utm_place;
        return far;
    }();
    raydix_scene_d* scene = nullptr;
    ASSERT_OK(raydix_scene_create_d(&scene));
    ASSERT_OK(raydix_scene_add_mesh_d(scene, &moved.vertices[0].x, moved.vertices.size(),
                                      moved.triangles[0].data(), moved.triangles.size(), RAYDIX_ALL,
                                      nullptr));
    const std::vector<double> plates{utm_place.x,     utm_place.y,     260,
                                     utm_place.x + 1, utm_place.y + 1, 261};
    ASSERT_OK(raydix_scene_add_user_d(scene, plates.data(), 1, plate_in_double,
                                      const_cast<double*>(plates.data()), 2u, nullptr));
    ASSERT_OK(raydix_scene_commit_d(scene, nullptr));
    SceneD cpp;
    cpp.add(moved);
    const std::vector<AabbD> boxes{
        {{plates[0], plates[1], plates[2]}, {plates[3], plates[4], plates[5]}}};
    cpp.add(UserGeometryD(boxes,
                          [&](std::uint32_t prim, const RayD& ray, HitD& hit) {
                              return plate<double>(plates.data(), prim,
                                                   reinterpret_cast<const raydix_ray_d&>(ray),
                                                   hit) != 0;
                          }),
            {.mask = 2u});
    cpp.commit();
    RandomD random(4);
    std::vector<RayD> rays(2000);
    const AabbD cube{utm_place, utm_place + Vec3d{1, 1, 1}};
    for (RayD& ray : rays) {
        const Vec3d from{utm_place.x + random.unit(), utm_place.y + random.unit(), 300};
        ray = {from, 0, random.in(cube)-from, infinity};
    }
    std::vector<raydix_hit_d> hits(rays.size());
    raydix_trace_options_d options = RAYDIX_TRACE_OPTIONS_D;
    int user = 0;
    for (const bool filtered : {false, true}) {
        options.mask = filtered ? 1u : RAYDIX_ALL;
        options.filter = filtered ? refuse_thirds_d : nullptr;
        options.user = &user;
        SceneTraceOptionsD how;
        how.mask = options.mask;
        if (filtered)
            how.filter = [](std::size_t, const RayD&, const HitD& hit) {
                return counts_prim(hit.prim);
            };
        ASSERT_OK(raydix_trace_closest_d(scene, c_rays(rays), rays.size(), hits.data(), &options));
        const std::vector<HitD> expected = trace(cpp, rays, how);
        std::size_t found = 0;
        for (std::size_t i = 0; i < rays.size(); ++i) {
            ASSERT_TRUE(same(hits[i], expected[i])) << i;
            found += expected[i].hit();
        }
        EXPECT_GT(found, rays.size() / 4);
        raydix_hit_lists_d* lists = nullptr;
        ASSERT_OK(raydix_trace_all_d(scene, c_rays(rays), rays.size(), &lists, &options));
        const AllHitsD all = trace_all(cpp, rays, how);
        const raydix_hit_d* first = nullptr;
        const std::uint64_t* offsets = nullptr;
        ASSERT_OK(raydix_hit_lists_arrays_d(lists, nullptr, &offsets, &first));
        ASSERT_EQ(offsets[rays.size()], all.hits.size());
        for (std::size_t i = 0; i < all.hits.size(); ++i) ASSERT_TRUE(same(first[i], all.hits[i]));
        raydix_hit_lists_destroy_d(lists);
    }
    std::array<double, 3> lo{}, hi{};
    ASSERT_OK(raydix_scene_bounds_d(scene, lo.data(), hi.data()));
    EXPECT_EQ(lo[0], cpp.bounds().lo.x);
    EXPECT_EQ(hi[2], cpp.bounds().hi.z);
    raydix_scene_destroy_d(scene);
}

TEST(Answers, DistancesInDouble) {
    const MeshD mesh = in_double(ball_mesh({0, 0, 0}), 3.0, utm_place);
    raydix_scene_d* scene = nullptr;
    ASSERT_OK(raydix_scene_create_d(&scene));
    ASSERT_OK(raydix_scene_add_mesh_d(scene, &mesh.vertices[0].x, mesh.vertices.size(),
                                      mesh.triangles[0].data(), mesh.triangles.size(), RAYDIX_ALL,
                                      nullptr));
    ASSERT_OK(raydix_scene_commit_d(scene, nullptr));
    const SceneD cpp(mesh);
    RandomD random(9);
    std::vector<Vec3d> queries(500);
    for (Vec3d& q : queries)
        q = utm_place + Vec3d{random.between(-5, 5), random.between(-5, 5), random.between(-5, 5)};
    std::vector<raydix_closest_point_d> closest(queries.size());
    ASSERT_OK(
        raydix_closest_points_d(scene, &queries[0].x, queries.size(), closest.data(), nullptr));
    const std::vector<SceneClosestPointD> expected = closest_points(cpp, queries);
    raydix_solid_d* solid = nullptr;
    int closed = 0;
    ASSERT_OK(raydix_solid_create_d(scene, &solid));
    ASSERT_OK(raydix_solid_is_closed_d(solid, &closed));
    EXPECT_EQ(closed, 1);
    std::vector<double> distances(queries.size());
    std::vector<std::uint8_t> inside(queries.size()), inside_cpp(queries.size());
    ASSERT_OK(raydix_signed_distances_d(solid, &queries[0].x, queries.size(), distances.data(), 0));
    ASSERT_OK(raydix_contains_d(solid, &queries[0].x, queries.size(), inside.data(), 0));
    const SolidD cpp_solid(cpp);
    const std::vector<double> distances_cpp = signed_distances(cpp_solid, queries);
    contains(cpp_solid, queries, inside_cpp);
    for (std::size_t i = 0; i < queries.size(); ++i) {
        EXPECT_TRUE(same_bits(closest[i].distance, expected[i].distance));
        EXPECT_TRUE(same_bits(closest[i].position[1], expected[i].position.y));
        EXPECT_TRUE(same_bits(closest[i].v, expected[i].v));
        EXPECT_EQ(closest[i].prim, expected[i].prim);
    }
    EXPECT_EQ(distances, distances_cpp);
    EXPECT_EQ(inside, inside_cpp);
    raydix_solid_destroy_d(solid);
    raydix_scene_destroy_d(scene);
}

TEST(Answers, PointsInDouble) {
    RandomD random(2);
    std::vector<Vec3d> points(3000), queries(200);
    const AabbD box{utm_place, utm_place + Vec3d{1, 1, 1}};
    for (Vec3d& p : points) p = random.in(box);
    for (Vec3d& q : queries) q = random.in(box);
    raydix_points_d* index = nullptr;
    ASSERT_OK(raydix_points_create_d(&points[0].x, points.size(), 0, &index));
    const PointsD cpp = build_points(std::span<const Vec3d>(points));
    const std::uint32_t k = 7;
    std::vector<std::uint32_t> ids(queries.size() * k), ids_cpp(ids);
    std::vector<double> far(ids.size()), far_cpp(ids.size());
    ASSERT_OK(
        raydix_points_knn_d(index, &queries[0].x, queries.size(), k, ids.data(), far.data(), 0));
    knn(cpp, queries, k, ids_cpp, far_cpp);
    EXPECT_EQ(ids, ids_cpp);
    EXPECT_EQ(far, far_cpp);
    ASSERT_OK(raydix_points_knn_within_d(index, &queries[0].x, queries.size(), k, 0.05, ids.data(),
                                         far.data(), 0));
    knn(cpp, queries, k, ids_cpp, far_cpp, {.max_distance = 0.05});
    EXPECT_EQ(ids, ids_cpp);
    EXPECT_EQ(far, far_cpp);
    EXPECT_GT(std::ranges::count(ids, no_primitive), 0);
    raydix_lists_d* lists = nullptr;
    EXPECT_EQ(
        raydix_points_radius_limited_d(index, &queries[0].x, queries.size(), 0.1, 1, 16, 0, &lists),
        RAYDIX_RESULT_TOO_LARGE);
    EXPECT_EQ(lists, nullptr);
    ASSERT_OK(raydix_points_radius_d(index, &queries[0].x, queries.size(), 0.1, 1, 0, &lists));
    PointQueryOptions sorted;
    sorted.sort = true;
    const PointLists<double> expected = radius_search(cpp, queries, 0.1, sorted);
    std::size_t rows = 0;
    const std::uint64_t* offsets = nullptr;
    const std::uint32_t* indices = nullptr;
    const double* distances = nullptr;
    ASSERT_OK(raydix_lists_arrays_d(lists, &rows, &offsets, &indices, &distances));
    ASSERT_EQ(rows, queries.size());
    ASSERT_EQ(offsets[rows], expected.indices.size());
    EXPECT_TRUE(std::equal(indices, indices + offsets[rows], expected.indices.data()));
    EXPECT_TRUE(std::equal(distances, distances + offsets[rows], expected.distances.data()));
    std::vector<std::uint32_t> counts(queries.size());
    ASSERT_OK(raydix_points_count_d(index, &queries[0].x, queries.size(), 0.1, counts.data(), 0));
    for (std::size_t i = 0; i < rows; ++i) EXPECT_EQ(counts[i], offsets[i + 1] - offsets[i]);
    raydix_lists_destroy_d(lists);
    raydix_points_destroy_d(index);
}

}  // namespace raydix::test
