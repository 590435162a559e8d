// Scenes of models with nodes, against every mesh of every node on its own, and against the model
// as one mesh.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/model.h>
#include <raydix/scene.h>
#include <raydix/scene_pairs.h>
#include <raydix/scene_queries.h>
#include <raydix/solid.h>
#include <raydix/trace.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <tuple>
#include <utility>
#include <vector>

#include "engine/affine.h"
#include "support/message.h"
#include "support/random.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix {
namespace {

using test::Random;

std::uint32_t below(Random& random, std::uint32_t n) {
    return static_cast<std::uint32_t>(random.below(n));
}

Mesh some_mesh(Random& random, std::uint32_t triangles) {
    Mesh mesh;
    const auto place = [&] {
        return Vec3{random.between(-1, 1), random.between(-1, 1), random.between(-1, 1)};
    };
    for (std::uint32_t i = 0; i < triangles; ++i) {
        const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
        for (int k = 0; k < 3; ++k) mesh.vertices.push_back(place());
        mesh.triangles.push_back({first, first + 1, first + 2});
    }
    return mesh;
}

Transform rounded(const TransformD& t) {
    Transform out;
    for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 4; ++c) out.m[r][c] = static_cast<float>(t.m[r][c]);
    return out;
}

TransformD some_map(Random& random) {
    TransformD t;
    do {
        for (auto& row : t.m) {
            for (std::size_t k = 0; k < 3; ++k) row[k] = double(random.between(-2.6f, 2.6f)) / 3;
            row[3] = double(random.between(-2, 2)) / 3;
        }
    } while (!inverse_of(affine_of(rounded(t))));
    return t;
}

/// Meshes with triangles, some of them empty or points; nodes below nodes, with meshes or without.
struct SomeModel : Model {
    explicit SomeModel(Random& random) {
        name = "some";
        for (std::uint32_t i = 0, n = 1 + below(random, 5); i < n; ++i)
            meshes.push_back(below(random, 5) == 0 ? Mesh{} : some_mesh(random, 6));
        if (below(random, 4) == 0) meshes.push_back({"", {{1, 2, 3}}, {}});
        for (std::uint32_t i = 0, n = 1 + below(random, 4); i < n; ++i)
            add(random, ModelNode::none, 4);
    }

private:
    void add(Random& random, std::uint32_t parent, std::uint32_t levels) {
        const auto place = static_cast<std::uint32_t>(nodes.size());
        ModelNode node;
        node.parent = parent;
        node.transform = some_map(random);
        if (below(random, 3) != 0) {
            node.first_mesh = below(random, static_cast<std::uint32_t>(meshes.size()));
            node.mesh_count =
                1 + below(random, static_cast<std::uint32_t>(meshes.size()) - node.first_mesh);
        }
        nodes.push_back(node);
        if (levels == 0) return;
        for (std::uint32_t i = 0, n = below(random, 4); i < n; ++i) add(random, place, levels - 1);
    }
};

std::vector<Ray> some_rays(Random& random, std::size_t n) {
    std::vector<Ray> rays(n);
    for (Ray& ray : rays) {
        const Vec3 from = random.in(-3, 3), to = random.in(-1, 1);
        ray = {from, 0, {to.x - from.x, to.y - from.y, to.z - from.z}, infinity};
    }
    return rays;
}

