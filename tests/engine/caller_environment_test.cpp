// Whatever the caller's thread does with rounding and denormals: scenes, hits, cameras, rays and
// pictures stay the same.
#include <gtest/gtest.h>
#include <raydix/camera.h>
#include <raydix/closest.h>
#include <raydix/double.h>
#include <raydix/mesh.h>
#include <raydix/model.h>
#include <raydix/picture.h>
#include <raydix/points.h>
#include <raydix/rays.h>
#include <raydix/scene.h>
#include <raydix/scene_queries.h>
#include <raydix/solid.h>
#include <raydix/tree_view.h>

#include <cfenv>
#include <cstdint>
#include <string>
#include <vector>

#include "support/float_control.h"

namespace raydix {
namespace {

/// While it lives, this thread rounds that way.
class Rounding {
public:
    explicit Rounding(int mode) { std::fesetround(mode); }
    ~Rounding() { std::fesetround(before_); }
    Rounding(const Rounding&) = delete;
    Rounding& operator=(const Rounding&) = delete;

private:
    const int before_ = std::fegetround();
};

template <class T>
std::string bytes_of(const std::vector<T>& values) {
    return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}
template <class T>
std::string bytes_of(const T& value) {
    return bytes_of(std::vector<T>{value});
}

/// make() has the same bytes in every environment.
template <class Make>
void expect_same_bytes(const Make& make) {
    const std::string usual = make();
    EXPECT_FALSE(usual.empty());
    for (const int mode : {FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO}) {
        std::string other;
        {
            const Rounding rounding(mode);
            other = make();
            EXPECT_EQ(std::fegetround(), mode);
        }
        EXPECT_TRUE(other == usual) << "rounding " << mode;
    }
#if defined(RAYDIX_FLUSHES_DENORMALS)
    std::string other;
    {
        const test::FlushedDenormals flushed;
        other = make();
    }
    EXPECT_TRUE(other == usual) << "denormals";
#endif
}

template <class Scalar>
BasicMesh<Scalar> mesh_of_figure() {
    const Model figure = load_model("builtin:figure?triangles=5000");
    BasicMesh<Scalar> mesh;
    mesh.triangles = figure.mesh().triangles;
    for (const Vec3 v : figure.mesh().vertices)
        mesh.vertices.push_back({v.x * Scalar(1.1), v.y * Scalar(1.3), v.z * Scalar(0.7)});
    return mesh;
}

RenderOptions small_picture(View view) {
    RenderOptions options;
    options.width = 40;
    options.height = 30;
    options.view = view;
    return options;
}

BasicTransform<double> turned_and_sheared() {
    BasicTransform<double> map;
    for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 4; ++c)
            map.m[r][c] = (r == c ? 2.0 : 0.0) + (7 * r + 3 * c + 1) % 13 / 17.0;
    return map;
}
template <class Scalar>
BasicTransform<Scalar> map_of_instance() {
    BasicTransform<Scalar> map;
    const BasicTransform<double> exact = turned_and_sheared();
    for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 4; ++c) map.m[r][c] = static_cast<Scalar>(exact.m[r][c]);
    return map;
}

template <class Scalar>
class CallerEnvironment : public testing::Test {
protected:
    using Scene = BasicScene<Scalar>;
    using Camera = BasicCamera<Scalar>;

    const BasicMesh<Scalar> mesh = mesh_of_figure<Scalar>();
    const Scene scene = Scene(mesh);
    const Camera camera = fit_camera(scene.bounds(), Scalar(37));
    std::vector<std::uint32_t> pixels;
    const std::vector<BasicRay<Scalar>> rays = make_primary_rays(camera, 40, 30, &pixels);

    /// The hits of rays that see all of it, made in the usual environment.
    static std::string hits_of(const Scene& whole) {
        const Rounding nearest(FE_TONEAREST);
        std::string bytes;
        for (const auto& hit : trace(whole, make_primary_rays(fit_camera(whole.bounds()), 40, 30)))
            bytes += bytes_of(hit.t) + bytes_of(hit.u) + bytes_of(hit.v) + bytes_of(hit.prim);
        return bytes;
    }
};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(CallerEnvironment, Scalars);

TYPED_TEST(CallerEnvironment, LeavesInstances) {
    const auto map = map_of_instance<TypeParam>();
    expect_same_bytes([&] {
        BasicScene<TypeParam> whole;
        whole.add(this->scene, map);
        whole.commit();
        return this->hits_of(whole);
    });
    expect_same_bytes([&] {
        BasicScene<TypeParam> whole;
        const std::uint32_t id = whole.add(this->scene, {});
        whole.set_transform(id, map);
        whole.commit();
        return this->hits_of(whole);
    });
}

