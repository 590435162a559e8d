// Builders sweep, split and sbvh: sweep against its definition, and what holds for all three.
#include <gtest/gtest.h>
#include <raydix/check.h>
#include <raydix/error.h>
#include <raydix/model.h>
#include <raydix/rdx.h>
#include <raydix/trace.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <set>

#include "base/math.h"
#include "support/ray_sets.h"
#include "support/scenes.h"
#include "tree/bvh_internals.h"
#include "tree/cluster_cases.h"
#include "tree/sah_reference.h"
#include "tree/validate_cover.h"
#include "tree/walk.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t sah_seed = 20090801;

BuildOptions options_of(Builder builder, int max_leaf = 4, int threads = 0) {
    BuildOptions options;
    options.builder = builder;
    options.max_leaf = max_leaf;
    options.threads = threads;
    return options;
}

/// Long thin triangles along the diagonals of the cube, with small ones between them: boxes of
/// almost nothing but air.
Model sticks(std::size_t count) {
    Mesh mesh = random_soup(count, sah_seed, 0.02f);
    std::mt19937_64 random(sah_seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    for (std::size_t i = 0; i < count / 4; ++i) {
        const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
        const Vec3 a{0.3f * unit(), 0.3f * unit(), 0.3f * unit()};
        const Vec3 b{0.7f + 0.3f * unit(), 0.7f + 0.3f * unit(), 0.7f + 0.3f * unit()};
        for (const Vec3& p : {a, b, b + Vec3{0.01f, -0.01f, 0}}) mesh.vertices.push_back(p);
        mesh.triangles.push_back({first, first + 1, first + 2});
    }
    return scene_of(std::move(mesh), "sticks");
}

/// A node as the hash sees it.
struct PlainNode {
    Aabb box;
    std::vector<std::uint32_t> ids;  // of a leaf

    bool operator==(const PlainNode& o) const {
        return std::memcmp(&box, &o.box, sizeof(box)) == 0 && ids == o.ids;
    }
};

std::vector<PlainNode> preorder_of(const Bvh& bvh) {
    std::vector<PlainNode> all;
    walk_preorder(bvh.nodes(), bvh.max_depth(), [&](std::uint32_t i) {
        const BvhNode& node = bvh.nodes()[i];
        PlainNode plain{{node.lo, node.hi}, {}};
        if (node.is_leaf()) {
            const auto ids = bvh.order().subspan(node.first, node.count);
            plain.ids.assign(ids.begin(), ids.end());
        }
        all.push_back(plain);
    });
    return all;
}

/// docs/algorithms/sweep.md, word by word: all splits of a node by trying them.
class ReferenceSweep {
public:
    ReferenceSweep(std::span<const Aabb> boxes, std::uint32_t max_leaf)
        : boxes_(boxes), max_leaf_(max_leaf) {}

    std::vector<PlainNode> run(std::vector<std::uint32_t> ids) {
        if (!ids.empty()) static_cast<void>(build(std::move(ids), 0));
        return nodes_;
    }

private:
    using Ids = std::vector<std::uint32_t>;

    Aabb box_of(const Ids& ids) const {
        Aabb box = empty_box();
        for (const std::uint32_t id : ids) box = unite(box, boxes_[id]);
        return box;
    }
    Ids sorted(Ids ids, std::size_t axis) const {
        const auto key = [&](std::uint32_t id) {
            return (&boxes_[id].lo.x)[axis] + (&boxes_[id].hi.x)[axis];
        };
        std::sort(ids.begin(), ids.end(), [&](std::uint32_t a, std::uint32_t b) {
            return key(a) != key(b) ? key(a) < key(b) : a < b;
        });
        return ids;
    }

    std::pair<Ids, Ids> divide(const Ids& ids, int depth) const {
        float least = infinity;
        std::size_t evenness = 0;
        std::pair<Ids, Ids> best;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const Ids order = sorted(ids, axis);
            for (std::size_t left = 1; left < ids.size(); ++left) {
                if (depth >= 96 && (axis != 0 || left != ids.size() / 2)) continue;
                const auto middle = order.begin() + static_cast<std::ptrdiff_t>(left);
                const Ids a(order.begin(), middle), b(middle, order.end());
                const float cost = sah_area(box_of(a)) * static_cast<float>(a.size()) +
                                   sah_area(box_of(b)) * static_cast<float>(b.size());
                const std::size_t even = std::min(a.size(), b.size());
                if (cost > least || (cost == least && even <= evenness)) continue;
                least = cost;
                evenness = even;
                best = {a, b};
            }
        }
        return best;
    }

    float build(Ids ids, int depth) {
        const std::size_t at = nodes_.size();
        const Aabb box = box_of(ids);
        nodes_.push_back({box, {}});
        const float area = sah_area(box);
        float cost = area * static_cast<float>(ids.size());
        if (ids.size() > 1) {
            auto [a, b] = divide(ids, depth);
            if (*std::ranges::min_element(b) < *std::ranges::min_element(a)) std::swap(a, b);
            const float cost_a = build(a, depth + 1), cost_b = build(b, depth + 1);
            const float divided = area + (cost_a + cost_b);
            if (ids.size() > max_leaf_ || divided < cost) return divided;
        }
        nodes_.resize(at + 1);
        std::sort(ids.begin(), ids.end());
        nodes_[at].ids = ids;
        return cost;
    }

    std::span<const Aabb> boxes_;
    std::size_t max_leaf_;
    std::vector<PlainNode> nodes_;
};