/// Node k ends path k + 1.
std::vector<Hit> hits_of_nodes(const Model& model, std::span<const Ray> rays) {
    std::vector<Hit> best(rays.size());
    for (std::size_t k = 0; k < model.nodes.size(); ++k) {
        std::vector<Affine> ways;  // from the inside out
        for (std::size_t at = k; at != ModelNode::none; at = model.nodes[at].parent)
            ways.push_back(*inverse_of(affine_of(rounded(model.nodes[at].transform))));
        std::vector<Ray> entering;
        for (const Ray& ray : rays) {
            WideRayLine line{Double3(ray.origin), Double3(ray.direction)};
            for (auto way = ways.rbegin(); way != ways.rend(); ++way) line = line.into(*way);
            entering.push_back(line.rounded(ray.tmin, ray.tmax));
        }
        const ModelNode& node = model.nodes[k];
        for (std::uint32_t m = 0; m < node.mesh_count; ++m) {
            const std::uint32_t id = node.first_mesh + m;
            if (model.meshes[id].triangles.empty()) continue;
            const std::vector<Hit> hits = trace_brute_force(model.meshes[id], entering, 1);
            for (std::size_t i = 0; i < rays.size(); ++i) {
                const Hit found{hits[i], id, static_cast<std::uint32_t>(k + 1)};
                const auto key = [](const Hit& h) {
                    return std::tuple(h.t, h.instance, h.geometry, h.prim);
                };
                if (found.hit() && (!best[i].hit() || key(found) < key(best[i]))) best[i] = found;
            }
        }
    }
    return best;
}

TEST(ModelScene, NodesAreInstancesAndMeshesGeometries) {
    Random random(5);
    std::size_t found = 0, deep = 0;
    for (int round = 0; round < (test::sanitized ? 12 : 60); ++round) {
        const SomeModel model(random);
        for (const bool compact : {false, true}) {
            const Scene scene(model, {.compact = compact});
            const std::vector<Ray> rays = some_rays(random, 300);
            const std::vector<Hit> hits = trace(scene, rays), wanted = hits_of_nodes(model, rays);
            for (std::size_t i = 0; i < rays.size(); ++i) {
                ASSERT_TRUE(hits[i].t == wanted[i].t && hits[i].prim == wanted[i].prim &&
                            hits[i].u == wanted[i].u && hits[i].v == wanted[i].v &&
                            hits[i].geometry == wanted[i].geometry &&
                            hits[i].instance == wanted[i].instance)
                    << "round " << round << ", ray " << i << ": path " << hits[i].instance << " at "
                    << hits[i].t << ", wanted " << wanted[i].instance << " at " << wanted[i].t;
                if (!hits[i].hit()) continue;
                ++found;
                // The nodes on the way, by what their ids say.
                std::vector<std::uint32_t> way;
                for (std::uint32_t at = hits[i].instance - 1; at != ModelNode::none;
                     at = model.nodes[at].parent)
                    way.insert(way.begin(), static_cast<std::uint32_t>(model.meshes.size()) + at);
                ASSERT_EQ(scene.path(hits[i].instance), way);
                deep += way.size() > 2;
            }
        }
    }
    EXPECT_GT(found, test::fewer(1000, 10));
    EXPECT_GT(deep, test::fewer(100, 10));
}

TEST(ModelScene, FlattenedHitsAreThoseOfTheNodesButForRounding) {
    Random random(6);
    std::size_t compared = 0, other = 0;
    for (int round = 0; round < 40; ++round) {
        const SomeModel model(random);
        Model flat = model;
        flat.flatten();
        ASSERT_TRUE(flat.is_flat());
        // Where the triangles of each node's meshes begin.
        std::vector<std::vector<std::uint32_t>> first;
        std::uint32_t triangles = 0;
        for (const ModelNode& node : model.nodes) {
            first.emplace_back(model.meshes.size());
            for (std::uint32_t m = 0; m < node.mesh_count; ++m) {
                first.back()[node.first_mesh + m] = triangles;
                triangles +=
                    static_cast<std::uint32_t>(model.meshes[node.first_mesh + m].triangles.size());
            }
        }
        ASSERT_EQ(flat.mesh().triangles.size(), triangles);
        if (triangles == 0) continue;
        const std::vector<Ray> rays = some_rays(random, 300);
        const std::vector<Hit> hits = trace(Scene(model), rays);
        const std::vector<Hit> of_flat = trace(Scene(flat), rays);
        for (std::size_t i = 0; i < rays.size(); ++i) {
            if (!hits[i].hit() && !of_flat[i].hit()) continue;
            ++compared;
            const bool same =
                hits[i].hit() && of_flat[i].hit() &&
                first[hits[i].instance - 1][hits[i].geometry] + hits[i].prim == of_flat[i].prim &&
                std::fabs(hits[i].t - of_flat[i].t) < 1e-3f * (1 + of_flat[i].t);
            other += !same;
        }
    }
    EXPECT_GT(compared, 1000u);
    EXPECT_LE(other, compared / 500);  // rays past edges
}

