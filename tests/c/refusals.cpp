// What the C interface refuses: results stay as they were, and counts that no array can have are
// not followed. Files of scenes: which names and contents it takes.
#include <gtest/gtest.h>
#include <raydix/raydix.h>
#include <raydix/rdx.h>
#include <raydix_c.h>
#include <raydix_c_double.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {

namespace {

constexpr std::array<float, 9> corners{0, 0, 0, 1, 0, 0, 0, 1, 0};
constexpr std::array<std::uint32_t, 3> indices{0, 1, 2};

int no_hit(void*, std::uint32_t, const raydix_ray*, raydix_hit*) { return 0; }

void expect_refused(raydix_status status, const std::string& text) {
    EXPECT_EQ(status, RAYDIX_INPUT_ERROR);
    EXPECT_NE(std::string(raydix_last_error()).find(text), std::string::npos)
        << "expected: " << text << "\ntold: " << raydix_last_error();
}

/// A committed scene: geometry 0 a triangle, geometry 1 user geometry.
class Refusals : public testing::Test {
protected:
    void SetUp() override {
        constexpr std::array<float, 6> box{2, 2, 2, 3, 3, 3};
        ASSERT_EQ(raydix_scene_create(&scene), RAYDIX_OK);
        ASSERT_EQ(
            raydix_scene_add_mesh(scene, corners.data(), 3, indices.data(), 1, RAYDIX_ALL, nullptr),
            RAYDIX_OK);
        ASSERT_EQ(raydix_scene_add_user(scene, box.data(), 1, no_hit, nullptr, RAYDIX_ALL, nullptr),
                  RAYDIX_OK);
        ASSERT_EQ(raydix_scene_commit(scene, nullptr), RAYDIX_OK);
    }
    ~Refusals() override { raydix_scene_destroy(scene); }