TEST(Sweep, GivesTheTreeOfTheDefinition) {
    for (const BoxInput& input : cluster_inputs(sah_seed)) {
        if (input.boxes.size() > 130) continue;
        for (const int max_leaf : {1, 4, 255}) {
            SCOPED_TRACE(input.name + ", max_leaf " + std::to_string(max_leaf));
            const Bvh tree = build_bvh(input.boxes, options_of(Builder::sweep, max_leaf));
            const CheckReport valid = check(tree);
            ASSERT_TRUE(valid.ok) << valid.broken;
            std::vector<std::uint32_t> ids(tree.order().begin(), tree.order().end());
            ReferenceSweep reference(input.boxes, static_cast<std::uint32_t>(max_leaf));
            ASSERT_EQ(preorder_of(tree), reference.run(ids));
        }
    }
}

TEST(Sweep, IsNoWorseThanBinned) {
    for (const Model& scene : builtin_triangle_scenes(thorough * 2000)) {
        const auto sah = [&](Builder builder) {
            return *tree_stats(build_bvh(scene.mesh(), options_of(builder))).sah;
        };
        EXPECT_LE(sah(Builder::sweep), 1.005 * sah(Builder::binned)) << scene.name;
    }
}

class SahTrees : public testing::TestWithParam<Builder> {
protected:
    [[nodiscard]] static BuildOptions options(int max_leaf = 4, int threads = 0) {
        return options_of(GetParam(), max_leaf, threads);
    }
};

TEST_P(SahTrees, TakeBoxesThatBuildersGetWrong) {
    for (const BoxInput& input : cluster_inputs(sah_seed))
        for (const int max_leaf : {1, 4, 255}) {
            SCOPED_TRACE(input.name);
            const Bvh tree = build_bvh(input.boxes, options(max_leaf));
            const CheckReport valid = check(tree);
            ASSERT_TRUE(valid.ok) << valid.broken;
            EXPECT_LE(tree.max_depth(), 96u + 31u);
            // Over boxes all three are `sweep`.
            const Bvh sweep = build_bvh(input.boxes, options_of(Builder::sweep, max_leaf));
            EXPECT_EQ(tree_hash(tree), tree_hash(sweep));
        }
}