TEST(ModelScene, QueriesHaveTheBitsOfTheFlattenedModel) {
    Random random(8);
    std::size_t found = 0, turned = 0;
    for (int round = 0; round < 40; ++round) {
        const SomeModel model(random);
        Model flat = model;
        flat.flatten();
        if (flat.mesh().triangles.empty()) continue;
        const Scene scene(model);
        const Scene one(flat);
        std::vector<Vec3> queries;
        for (int i = 0; i < 200; ++i) queries.push_back(random.in(-4, 4));
        const std::vector<SceneClosestPoint> points = closest_points(scene, queries);
        const std::vector<SceneClosestPoint> of_flat = closest_points(one, queries);
        for (std::size_t i = 0; i < queries.size(); ++i) {
            found += points[i].found();
            ASSERT_EQ(points[i].distance, of_flat[i].distance) << "round " << round;
            ASSERT_EQ(points[i].position.x, of_flat[i].position.x);
            ASSERT_EQ(points[i].position.y, of_flat[i].position.y);
            ASSERT_EQ(points[i].position.z, of_flat[i].position.z);
        }
        const Solid body(scene, {.rule = InsideRule::crossings});
        const Solid of_one(one, {.rule = InsideRule::crossings});
        const std::vector<double> numbers = winding_numbers(body, queries);
        EXPECT_EQ(numbers, winding_numbers(of_one, queries)) << "round " << round;
        turned += std::ranges::count_if(numbers, [](double n) { return n != 0; });
        EXPECT_EQ(count_overlapping_pairs(scene, {.narrow = true}),
                  count_overlapping_pairs(one, {.narrow = true}));
    }
    EXPECT_GT(found, 5000u);
    EXPECT_GT(turned, 50u);
}

TEST(ModelScene, FlatteningKeepsWhatFloatsCannotHold) {
    Model model;
    model.name = "scales";
    model.meshes.push_back({"", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}});
    // 40 pairs of nodes: one makes all smaller than floats are, the one below it larger again.
    for (std::uint32_t k = 0; k < 80; ++k) {
        ModelNode node;
        node.parent = k == 0 ? ModelNode::none : k - 1;
        const double scale = k % 2 == 0 ? 0x1p-200 : 0x1p200;
        for (std::size_t r = 0; r < 3; ++r) node.transform.m[r][r] = k == 2 ? -scale : scale;
        model.nodes.push_back(node);
    }
    model.nodes.back().mesh_count = 1;
    model.flatten();
    EXPECT_EQ(model.mesh().vertices[1].x, -1.0f);
    EXPECT_EQ(model.mesh().vertices[2].y, -1.0f);
    EXPECT_EQ(model.mesh().triangles[0], (Triangle{0, 2, 1}));
}

TEST(ModelScene, WhatShowsNothingMayBeDeepAndFlat) {
    Model model;
    model.name = "chain";
    model.meshes.push_back({"", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}});
    // 100,000 nodes below each other without a mesh, their maps flat; then one with it.
    for (std::uint32_t k = 0; k < 100'000; ++k) {
        ModelNode node;
        node.parent = k == 0 ? ModelNode::none : k - 1;
        node.transform.m = {};
        model.nodes.push_back(node);
    }
    ModelNode last;
    last.mesh_count = 1;
    model.nodes.push_back(last);
    const Scene scene(model);
    const Hit hit = closest_hit(scene, {{0.2f, 0.2f, 1}, 0, {0, 0, -1}, infinity});
    EXPECT_EQ(hit.t, 1.0f);
    EXPECT_EQ(hit.instance, 100'001u);
    EXPECT_EQ(hit.geometry, 0u);
}