    raydix_scene* scene = nullptr;
    const raydix_ray ray{{0.2f, 0.2f, 1}, 0, {0, 0, -1}, INFINITY};
};

TEST_F(Refusals, ResultsStayAsTheyWere) {
    const raydix_hit good{1, 0, 0.2f, 0.2f, 0, 0}, of_user{1, 0, 0, 0, 1, 0};
    const std::vector<raydix_ray> rays(3, ray);
    for (const raydix_hit bad : {raydix_hit{1, 7, 0, 0, 0, 0}, raydix_hit{1, 0, 0, 0, 9, 0},
                                 raydix_hit{1, 0, 0, 0, 0, 5}}) {
        const std::vector<raydix_hit> hits{good, good, bad};
        std::vector<float> results(9, 42);
        expect_refused(raydix_hit_positions(scene, rays.data(), hits.data(), 3, results.data(), 0),
                       "hit 2");
        EXPECT_EQ(results, std::vector<float>(9, 42));
        expect_refused(raydix_hit_normals(scene, rays.data(), hits.data(), 3, results.data(), 0),
                       "hit 2");
        EXPECT_EQ(results, std::vector<float>(9, 42));
    }
    const std::vector<raydix_hit> hits{good, of_user, good};
    std::vector<float> results(9, 42);
    expect_refused(raydix_hit_normals(scene, rays.data(), hits.data(), 3, results.data(), 0),
                   "normals: hit 1: geometry 1 (user geometry) has no normals");
    EXPECT_EQ(results, std::vector<float>(9, 42));
    EXPECT_EQ(raydix_hit_positions(scene, rays.data(), hits.data(), 3, results.data(), 0),
              RAYDIX_OK);
}

TEST_F(Refusals, CountsThatNoArrayHas) {
    const float* const numbers = corners.data();
    std::uint32_t id = 99, size = 0;
    for (const std::size_t count :
         {std::size_t{1} << 60, std::size_t{1} << 61, SIZE_MAX / 24 + 1, SIZE_MAX}) {
        expect_refused(raydix_scene_add_spheres(scene, numbers, count, RAYDIX_ALL, &id),
                       "spheres: ");
        expect_refused(raydix_scene_add_capsules(scene, numbers, count, RAYDIX_ALL, &id),
                       "capsules: ");
        expect_refused(raydix_scene_add_points(scene, numbers, count, 1, RAYDIX_ALL, &id),
                       "points: ");
        expect_refused(
            raydix_scene_add_user(scene, numbers, count, no_hit, nullptr, RAYDIX_ALL, &id),
            "boxes: ");
        expect_refused(
            raydix_scene_add_mesh(scene, numbers, count, indices.data(), 1, RAYDIX_ALL, &id),
            "vertices: ");
        expect_refused(
            raydix_scene_add_mesh(scene, numbers, 3, indices.data(), count, RAYDIX_ALL, &id),
            "triangles: ");
        raydix_points* index = nullptr;
        expect_refused(raydix_points_create(numbers, count, 0, &index), "points: ");
    }
    expect_refused(
        raydix_scene_add_capsules(scene, numbers, SIZE_MAX / 28 + 1, RAYDIX_ALL, nullptr),
        "capsules: ");
    EXPECT_EQ(id, 99u);
    ASSERT_EQ(raydix_scene_size(scene, &size), RAYDIX_OK);
    EXPECT_EQ(size, 2u);
}

TEST_F(Refusals, MorePrimitivesThanAGeometryHolds) {
    const float* const numbers = corners.data();
    constexpr std::size_t count = std::size_t{1} << 31;
    const std::string most = "2147483648 primitives; a geometry holds at most 2147483647";
    expect_refused(raydix_scene_add_spheres(scene, numbers, count, RAYDIX_ALL, nullptr), most);
    expect_refused(raydix_scene_add_capsules(scene, numbers, count, RAYDIX_ALL, nullptr), most);
    expect_refused(raydix_scene_add_points(scene, numbers, count, 1, RAYDIX_ALL, nullptr), most);
    expect_refused(
        raydix_scene_add_user(scene, numbers, count, no_hit, nullptr, RAYDIX_ALL, nullptr), most);
    expect_refused(
        raydix_scene_add_mesh(scene, numbers, 3, indices.data(), count, RAYDIX_ALL, nullptr),
        "geometry 2: 2147483648 triangles");
    expect_refused(raydix_scene_update_mesh(scene, 0, numbers, 3, indices.data(), count),
                   "geometry 0: 2147483648 triangles");
    expect_refused(
        raydix_scene_update_mesh(scene, 0, numbers, std::size_t{1} << 32, indices.data(), 1),
        "geometry 0: 4294967296 vertices");
}

TEST_F(Refusals, OptionsOutOfRangeOfOneRayToo) {
    raydix_hit hit{};
    std::uint8_t occluded = 42;
    raydix_trace_options options = RAYDIX_TRACE_OPTIONS;
    for (const int threads : {-1, 1025}) {
        options.threads = threads;
        const std::string text = "threads is " + std::to_string(threads);
        expect_refused(raydix_trace_closest(scene, &ray, 1, &hit, &options), text);
        expect_refused(raydix_trace_any(scene, &ray, 1, &occluded, &options), text);
    }
    EXPECT_EQ(occluded, 42);
    raydix_commit_options commit = RAYDIX_COMMIT_OPTIONS;
    commit.reserved = 1;
    expect_refused(raydix_scene_commit(scene, &commit), "reserved of the options is 1");
    raydix_closest_options near = RAYDIX_CLOSEST_OPTIONS;
    near.reserved = 1;
    raydix_closest_point point{};
    expect_refused(raydix_closest_points(scene, corners.data(), 1, &point, &near),
                   "reserved of the options is 1");
}

TEST(Files, NamesOfScenes) {
    const TempFolder folder;
    const auto path = [&](const char* name) { return (folder.path() / name).string(); };
    raydix_scene *scene = nullptr, *loaded = nullptr;
    ASSERT_EQ(raydix_scene_create(&scene), RAYDIX_OK);
    ASSERT_EQ(raydix_scene_commit(scene, nullptr), RAYDIX_OK);
    for (const char* name : {"a", "a.ply", "rdx", ""})
        expect_refused(raydix_scene_save(scene, path(name).c_str()), "must end in .rdx");
    for (const char* name : {"a.rdx", "A.RDX"}) {
        EXPECT_EQ(raydix_scene_save(scene, path(name).c_str()), RAYDIX_OK) << raydix_last_error();
        EXPECT_EQ(raydix_scene_load(path(name).c_str(), nullptr, &loaded), RAYDIX_OK)
            << raydix_last_error();
        raydix_scene_destroy(loaded);
        raydix_scene_d* none = nullptr;
        expect_refused(raydix_scene_load_d(path(name).c_str(), nullptr, &none),
                       "holds a scene in float, which raydix_scene_load reads");
    }
    raydix_scene_destroy(scene);
}

TEST(Files, TheMeshOfATree) {
    const TempFolder folder;
    const std::string file = (folder.path() / "tree.rdx").string();
    Model model;
    model.meshes = {random_soup(500, 4)};
    save_rdx(file, build_bvh(model.mesh()), model);
    const Scene expected(model.mesh());
    const Triangle& first = model.mesh().triangles[0];
    float x = 0, y = 0;  // of its middle
    for (const std::uint32_t corner : first) {
        x += model.mesh().vertices[corner].x / 3;
        y += model.mesh().vertices[corner].y / 3;
    }
    const raydix_ray ray{{x, y, 3}, 0, {0, 0, -1}, INFINITY};
    const Hit hit = closest_hit(expected, Ray{{x, y, 3}, 0, {0, 0, -1}, infinity});
    ASSERT_TRUE(hit.hit());
    raydix_scene* scene = nullptr;
    ASSERT_EQ(raydix_scene_load(file.c_str(), nullptr, &scene), RAYDIX_OK) << raydix_last_error();
    raydix_hit found{};
    ASSERT_EQ(raydix_trace_closest(scene, &ray, 1, &found, nullptr), RAYDIX_OK);
    EXPECT_EQ(found.t, hit.t);
    EXPECT_EQ(found.prim, hit.prim);
    raydix_scene_destroy(scene);
    raydix_scene_d* in_double = nullptr;
    EXPECT_EQ(raydix_scene_load_d(file.c_str(), nullptr, &in_double), RAYDIX_OK)
        << raydix_last_error();
    raydix_scene_destroy_d(in_double);
}

}  // namespace

}  // namespace raydix::test
