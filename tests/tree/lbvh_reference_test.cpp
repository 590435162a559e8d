// build_bvh with each builder of the LBVH family against the recursive reference: every kind of
// input, both code lengths, leaf sizes, fits, threads.
#include <gtest/gtest.h>
#include <raydix/check.h>
#include <raydix/model.h>

#include <algorithm>
#include <functional>
#include <string_view>
#include <tuple>

#include "support/reference_tree.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix::test {
namespace {

using Random = std::mt19937_64;

float unit(Random& random) { return static_cast<float>(random() >> 40) * 0x1p-24f; }

std::vector<Vec3> points_by(std::size_t n, const std::function<Vec3(Random&, std::size_t)>& make) {
    Random random(11);
    std::vector<Vec3> points;
    for (std::size_t i = 0; i < n; ++i) points.push_back(make(random, i));
    return points;
}

Vec3 in_cube(Random& random) { return {unit(random), unit(random), unit(random)}; }

struct Input {
    const char* name;
    std::vector<Vec3> points;
};

std::vector<Input> point_inputs() {
    constexpr std::size_t some = fewer(3000, 6);
    const auto random = points_by(some, [](Random& r, std::size_t) { return in_cube(r); });
    auto sorted = random;
    std::ranges::sort(sorted, {}, [](const Vec3& p) { return p.x; });
    auto reversed = sorted;
    std::ranges::reverse(reversed);
    std::vector<Input> inputs{
        {"none", {}},
        {"random", random},
        {"sorted", sorted},
        {"reversed", reversed},
        {"equal", std::vector<Vec3>(sanitized ? 2'000 : 5'000 * thorough, Vec3{1, 2, 3})},
        {"two values", points_by(some,
                                 [](Random& r, std::size_t) {
                                     return (r() & 1) != 0 ? Vec3{1, 2, 3} : Vec3{-4, 0, 9};
                                 })},
        {"clustered",
         points_by(some,
                   [](Random& r, std::size_t i) {
                       const auto c = static_cast<float>(i % 5);
                       return Vec3{c + 1e-5f * unit(r), 2 * c + 1e-5f * unit(r), 1e-5f * unit(r)};
                   })},
        {"flat", points_by(some,
                           [](Random& r, std::size_t) {
                               return Vec3{unit(r), 7, unit(r)};
                           })},
        {"collinear", points_by(some,
                                [](Random& r, std::size_t) {
                                    return Vec3{0, unit(r), 0};
                                })},
        {"huge",
         points_by(some,
                   [](Random& r, std::size_t) {
                       return Vec3{2e12f * unit(r) - 1e12f, 1e12f * unit(r), -1e12f * unit(r)};
                   })},
        {"tiny", points_by(some,
                           [](Random& r, std::size_t) {
                               return Vec3{1e-30f * unit(r), 1e-38f * unit(r), -1e-44f * unit(r)};
                           })},
        {"denormal", points_by(300,
                               [](Random& r, std::size_t) {
                                   return Vec3{1e-44f * unit(r), 0, -1e-43f * unit(r)};
                               })},
        {"GPS", points_by(some,
                          [](Random& r, std::size_t) {
                              return Vec3{5e6f + 30 * unit(r), 4e5f + 30 * unit(r), 30 * unit(r)};
                          })},
        {"grid", points_by(4096,
                           [](Random&, std::size_t i) {
                               return Vec3{static_cast<float>(i % 16),
                                           static_cast<float>(i / 16 % 16),
                                           static_cast<float>(i / 256)};
                           })},
        {"invalid among them", points_by(500,
                                         [](Random& r, std::size_t i) {
                                             return i % 7 == 0    ? Vec3{infinity, 0, 0}
                                                    : i % 11 == 0 ? Vec3{0, 2e12f, 0}
                                                                  : in_cube(r);
                                         })},
        {"all invalid", std::vector<Vec3>(5, Vec3{0, -infinity, 0})},
    };
    for (const std::size_t n : {1u, 2u, 3u, 5u})
        inputs.push_back({"few", points_by(n, [](Random& r, std::size_t) { return in_cube(r); })});
    return inputs;
}

class LbvhReference : public ::testing::TestWithParam<Builder> {
protected:
    [[nodiscard]] BuildOptions options(int bits, int max_leaf) const {
        return {.builder = GetParam(), .bits = bits, .max_leaf = max_leaf};
    }
};

/// Each fit, and enough threads to meet each other.
struct Way {
    int threads;
    Fit fit;
};
constexpr Way ways[] = {
    {1, Fit::as_published}, {2, Fit::levels}, {7, Fit::atomic}, {7, Fit::levels}};

/// Every option against the reference. `build` and `reference` take options.
template <class Build, class Reference>
void compare_all(Builder builder, const std::string& name, const Build& build,
                 const Reference& reference) {
    for (const int bits : {30, 63}) {
        for (const int max_leaf : {1, 2, 4, 8, 255}) {
            if (thorough == 1 && (max_leaf == 2 || max_leaf == 8)) continue;
            BuildOptions options{.builder = builder, .bits = bits, .max_leaf = max_leaf};
            const Bvh expected = reference(options);
            const std::string hash = tree_hash(expected);
            for (const auto [threads, fit] : ways) {
                options.threads = threads;
                options.fit = fit;
                SCOPED_TRACE(name + ", bits " + std::to_string(bits) + ", max_leaf " +
                             std::to_string(max_leaf) + ", threads " + std::to_string(threads) +
                             ", fit " + std::to_string(static_cast<int>(fit)));
                const Bvh built = build(options);
                EXPECT_EQ(check_same(built, expected).broken, "");
                EXPECT_EQ(tree_hash(built), hash);
                EXPECT_EQ(check(built).broken, "");
                EXPECT_EQ(built.left_out(), expected.left_out());
            }
        }
    }
}

TEST_P(LbvhReference, Points) {
    for (const Input& input : point_inputs()) {
        const std::span<const Vec3> points = input.points;
        compare_all(
            GetParam(), input.name, [&](const BuildOptions& o) { return build_bvh(points, o); },
            [&](const BuildOptions& o) { return reference_tree(points, o); });
    }
}

TEST_P(LbvhReference, Boxes) {
    Random random(5);
    std::vector<Aabb> boxes;
    for (int i = 0; i < 2000; ++i) {
        const Vec3 lo = in_cube(random);
        boxes.push_back({lo, {lo.x + 0.1f * unit(random), lo.y + 0.1f * unit(random), lo.z}});
    }
    boxes[17] = {{1, 1, 1}, {0, 2, 2}};  // inverted
    boxes[18].hi.y = std::numeric_limits<float>::quiet_NaN();
    boxes[19] = {{-0.0f, -0.0f, -0.0f}, {-0.0f, 0.0f, 0.5f}};
    compare_all(
        GetParam(), "boxes",
        [&](const BuildOptions& o) { return build_bvh(std::span<const Aabb>(boxes), o); },
        [&](const BuildOptions& o) { return reference_tree(std::span<const Aabb>(boxes), o); });
}

TEST_P(LbvhReference, Triangles) {
    Mesh mesh = random_soup(2500, 3);
    mesh.triangles[9] = {0, 0, 0};
    mesh.vertices[300].y = std::numeric_limits<float>::quiet_NaN();
    mesh.vertices[600] = {-0.0f, 0.25f, -0.0f};
    for (const std::size_t n : {1u, 2u, 3u, 5u, 2500u}) {
        const Mesh part{"part",
                        mesh.vertices,
                        {mesh.triangles.begin(), mesh.triangles.begin() + std::ptrdiff_t(n)}};
        compare_all(
            GetParam(), std::to_string(n) + " triangles",
            [&](const BuildOptions& o) {
                Bvh built = build_bvh(part, o);
                EXPECT_EQ(check(built, part).broken, "");
                return built;
            },
            [&](const BuildOptions& o) { return reference_tree(MeshView(part), o); });
    }
}

TEST_P(LbvhReference, LargerInputsAreTheSameForEveryThreadCountAndFit) {
    Random random(13);
    const std::size_t n = sanitized ? 2000 : 5000 * thorough;
    std::vector<Vec3> line;
    for (std::size_t i = 0; i < n; ++i) line.push_back({3, static_cast<float>(i), -7});
    std::ranges::shuffle(line, random);
    const std::vector<Vec3> equal(10 * n, Vec3{-1, 2, 3});
    const Mesh soup = random_soup(2 * n, 8, 0.01f);
    const auto expect = [&](const char* name, const auto& input) {
        for (const int max_leaf : {1, 4}) {
            BuildOptions build = options(63, max_leaf);
            const Bvh expected = reference_tree(input, build);
            const std::string hash = tree_hash(expected);
            for (const auto [threads, fit] : ways) {
                build.threads = threads;
                build.fit = fit;
                const Bvh built = build_bvh(input, build);
                EXPECT_EQ(tree_hash(built), hash) << name << ", threads " << threads;
                EXPECT_EQ(built.max_depth(), expected.max_depth()) << name;
            }
        }
    };
    expect("on a line", std::span<const Vec3>(line));
    expect("equal", std::span<const Vec3>(equal));
    expect("soup", MeshView(soup));
}

TEST_P(LbvhReference, RebuildsInPlace) {
    const Mesh large = random_soup(3000, 1), small = random_soup(40, 2);
    BvhBuilder builder;
    Bvh tree;
    for (const Mesh* mesh : {&large, &small, &large}) {
        for (const Fit fit : {Fit::levels, Fit::atomic}) {
            BuildOptions build = options(63, 4);
            build.fit = fit;
            builder.build(*mesh, build, tree);
            EXPECT_EQ(tree_hash(tree), tree_hash(reference_tree(MeshView(*mesh), build)));
            EXPECT_EQ(check(tree, *mesh).broken, "");
        }
    }
}

std::string builder_test_name(const ::testing::TestParamInfo<Builder>& info) {
    return std::string(builder_name(info.param));
}
INSTANTIATE_TEST_SUITE_P(All, LbvhReference,
                         ::testing::Values(Builder::karras, Builder::lauterbach, Builder::garanzha,
                                           Builder::apetrei),
                         builder_test_name);

class LbvhReferenceScene : public ::testing::TestWithParam<std::tuple<Builder, std::string_view>> {
};

TEST_P(LbvhReferenceScene, IsTheSame) {
    const auto& [builder, scene] = GetParam();
    const auto file = shared_scene(std::string(scene));
    RAYDIX_SKIP_WITHOUT(file);
    const Mesh mesh = load_mesh(file);
    ASSERT_FALSE(mesh.vertices.empty());
    for (const int bits : {30, 63}) {
        if (thorough == 1 && bits == 30) continue;
        const BuildOptions options{.builder = builder, .bits = bits};
        const Bvh built = build_bvh(mesh, options);
        EXPECT_EQ(check_same(built, reference_tree(MeshView(mesh), options)).broken, "");
        EXPECT_EQ(check(built, mesh).broken, "");
        EXPECT_GT(built.order().size(), 1000u);
    }
}

std::string scene_test_name(
    const ::testing::TestParamInfo<std::tuple<Builder, std::string_view>>& info) {
    const auto& [builder, scene] = info.param;
    std::string name(builder_name(builder));
    name += '_';
    name += scene.substr(0, scene.find('.'));
    std::ranges::replace(name, '/', '_');
    return name;
}
INSTANTIATE_TEST_SUITE_P(
    Shared, LbvhReferenceScene,
    ::testing::Combine(::testing::Values(Builder::karras, Builder::lauterbach, Builder::garanzha,
                                         Builder::apetrei),
                       ::testing::Values("bunny/bunny.ply.xz", "sibenik/sibenik.ply.xz",
                                         "conference/conference.ply.xz",
                                         "kitti_frame/kitti_frame.ply.xz",
                                         "nasty/pcl_organized_nan_640x480.ply.xz",
                                         "nasty/isprs_samp12_utm_float32.ply.xz")),
    scene_test_name);

}  // namespace
}  // namespace raydix::test