TEST(ModelScene, SaysWhichNodeItCannotPlace) {
    Model model;
    model.name = "bad";
    model.meshes.push_back({"", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}});
    model.nodes.resize(2);
    model.nodes[0].mesh_count = model.nodes[1].mesh_count = 1;
    model.nodes[1].name = "door";
    model.nodes[1].transform.m[2] = {};
    EXPECT_EQ(test::message_of([&] { static_cast<void>(Scene(model)); }),
              "bad: node 1 (door): instance 2: its transform is singular or not finite, so rays "
              "cannot go through it (Model::flatten, --flatten makes one mesh of it)");
    model.flatten();
    EXPECT_EQ(Scene(model).bounds().hi.x, 1.0f);
}

TEST(ModelScene, TellsHowFarItIs) {
    Random random(8);
    Model model;
    model.name = "three";
    for (int k = 0; k < 3; ++k) {
        model.meshes.push_back(some_mesh(random, 20000));
        ModelNode node;
        node.first_mesh = static_cast<std::uint32_t>(k), node.mesh_count = 1;
        model.nodes.push_back(node);
    }
    std::vector<double> parts;
    SceneOptions options;
    options.progress = [&](double part) { parts.push_back(part); };
    static_cast<void>(Scene(model, options));
    ASSERT_GT(parts.size(), 6u);
    EXPECT_TRUE(std::ranges::is_sorted(parts));
    EXPECT_GT(std::ranges::count_if(parts, [](double p) { return p > 0.34 && p < 0.66; }), 0);
    EXPECT_EQ(parts.back(), 1.0);
    // What the callback throws ends it.
    options.progress = [](double part) {
        if (part > 0.5) throw std::runtime_error("enough");
    };
    EXPECT_THROW(static_cast<void>(Scene(model, options)), std::runtime_error);
}

TEST(ModelScene, RefusesNodesOutOfOrder) {
    Model model;
    model.name = "bad";
    model.meshes.resize(1);
    model.nodes.resize(3);
    model.nodes[1].parent = 0;
    model.nodes[2].parent = 2;
    const auto fault = [&] { return test::message_of([&] { static_cast<void>(Scene(model)); }); };
    EXPECT_TRUE(fault().starts_with("bad: node 2: node 2, its parent, does not stand before it"));
    model.nodes[2].parent = 1;
    EXPECT_EQ(fault(), "no error");
    model.nodes[2].first_mesh = 1, model.nodes[2].mesh_count = 2;
    EXPECT_TRUE(fault().starts_with("bad: node 2: shows mesh 2 of 1"));
}

TEST(ModelScene, OneMeshIsWantedWhereThereAreMore) {
    Model model;
    model.name = "two";
    EXPECT_TRUE(std::as_const(model).mesh().vertices.empty());
    model.meshes.resize(2);
    EXPECT_EQ(test::message_of([&] { static_cast<void>(model.mesh()); }),
              "two: it has 2 meshes in 0 nodes where one mesh is wanted: flatten it, or trace a "
              "Scene of it");
    model.flatten();
    EXPECT_TRUE(model.mesh().triangles.empty());
}

TEST(ModelScene, ErrorsOfOneMeshNameTheModelToo) {
    Model model;
    model.name = "cloud.ply";
    model.meshes.push_back({"", {{0, 0, 0}, {1, 0, 0}}, {}});
    ASSERT_TRUE(model.is_flat());
    EXPECT_EQ(test::message_of([&] { static_cast<void>(Scene(model)); }),
              "cloud.ply: geometry 0: vertices without triangles");
    model.name.clear();
    EXPECT_EQ(test::message_of([&] { static_cast<void>(Scene(model)); }),
              "geometry 0: vertices without triangles");
}

}  // namespace
}  // namespace raydix
