// Pictures by all ranks against the picture of one process, bit for bit.
#include <raydix/picture.h>

#include <stdexcept>

#include "mpi/ranks.h"

namespace raydix::mpi::test {
namespace {

template <class T>
using CameraOf = std::conditional_t<sizeof(T) == 4, Camera, CameraD>;

/// A floor with a heap of bent triangles on it, far from the origin where floats are coarse.
template <class T>
BasicMesh<T> make_heap(T away) {
    BasicMesh<T> mesh;
    std::mt19937 random(3);
    std::uniform_real_distribution<T> unit(0, 1);
    const auto add = [&](T x, T y, T z) {
        mesh.vertices.push_back({away + x, y, z});
        return static_cast<std::uint32_t>(mesh.vertices.size() - 1);
    };
    for (int i = 0; i < 300; ++i) {
        const T x = unit(random) * 4, y = unit(random) * 2, z = unit(random) * 4;
        const auto near = [&] {
            return add(x + unit(random) / 2, y + unit(random) / 2, z + unit(random) / 2);
        };
        const std::uint32_t a = near(), b = near(), c = near();
        mesh.triangles.push_back({a, b, c});
    }
    const std::uint32_t a = add(-1, 0, -1), b = add(5, 0, -1), c = add(5, 0, 5), d = add(-1, 0, 5);
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
    return mesh;
}

template <class T>
CameraOf<T> camera_at(T away) {
    CameraOf<T> camera;
    camera.position = {away + T(2), T(3), T(9)};
    camera.target = {away + T(2), T(0.5), T(2)};
    return camera;
}

bool same_picture(const Picture& found, const Picture& expected) {
    if (rank() != 0) return found.width == 0 && found.pixels.empty();
    return found.width == expected.width && found.height == expected.height &&
           same_bits(found.pixels, expected.pixels);
}

RenderOptions small_picture(View view) {
    RenderOptions options;
    options.view = view;
    options.width = 37;
    options.height = 23;
    options.samples = 5;
    options.threads = 1;
    return options;
}

constexpr View views[] = {View::shaded, View::normal,  View::depth, View::primitive,
                          View::ao,     View::diffuse, View::path};

template <class T>
class PicturesOverRanks : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(PicturesOverRanks, Scalars);

TYPED_TEST(PicturesOverRanks, AreThoseOfOneProcess) {
    using T = TypeParam;
    using Part = BasicMeshView<T>;
    const T away = sizeof(T) == 4 ? T(100) : T(1e7);
    const auto mesh = make_heap<T>(away);
    const auto camera = camera_at<T>(away);
    const BasicScene<T> one(mesh);
    const auto begins = division_of(mesh.triangles.size(), Division::some_empty, 4);
    const Part part(mesh.vertices, mine(mesh.triangles, begins));
    SceneOptions of_scene;
    of_scene.one_geometry = true;
    of_scene.threads = 1;
    const BasicDistributedScene<T> many(MPI_COMM_WORLD, std::span<const Part>(&part, 1), of_scene);
    for (const View view : views) {
        SCOPED_TRACE(view_name(view));
        const RenderOptions options = small_picture(view);
        const Picture expected = raydix::render(one, camera, options);
        EXPECT_TRUE(same_picture(render(MPI_COMM_WORLD, one, camera, options), expected));
        EXPECT_TRUE(same_picture(render(many, camera, options), expected));
    }
}

/// Normals of shapes need the rays, which are on another rank.
TYPED_TEST(PicturesOverRanks, OfSpheresAreThoseOfOneProcess) {
    using T = TypeParam;
    const T away = sizeof(T) == 4 ? T(100) : T(1e7);
    const std::vector<BasicSphere<T>> spheres{{{away + T(1), 1, 2}, 1}, {{away + T(3), 1, 2}, 1}};
    BasicScene<T> one;
    std::vector<BasicDistributedGeometry<T>> own(spheres.size());
    for (std::size_t i = 0; i < spheres.size(); ++i) {
        const auto part = std::span(spheres).subspan(i, 1);
        one.add(part);
        if (rank() == static_cast<int>(i) % ranks()) own[i].spheres = part;
    }
    one.commit();
    const BasicDistributedScene<T> many(MPI_COMM_WORLD,
                                        std::span<const BasicDistributedGeometry<T>>(own));
    for (const View view : {View::normal, View::shaded}) {
        const RenderOptions options = small_picture(view);
        EXPECT_TRUE(same_picture(render(many, camera_at<T>(away), options),
                                 raydix::render(one, camera_at<T>(away), options)));
    }
}

TEST(PicturesOverRanks, OfNothingAreThoseOfOneProcess) {
    const Scene one{Mesh()};
    const DistributedScene many(MPI_COMM_WORLD, std::span<const MeshView>());
    for (const View view : {View::shaded, View::depth}) {
        const RenderOptions options = small_picture(view);
        const Picture expected = raydix::render(one, Camera(), options);
        EXPECT_TRUE(same_picture(render(MPI_COMM_WORLD, one, Camera(), options), expected));
        EXPECT_TRUE(same_picture(render(many, Camera(), options), expected));
    }
}

TEST(PicturesOverRanks, StepsAreCountedWhereEachRankHasAll) {
    const Mesh mesh = make_heap<float>(0);
    const Scene one(mesh);
    const Camera camera = camera_at<float>(0);
    const RenderOptions options = small_picture(View::steps);
    EXPECT_TRUE(same_picture(render(MPI_COMM_WORLD, one, camera, options),
                             raydix::render(one, camera, options)));
    const DistributedScene many(MPI_COMM_WORLD, std::span<const MeshView>());
    EXPECT_THROW((void)render(many, camera, options), InputError);
}

/// What the progress of `options` throws on rank 0 in the middle comes out of `call` on all ranks.
template <class Call>
void expect_stopped(RenderOptions options, const Call& call) {
    options.progress = [](double part) {
        if (part > 0) throw std::runtime_error("stopped");
    };
    try {
        call(options);
        ADD_FAILURE() << "nothing was thrown";
    } catch (const std::runtime_error& error) {
        EXPECT_STREQ(error.what(), "rank 0: stopped");
    }
}

TEST(PicturesOverRanks, WhatARankThrowsIsThrownOnAll) {
    const Mesh mesh = make_heap<float>(0);
    const Camera camera = camera_at<float>(0);
    const Scene one(mesh);
    const MeshView whole(mesh);
    const DistributedScene many(MPI_COMM_WORLD, std::span(&whole, rank() == 0 ? 1 : 0));
    RenderOptions options = small_picture(View::shaded);
    options.width = 500;  // more than one step of eight ranks
    options.height = 400;
    expect_stopped(options, [&](const RenderOptions& stopping) {
        (void)render(MPI_COMM_WORLD, one, camera, stopping);
    });
    expect_stopped(options,
                   [&](const RenderOptions& stopping) { (void)render(many, camera, stopping); });
    options = small_picture(View::normal);
    if (rank() == ranks() - 1) options.samples = -1;
    const auto expect_refused = [&](const auto& call) {
        try {
            call();
            ADD_FAILURE() << "nothing was thrown";
        } catch (const InputError& error) {
            EXPECT_EQ(std::string(error.what()).find("rank " + std::to_string(ranks() - 1) + ": "),
                      0u)
                << error.what();
        }
    };
    expect_refused([&] { (void)render(MPI_COMM_WORLD, one, camera, options); });
    expect_refused([&] { (void)render(many, camera, options); });
    // The communicators still work.
    options.samples = 0;
    EXPECT_NO_THROW((void)render(many, camera, options));
}

TEST(PicturesOverRanks, RanksThatDifferAreFound) {
    if (ranks() == 1) GTEST_SKIP() << "one rank differs from nobody";
    const Scene one(make_heap<float>(rank() == 0 ? 0.0f : 1.0f));
    EXPECT_THROW((void)render(MPI_COMM_WORLD, one, Camera(), small_picture(View::normal)),
                 InputError);
    const DistributedScene many(MPI_COMM_WORLD, std::span<const MeshView>());
    RenderOptions options = small_picture(View::normal);
    options.width += rank() == 0;
    EXPECT_THROW((void)render(many, Camera(), options), InputError);
}

}  // namespace
}  // namespace raydix::mpi::test