TYPED_TEST(CallerEnvironment, LeavesScenesOfModels) {
    Model model = load_model("builtin:figure?triangles=5000");
    model.nodes.emplace_back();
    model.nodes.back().transform = turned_and_sheared();
    model.nodes.back().mesh_count = 1;
    expect_same_bytes([&] { return this->hits_of(BasicScene<TypeParam>(model)); });
}

TYPED_TEST(CallerEnvironment, LeavesCamerasAndRays) {
    expect_same_bytes([&] {
        const auto fitted = fit_camera(this->scene.bounds(), TypeParam(37));
        return bytes_of(fitted.position) + bytes_of(fitted.target);
    });
    expect_same_bytes([&] { return bytes_of(make_primary_rays(this->camera, 40, 30)); });
    const auto hits = trace(this->scene, this->rays);
    expect_same_bytes([&] {
        return bytes_of(make_secondary_rays(this->scene, this->rays, hits, this->pixels,
                                            {.kind = RayKind::diffuse, .samples = 2}));
    });
}

TYPED_TEST(CallerEnvironment, LeavesPictures) {
    for (const View view : {View::depth, View::shaded})
        expect_same_bytes([&] {
            const RenderOptions options = small_picture(view);
            return bytes_of(render(this->scene, this->camera, options).pixels);
        });
}

TYPED_TEST(CallerEnvironment, LeavesWhatIsSaidOfMeshes) {
    BasicMesh<TypeParam> tiny = this->mesh;
    for (auto& v : tiny.vertices)
        v = {v.x * TypeParam(1e-39), v.y * TypeParam(1e-39), v.z * TypeParam(1e-39)};
    expect_same_bytes([&] {
        const auto info = inspect(tiny);
        return bytes_of(info.zero_area_triangles) + bytes_of(info.left_out_triangles) +
               bytes_of(info.bounds);
    });
}

TEST(CallerEnvironmentOfTrees, LeavesPictures) {
    const Mesh mesh = mesh_of_figure<float>();
    const Bvh tree = build_bvh(mesh);
    const Camera camera = fit_camera(tree.bounds());
    const RenderOptions options = small_picture(View::steps);
    expect_same_bytes([&] { return bytes_of(render(tree, camera, options).pixels); });
    const std::vector<LevelBox> boxes = level_boxes(tree, {2, 4});
    expect_same_bytes([&] { return bytes_of(render_tree(tree, camera, boxes, options).pixels); });
    expect_same_bytes(
        [&] { return bytes_of(render_slice(tree, boxes, {.width = 40, .height = 30}).pixels); });
}

/// The squares of these distances are denormal numbers.
TEST(CallerEnvironmentOfQueries, LeavesLimitsOfSmallDistances) {
    Mesh mesh;
    mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.triangles = {{0, 1, 2}};
    const Bvh tree = build_bvh(mesh);
    const Scene scene(mesh);
    const Solid solid(tree);
    const std::vector<Vec3> queries{{0.25f, 0.25f, 3e-21f}};
    constexpr float most = 4e-21f;
    ASSERT_TRUE(closest_point(tree, queries[0], most).found());
    ASSERT_FALSE(closest_point(tree, queries[0], 0.5f * most).found());
    expect_same_bytes([&] { return bytes_of(closest_points(tree, queries, {most})[0].prim); });
    expect_same_bytes([&] { return bytes_of(closest_point(tree, queries[0], most).prim); });
    expect_same_bytes([&] { return bytes_of(closest_points(scene, queries, {most})[0].prim); });
    expect_same_bytes([&] { return bytes_of(closest_point(scene, queries[0], most).prim); });
    expect_same_bytes([&] { return bytes_of(signed_distances(solid, queries, {most})); });
}

template <class Index>
void expect_same_points(double far) {
    using Scalar = typename Index::Scalar;
    const std::vector<typename Index::Point> points{
        {0, 0, 0}, {static_cast<Scalar>(far), 0, 0}, {1, 0, 0}};
    const Index index = build_points(points);
    const auto found = [&](double most) {
        std::uint32_t ids[2];
        Scalar distances[2];
        const std::uint64_t counts[] = {
            knn(index, {points.data(), 1}, 2, {.max_distance = most}).counts.found,
            knn(index, points[0], ids, distances, most),
            radius_count(index, points[0], static_cast<Scalar>(most))};
        return std::vector<std::uint64_t>(counts, counts + 3);
    };
    ASSERT_EQ(found(2 * far), (std::vector<std::uint64_t>{2, 2, 2}));
    ASSERT_EQ(found(0.5 * far), (std::vector<std::uint64_t>{1, 1, 1}));
    expect_same_bytes([&] { return bytes_of(found(2 * far)) + bytes_of(found(0.5 * far)); });
}

TEST(CallerEnvironmentOfPoints, LeavesLimitsOfSmallDistances) {
    expect_same_points<Points>(1e-20);
    expect_same_points<PointsD>(1e-160);
}

}  // namespace
}  // namespace raydix