/// On a line nothing has a surface, so nothing costs anything.
TEST_P(SahTrees, ALeafThatCostsAsMuchAsItsSubtreeIsTaken) {
    Mesh mesh;
    for (std::uint32_t i = 0; i < 4; ++i) {
        const auto x = static_cast<float>(i);
        for (const float step : {0.0f, 0.5f, 0.7f}) mesh.vertices.push_back({x + step, 0, 0});
        mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    const Bvh tree = build_bvh(mesh, {.builder = GetParam(), .max_leaf = 4});
    EXPECT_EQ(tree.inner_count(), 0u);
    EXPECT_EQ(tree.nodes()[0].count, 4u);
}

TEST_P(SahTrees, DoNotDependOnThreads) {
    std::vector<Model> scenes = builtin_triangle_scenes(thorough * 1000);
    scenes.push_back(sticks(thorough * 1000));
    for (const Model& scene : scenes) {
        const std::string one = tree_hash(build_bvh(scene.mesh(), options(4, 1)));
        for (const int threads : {2, 7})
            EXPECT_EQ(tree_hash(build_bvh(scene.mesh(), options(4, threads))), one)
                << scene.name << ", " << threads << " threads";
    }
}

TEST_P(SahTrees, RebuildingIntoKeptMemoryGivesTheSameTree) {
    BvhBuilder builder;
    Bvh tree;
    for (const std::size_t n : {3000, 40, 4, 20'000, 8}) {
        const Mesh mesh = sticks(n).mesh();
        builder.build(mesh, options(), tree);
        const CheckReport same = check_same(tree, build_bvh(mesh, options()));
        EXPECT_TRUE(same.ok) << n << " triangles: " << same.broken;
    }
}

TEST_P(SahTrees, HitsAreThoseOfBruteForce) {
    std::vector<Model> scenes = builtin_triangle_scenes(2000);
    scenes.push_back(sticks(2000));
    scenes.push_back(scene_of(lattice_mesh(500, 6, sah_seed), "lattice"));
    scenes.push_back(scene_of(moved(sticks(500).mesh(), {1e5f, -1e5f, 3e4f}), "far"));
    for (const Model& scene : scenes) {
        const Bvh tree = build_bvh(scene.mesh(), options());
        const CheckReport valid = check(tree, scene.mesh());
        ASSERT_TRUE(valid.ok) << scene.name << ": " << valid.broken;
        const std::vector<Ray> rays = make_mixed_rays(scene, 100 * thorough, sah_seed);
        const std::vector<Hit> hits = trace(tree, rays);
        const std::vector<Hit> expected = trace_brute_force(scene.mesh(), rays);
        std::vector<std::uint8_t> occluded(rays.size());
        trace_any(tree, rays, occluded);
        for (std::size_t i = 0; i < rays.size(); ++i) {
            ASSERT_EQ(std::memcmp(&hits[i], &expected[i], sizeof(Hit)), 0)
                << scene.name << ", ray " << i << ", seed " << sah_seed;
            ASSERT_EQ(occluded[i] != 0, expected[i].hit()) << scene.name << ", ray " << i;
        }
        // A triangle that a ray meets in several leaves is one hit.
        const AllHits all = trace_all(tree, rays),
                      wanted = trace_all(build_bvh(scene.mesh()), rays);
        EXPECT_EQ(all.offsets, wanted.offsets) << scene.name;
        ASSERT_EQ(all.hits.size(), wanted.hits.size());
        EXPECT_EQ(std::memcmp(all.hits.data(), wanted.hits.data(), all.hits.size() * sizeof(Hit)),
                  0)
            << scene.name;
        EXPECT_EQ(all.counts.hits, all.hits.size());
    }
}

TEST_P(SahTrees, NoRayLeavesAClosedSurface) {
    Mesh mesh = load_model("builtin:figure?triangles=20000").mesh();
    const Aabb box = build_bvh(mesh).bounds();
    const Vec3 center = 0.5f * (box.lo + box.hi);
    // Stretched, so that its triangles are long and lie across.
    for (Vec3& p : mesh.vertices) {
        const Vec3 d = p - center;
        p = {d.x + 20 * d.y, d.y + 15 * d.z, d.z + 20 * d.x};
    }
    const Bvh tree = build_bvh(mesh, options()), other = build_bvh(mesh);
    EXPECT_EQ(tree.has_split_primitives(), GetParam() == Builder::sbvh);
    std::mt19937_64 random(sah_seed);
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < 20'000 * thorough; ++i) {
        const Triangle& t = mesh.triangles[random() % mesh.triangles.size()];
        const Vec3 a = mesh.vertices[t[0]], b = mesh.vertices[t[1]];
        rays.push_back({{0, 0, 0}, 0, i % 2 == 0 ? a : 0.5f * (a + b)});
    }
    std::vector<Hit> hits = trace(tree, rays), wanted = trace(other, rays);
    EXPECT_EQ(std::memcmp(hits.data(), wanted.data(), hits.size() * sizeof(Hit)), 0);
    const auto missed = std::ranges::count_if(hits, [](const Hit& h) { return !h.hit(); });
    EXPECT_EQ(missed, 0);
}

TEST_P(SahTrees, EachPointOfATriangleIsInALeafThatHoldsIt) {
    const Model scene = sticks(2000);
    const Bvh tree = build_bvh(scene.mesh(), options());
    std::map<std::uint32_t, std::vector<Aabb>> boxes;
    for (const BvhNode& node : tree.nodes())
        for (std::uint32_t k = 0; k < node.count; ++k)
            boxes[tree.order()[node.first + k]].push_back({node.lo, node.hi});
    std::mt19937_64 random(sah_seed);
    const auto unit = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
    std::size_t outside = 0;
    for (int i = 0; i < 100'000; ++i) {
        const auto id = static_cast<std::uint32_t>(random() % scene.mesh().triangles.size());
        const Triangle& t = scene.mesh().triangles[id];
        double u = unit(), v = unit();
        if (u + v > 1) u = 1 - u, v = 1 - v;
        const auto at = [&](std::size_t k) {
            const auto c = [&](std::size_t j) {
                return double((&scene.mesh().vertices[t[j]].x)[k]);
            };
            return (1 - u - v) * c(0) + u * c(1) + v * c(2);
        };
        outside += std::ranges::none_of(boxes[id], [&](const Aabb& b) {
            for (std::size_t k = 0; k < 3; ++k)
                if (at(k) < (&b.lo.x)[k] - 1e-13 || at(k) > (&b.hi.x)[k] + 1e-13) return false;
            return true;
        });
    }
    EXPECT_EQ(outside, 0u) << "seed " << sah_seed;
}

TEST_P(SahTrees, AreSavedAndLoaded) {
    const Model scene = sticks(500);
    const Bvh tree = build_bvh(scene.mesh(), options());
    EXPECT_EQ(tree.has_split_primitives(), GetParam() != Builder::sweep);
    EXPECT_EQ(tree_stats(tree).references, tree.order().size());
    EXPECT_LE(tree.order().size(), 2 * scene.mesh().triangles.size());
    EXPECT_GT(tree.peak_bytes(), tree.bytes());
    const TempFolder folder;
    save_rdx(folder.path() / "sticks.rdx", tree, scene);
    const RdxFile loaded = load_rdx(folder.path() / "sticks.rdx");
    const CheckReport same = check_same(tree, loaded.bvh);
    EXPECT_TRUE(same.ok) << same.broken;
    EXPECT_EQ(loaded.bvh.options().builder, GetParam());
    EXPECT_EQ(loaded.bvh.has_split_primitives(), tree.has_split_primitives());
}

TEST_P(SahTrees, HalfAMillionEqualPointsGiveAShallowTree) {
    const std::vector<Vec3> points(25'000 * thorough, Vec3{1, 2, 3});
    const Bvh tree = build_bvh(points, options());
    EXPECT_LE(tree.max_depth(), 32u);
    EXPECT_TRUE(check(tree).ok);
}

TEST_P(SahTrees, TriangleEdgeCases) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const std::vector<Vec3> corners{{0, 0, 0},     {1, 0, 0},     {0, 1, 0},      {nan, 0, 0},
                                    {1e12f, 0, 0}, {0, 1e12f, 1}, {3e-39f, 0, 0}, {5, 5, 5}};
    const std::vector<std::vector<Triangle>> lists{{{0, 1, 2}},
                                                   {{0, 1, 2}, {0, 1, 2}},
                                                   {{3, 1, 2}, {0, 1, 2}, {0, 0, 0}},
                                                   {{3, 3, 3}},
                                                   {{0, 4, 5}, {0, 1, 2}, {7, 7, 7}, {4, 5, 7}},
                                                   std::vector<Triangle>(300, Triangle{0, 1, 7}),
                                                   std::vector<Triangle>(9000, Triangle{0, 4, 5})};
    for (const auto& triangles : lists)
        for (const int max_leaf : {1, 4, 255}) {
            const MeshView mesh{corners, triangles};
            const Bvh tree = build_bvh(mesh, options(max_leaf));
            const CheckReport valid = check(tree, mesh);
            EXPECT_TRUE(valid.ok) << valid.broken;
        }
    EXPECT_THROW(static_cast<void>(build_bvh(MeshView{corners, lists[2]},
                                             [] {
                                                 BuildOptions o = options();
                                                 o.strict = true;
                                                 return o;
                                             }())),
                 InputError);
}

INSTANTIATE_TEST_SUITE_P(Builders, SahTrees,
                         testing::Values(Builder::sweep, Builder::split, Builder::sbvh),
                         [](const auto& p) { return std::string(builder_name(p.param)); });

TEST(SplitTrees, AreBetterThanSweepOverSticks) {
    const Model scene = sticks(20'000);
    const auto sah = [&](Builder builder) {
        return *tree_stats(build_bvh(scene.mesh(), options_of(builder))).sah;
    };
    const double sweep = sah(Builder::sweep);
    EXPECT_LT(sah(Builder::split), 0.9 * sweep);
    EXPECT_LT(sah(Builder::sbvh), 0.9 * sweep);
}

/// One triangle among many small ones is cut near its end: its two parts are each other's
/// neighbours, and so large that even a leaf that counted both would cost no more than they do.
TEST(SplitTrees, ALeafOfTwoPartsHoldsTheirTriangleOnce) {
    Mesh mesh = random_soup(4000, sah_seed, 0.01f);
    for (Vec3& v : mesh.vertices) v = {0.3f * v.x - 0.9f, 0.3f * v.y, 0.3f * v.z};
    mesh.vertices[0].x = -1;  // the scene's middle in x is 0
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (const Vec3 v : {Vec3{-0.01f, 0.5f, 0.5f}, Vec3{-0.01f, 1, 1}, Vec3{1, 0.5f, 0.5f}})
        mesh.vertices.push_back(v);
    mesh.triangles.push_back({first, first + 1, first + 2});
    EXPECT_EQ(build_bvh(mesh, options_of(Builder::split, 1)).order().size(), 4002u);
    const Bvh tree = build_bvh(mesh, options_of(Builder::split, 4));
    EXPECT_EQ(std::ranges::count(tree.order(), 4000u), 1);
    EXPECT_EQ(check(tree, mesh).broken, "");
}

TEST(SplitTrees, CheckFindsWhatIsWrong) {
    const Model scene = sticks(500);
    const auto broken = [&](const auto& damage) {
        Bvh tree = build_bvh(scene.mesh(), options_of(Builder::sbvh));
        damage(BvhInternals{tree});
        return check(tree).broken;
    };
    EXPECT_EQ(broken([](const BvhInternals&) {}), "");
    // One triangle's place goes to another one.
    EXPECT_NE(broken([](const BvhInternals& tree) {
                  std::map<std::uint32_t, int> uses;
                  for (const std::uint32_t id : tree.order().view()) ++uses[id];
                  for (std::uint32_t& id : tree.order().span())
                      if (uses[id] == 1) return void(id = (id + 1) % 625);
              }),
              "");
    // A builder that may not cut primitives.
    EXPECT_NE(broken([](const BvhInternals& tree) { tree.options().builder = Builder::sweep; }),
              "");
    // More primitives than there are references.
    EXPECT_NE(broken([](const BvhInternals& tree) { tree.input_count() = 1'000'000; }), "");
}

TEST(BoxesCover, FindsGapsOfOneFloat) {
    const LeafTriangle t{{0, 0, 0}, {4, 1, 0.5f}, {3, 4, 2}};
    const Aabb whole = box_of(t.v0, t.v1, t.v2);
    EXPECT_TRUE(boxes_cover(t, std::vector<Aabb>{whole}));
    Aabb low = whole, high = whole;
    low.hi.x = high.lo.x = 1.7f;
    EXPECT_TRUE(boxes_cover(t, std::vector<Aabb>{low, high}));
    EXPECT_FALSE(boxes_cover(t, std::vector<Aabb>{low}));
    high.lo.x = std::nextafterf(1.7f, 2);
    EXPECT_FALSE(boxes_cover(t, std::vector<Aabb>{low, high}));
    EXPECT_FALSE(boxes_cover(t, std::vector<Aabb>{}));
}

}  // namespace
}  // namespace raydix::test
