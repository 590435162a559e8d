// Meshes, instances and masks over ranks against one scene of all of them, bit for bit.
#include <raydix/double.h>
#include <raydix/shapes.h>
#include <raydix/solid.h>
#include <raydix/user_geometry.h>

#include <deque>

#include "mpi/ranks.h"

namespace raydix::mpi::test {
namespace {

template <class T>
using MeshOf = BasicMesh<T>;
template <class T>
using TransformOf = BasicTransform<T>;
template <class T>
using Item = BasicDistributedGeometry<T>;

/// A closed box and a few triangles around it.
template <class T>
MeshOf<T> make_thing(unsigned seed) {
    MeshOf<T> mesh;
    std::mt19937 random(seed);
    std::uniform_real_distribution<T> unit(0, 1);
    for (int i = 0; i < 8; ++i)
        mesh.vertices.push_back({T(i & 1), T((i >> 1) & 1), T((i >> 2) & 1)});
    constexpr std::uint32_t faces[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                           {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    for (const auto& f : faces) {
        mesh.triangles.push_back({f[0], f[1], f[2]});
        mesh.triangles.push_back({f[0], f[2], f[3]});
    }
    for (std::uint32_t i = 0; i < 10; ++i) {
        for (int c = 0; c < 3; ++c)
            mesh.vertices.push_back({unit(random) * 2, unit(random) * 2, unit(random) * 2});
        mesh.triangles.push_back({8 + 3 * i, 9 + 3 * i, 10 + 3 * i});
    }
    return mesh;
}

template <class T>
TransformOf<T> moved(T x, T y, T z) {
    TransformOf<T> t{};
    t.m[0][3] = x;
    t.m[1][3] = y;
    t.m[2][3] = z;
    return t;
}

/// Turned, stretched, some of them mirrored.
template <class T>
TransformOf<T> anywhere(std::mt19937& random) {
    std::uniform_real_distribution<T> unit(-1, 1);
    auto t = moved<T>(unit(random) * 6, unit(random) * 6, unit(random) * 6);
    for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 3; ++c) t.m[r][c] = unit(random) / 4 + T(r == c);
    if (unit(random) > 0) t.m[1][1] = -t.m[1][1];
    return t;
}

/// Ranks are more than cores.
raydix::SceneOptions on_one_thread() {
    raydix::SceneOptions options;
    options.threads = 1;
    return options;
}

/// What all ranks give together, in order. Some of it ties: equal meshes, an instance at each of
/// two places twice, a mesh where an instance of it stands.
template <class T>
struct World {
    explicit World(unsigned seed) {
        std::mt19937 random(seed);
        for (const unsigned i : {0u, 1u}) {
            meshes.push_back(make_thing<T>(seed + i));
            things.emplace_back().add(meshes.back());
            things.back().commit(on_one_thread());
        }
        // A scene of two levels.
        BasicScene<T>& pair = things.emplace_back();
        pair.add(things[0], moved<T>(3, 0, 0));
        pair.add(meshes[1]);
        GeometryOptions second_bit;
        second_bit.mask = 2;
        pair.add(things[1], anywhere<T>(random), second_bit);
        pair.commit(on_one_thread());
        for (int i = 0; i < 24; ++i) {
            Item<T> item;
            item.mask = i % 5 == 4 ? 2u : i % 7 == 6 ? 1u : 0xFFFFFFFFu;
            const std::size_t kind = random() % 5;
            if (kind < 2) {
                item.mesh = meshes[kind];
            } else {
                item.scene = &things[kind - 2];
                item.transform = i % 3 == 0 ? moved<T>(T(i % 2), 0, 0) : anywhere<T>(random);
            }
            items.push_back(item);
            if (i % 8 == 3) items.push_back(items[random() % items.size()]);
            if (i % 8 == 5) items.emplace_back();  // only a number
        }
    }

    /// Puts shapes of all kinds between the others, some of them twice. User geometry has the mask
    /// `of_user`.
    void add_shapes(unsigned seed, std::uint32_t of_user = 0xFFFFFFFFu) {
        std::mt19937 random(seed);
        std::uniform_real_distribution<T> unit(-6, 6);
        const auto place = [&] { return BasicVec3<T>{unit(random), unit(random), unit(random)}; };
        for (int i = 0; i < 20; ++i) {
            spheres.push_back({place(), T(0.1) * T(i % 8)});
            capsules.push_back({place(), place(), T(0.05) * T(i % 3)});
            points.push_back(place());
            const auto lo = place();
            boxes.push_back({lo, {lo.x + 1, lo.y + 2, lo.z + 1}});
        }
        boxes[0] = {{0, 0, 0}, {1, 1, 1}};  // ties with a face of meshes
        spheres[3].radius = -1;             // left out
        points[4].x = std::numeric_limits<T>::quiet_NaN();
        user.emplace(std::span<const Box>(boxes), Plates{boxes});
        for (std::size_t i = 0; i < 12; ++i) {
            Item<T> item;
            item.mask = i % 5 == 4 ? 2u : 0xFFFFFFFFu;
            if (i % 4 == 0) item.spheres = spheres;
            if (i % 4 == 1) item.capsules = capsules;
            if (i % 4 == 2) item.points = points;
            if (i % 4 == 3) {
                item.user = &*user;
                item.mask = of_user;
            }
            item.radius = T(0.25);
            items.insert(items.begin() + std::ptrdiff_t(random() % (items.size() + 1)), item);
        }
    }

    /// Stretched spheres and capsules.
    void add_images(unsigned seed, std::uint32_t mask) {
        std::mt19937 random(seed);
        BasicScene<T>& round = things.emplace_back();
        round.add(std::span<const BasicSphere<T>>(spheres).first(5));
        round.add(std::span<const BasicCapsule<T>>(capsules).first(5));
        round.commit(on_one_thread());
        for (int i = 0; i < 4; ++i) {
            Item<T> item;
            item.mask = mask;
            item.scene = &round;
            item.transform = anywhere<T>(random);
            items.insert(items.begin() + std::ptrdiff_t(random() % (items.size() + 1)), item);
        }
    }

    BasicScene<T> in_one_process() const {
        BasicScene<T> scene;
        for (const Item<T>& item : items) {
            GeometryOptions options;
            options.mask = item.mask;
            if (item.scene != nullptr)
                scene.add(*item.scene, item.transform, options);
            else if (item.user != nullptr)
                scene.add(*item.user, options);
            else if (!item.spheres.empty())
                scene.add(item.spheres, options);
            else if (!item.capsules.empty())
                scene.add(item.capsules, options);
            else if (!item.points.empty())
                scene.add(item.points, item.radius, options);
            else
                scene.add(item.mesh, options);
        }
        scene.commit(on_one_thread());
        return scene;
    }

    using Box = BasicAabb<T>;
    /// The lower faces of boxes.
    struct Plates {
        std::span<const Box> boxes;
        bool operator()(std::uint32_t prim, const BasicRay<T>& ray, BasicHit<T>& hit) const {
            const Box& box = boxes[prim];
            hit.t = (box.lo.z - ray.origin.z) / ray.direction.z;
            hit.u = ray.origin.x + hit.t * ray.direction.x;
            hit.v = ray.origin.y + hit.t * ray.direction.y;
            return hit.u >= box.lo.x && hit.u <= box.hi.x && hit.v >= box.lo.y && hit.v <= box.hi.y;
        }
    };

    std::deque<MeshOf<T>> meshes;
    std::deque<BasicScene<T>> things;
    std::vector<BasicSphere<T>> spheres;
    std::vector<BasicCapsule<T>> capsules;
    std::vector<BasicVec3<T>> points;
    std::vector<Box> boxes;
    std::optional<BasicUserGeometry<T>> user;
    std::vector<Item<T>> items;
};

/// Each rank gives its part of the world.
template <class T>
BasicDistributedScene<T> over_ranks(const World<T>& world, Partition partition, Division division,
                                    unsigned seed) {
    SceneOptions options;
    options.partition = partition;
    options.threads = 1;
    const auto begins = division_of(world.items.size(), division, seed);
    return {MPI_COMM_WORLD, mine(world.items, begins), options};
}

template <class T>
auto make_rays(std::size_t n, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<T> unit(-1, 1);
    std::vector<BasicRay<T>> rays(n);
    for (std::size_t i = 0; i < n; ++i) {
        for (T* x : {&rays[i].origin.x, &rays[i].origin.y, &rays[i].origin.z})
            *x = unit(random) * 9;
        for (T* x : {&rays[i].direction.x, &rays[i].direction.y, &rays[i].direction.z})
            *x = unit(random);
        if (i % 4 == 0) rays[i] = {{T(0.5), T(0.25), -9}, 0, {0, 0, 1}, infinity};
        if (i % 6 == 0) rays[i].tmax = T(4);
    }
    return rays;
}

template <class T, class A, class B>
bool same_place(const A& found, const B& expected, bool is_there) {
    if (!is_there) return found.prim == no_global;
    return found.u == expected.u && found.v == expected.v && found.instance == expected.instance &&
           found.geometry == expected.geometry && found.prim == std::uint64_t(expected.prim);
}

template <class T>
std::size_t different_hits(const auto& found, const auto& expected) {
    std::size_t different = found.size() != expected.size();
    for (std::size_t i = 0; i < std::min(found.size(), expected.size()); ++i)
        different += std::memcmp(&found[i].t, &expected[i].t, sizeof(T)) != 0 ||
                     !same_place<T>(found[i], expected[i], expected[i].hit());
    return different;
}

/// A filter that looks at all of a hit but its t.
bool counts(const auto& ray, const auto& hit) {
    return (hit.prim + 3 * hit.geometry + hit.instance) % 3 != 0 &&
           (ray.direction.x > 0 || hit.u < decltype(hit.u)(0.5));
}

template <class T>
void expect_same_rays(const BasicScene<T>& one, const BasicDistributedScene<T>& many,
                      std::span<const BasicRay<T>> rays, const BasicTraceOptions<T>& options) {
    BasicSceneTraceOptions<T> alone;
    alone.threads = 1;
    alone.mask = options.mask;
    alone.masks = options.masks;
    if (options.filter)
        alone.filter = [](std::size_t, const auto& ray, const auto& hit) {
            return counts(ray, hit);
        };
    EXPECT_EQ(different_hits<T>(many.trace(rays, options).values, trace(one, rays, alone)), 0u);
    std::vector<std::uint8_t> occluded(rays.size());
    trace_any(one, rays, std::span(occluded), alone);
    EXPECT_TRUE(same_bits(many.trace_any(rays, options).values, occluded));
    const auto expected = trace_all(one, rays, alone);
    const auto rows = many.trace_all(rays, options);
    EXPECT_TRUE(same_bits(rows.offsets, expected.offsets));
    EXPECT_EQ(different_hits<T>(rows.hits, expected.hits), 0u);
}

template <class T>
void expect_same_points(const BasicScene<T>& one, const BasicDistributedScene<T>& many,
                        std::span<const BasicVec3<T>> points,
                        std::initializer_list<std::uint32_t> masks = {0xFFFFFFFFu, 1u}) {
    for (const std::uint32_t mask : masks) {
        BasicSceneClosestOptions<T> options;
        options.mask = mask;
        options.threads = 1;
        const auto expected = raydix::closest_points(one, points, options);
        const auto found = many.closest_points(points, T(infinity), mask).values;
        std::size_t different = 0;
        for (std::size_t i = 0; i < points.size(); ++i)
            different +=
                std::memcmp(&found[i].position, &expected[i].position, sizeof(points[i])) != 0 ||
                std::memcmp(&found[i].distance, &expected[i].distance, sizeof(T)) != 0 ||
                !same_place<T>(found[i], expected[i], expected[i].found());
        EXPECT_EQ(different, 0u);
    }
}

template <class T>
class InstancesOverRanks : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(InstancesOverRanks, Scalars);

TYPED_TEST(InstancesOverRanks, AnswerAsOneProcess) {
    using T = TypeParam;
    unsigned seed = 300;
    for (const Partition partition : {Partition::as_given, Partition::curve})
        for (const Division division :
             {Division::some_empty,
              partition == Partition::curve ? Division::one_holds_all : Division::random}) {
            SCOPED_TRACE("division " + std::to_string(int(division)) + ", seed " +
                         std::to_string(++seed));
            const World<T> world(seed);
            const BasicScene<T> one = world.in_one_process();
            const auto many = over_ranks(world, partition, division, seed);
            const auto all = make_rays<T>(240, seed);
            const auto ray_begins = division_of(all.size(), division, seed + 1);
            const auto rays = mine(all, ray_begins);
            expect_same_rays<T>(one, many, rays, {});
            BasicTraceOptions<T> masked;
            masked.mask = 2;
            expect_same_rays<T>(one, many, rays, masked);
            std::vector<std::uint32_t> masks;
            for (std::size_t i = 0; i < rays.size(); ++i) masks.push_back(std::uint32_t(i % 4));
            masked.masks = masks;
            expect_same_rays<T>(one, many, rays, masked);
            std::vector<BasicVec3<T>> points;
            for (const auto& ray : rays) points.push_back(ray.origin);
            expect_same_points<T>(one, many, points);
        }
}

TYPED_TEST(InstancesOverRanks, ShapesAnswerAsOneProcess) {
    using T = TypeParam;
    unsigned seed = 500;
    for (const Partition partition : {Partition::as_given, Partition::curve})
        for (const Division division : {Division::random, Division::some_empty}) {
            SCOPED_TRACE("seed " + std::to_string(++seed));
            World<T> world(seed);
            world.add_shapes(seed);
            const BasicScene<T> one = world.in_one_process();
            const auto many = over_ranks(world, partition, division, seed);
            const auto all = make_rays<T>(300, seed);
            const auto rays = mine(all, division_of(all.size(), division, seed + 1));
            expect_same_rays<T>(one, many, rays, {});
            BasicTraceOptions<T> masked;
            masked.mask = 2;
            expect_same_rays<T>(one, many, rays, masked);
            BasicTraceOptions<T> filtered;
            filtered.filter = [](const auto& ray, const auto& hit) { return counts(ray, hit); };
            expect_same_rays<T>(one, many, rays, filtered);
        }
}

TYPED_TEST(InstancesOverRanks, ClosestPointsOfShapesAreThoseOfOneProcess) {
    using T = TypeParam;
    unsigned seed = 700;
    for (const Partition partition : {Partition::as_given, Partition::curve})
        for (const Division division : {Division::random, Division::some_empty}) {
            SCOPED_TRACE("seed " + std::to_string(++seed));
            World<T> world(seed);
            constexpr std::uint32_t hidden = 4;
            world.add_shapes(seed, hidden);
            for (auto& item : world.items) item.mask &= item.user != nullptr ? hidden : ~hidden;
            world.add_images(seed, ~hidden);
            const BasicScene<T> one = world.in_one_process();
            const auto many = over_ranks(world, partition, division, seed);
            const auto all = make_rays<T>(300, seed);
            std::vector<BasicVec3<T>> points;
            for (const auto& ray : mine(all, division_of(all.size(), division, seed + 1)))
                points.push_back(ray.origin);
            expect_same_points<T>(one, many, points, {3u, 1u});
            EXPECT_THROW((void)many.closest_points({}), InputError);  // shows user geometry
        }
}

TYPED_TEST(InstancesOverRanks, ContainAsOneProcess) {
    using T = TypeParam;
    const World<T> world(41);
    const BasicScene<T> one = world.in_one_process();
    const auto many = over_ranks(world, SceneOptions().partition, Division::even, 1);
    std::vector<BasicVec3<T>> points;
    for (const auto& ray : make_rays<T>(300, 42)) points.push_back(ray.origin);
    points.push_back({T(0.5), T(0.5), 0});  // on a face of several boxes
    SceneSolidOptions options;
    options.rule = InsideRule::parity;
    options.threads = 1;
    const std::conditional_t<sizeof(T) == 4, Solid, SolidD> solid(one, options);
    std::vector<std::uint8_t> expected(points.size());
    raydix::contains(solid, points, std::span(expected));
    EXPECT_TRUE(same_bits(many.contains(points).values, expected));
}

TEST(InstancesOverRanks, PathsNumberThroughTheRanks) {
    const World<float> world(7);
    std::vector<Item<float>> items(3);
    for (auto& item : items) item.scene = &world.things[2];  // two instances in it: three paths
    const DistributedScene many(MPI_COMM_WORLD, std::span<const DistributedGeometry>(items));
    EXPECT_EQ(many.holding().paths, 9u);
    EXPECT_EQ(many.holding().first_path, 9u * unsigned(rank()));
    EXPECT_EQ(many.holding().size, 0u);
}

TEST(InstancesOverRanks, WhatIsWrongIsSaidOnAll) {
    const World<float> world(7);
    const auto message_of = [](const auto& call) -> std::string {
        try {
            call();
        } catch (const InputError& error) {
            return error.what();
        }
        return "nothing";
    };
    const std::string last = "rank " + std::to_string(ranks() - 1) + ": ";
    const auto refusal_of = [&](const DistributedGeometry& wrong) {
        const std::vector<DistributedGeometry> given(rank() == ranks() - 1 ? 1 : 0, wrong);
        return message_of([&] {
            const DistributedScene made(MPI_COMM_WORLD,
                                        std::span<const DistributedGeometry>(given));
        });
    };
    DistributedGeometry both;
    both.scene = &world.things[0];
    both.mesh = world.meshes[0];
    EXPECT_EQ(refusal_of(both), last + "geometry 0 has a scene and a mesh; it can be one of them");
    const Sphere ball{{0, 0, 0}, 1};
    DistributedGeometry shapes;
    shapes.spheres = {&ball, 1};
    SceneOptions of_one;
    of_one.one_geometry = true;
    EXPECT_EQ(message_of([&] {
                  const DistributedScene made(
                      MPI_COMM_WORLD, std::span<const DistributedGeometry>(&shapes, 1), of_one);
              }),
              "rank 0: geometry 0 has spheres; with one_geometry there are meshes and instances "
              "alone");
    DistributedGeometry flat;
    flat.scene = &world.things[0];
    flat.transform.m[0][0] = 0;
    EXPECT_EQ(refusal_of(flat).find(last), 0u) << refusal_of(flat);
    const Scene uncommitted;
    DistributedGeometry early;
    early.scene = &uncommitted;
    EXPECT_EQ(refusal_of(early).find(last), 0u) << refusal_of(early);

    Scene balls;
    balls.add(std::span(&ball, 1));
    balls.commit();
    DistributedGeometry round;
    round.scene = &balls;
    const std::vector<DistributedGeometry> given(rank() == 0 ? 1 : 0, round);
    const DistributedScene many(MPI_COMM_WORLD, std::span<const DistributedGeometry>(given));
    const Ray ray{{0, 0, -5}, 0, {0, 0, 1}, infinity};
    EXPECT_EQ(many.trace({&ray, 1}).values[0].t, 4.0f);
    const Vec3 beside{0, 0, 3};
    EXPECT_EQ(many.closest_points({&beside, 1}).values[0].distance, 2.0f);
    EXPECT_EQ(message_of([&] { (void)many.contains({}); }).find("rank 0: "), 0u);
    TraceOptions options;
    const std::uint32_t masks[2] = {1, 1};
    if (rank() == 0) options.masks = masks;
    EXPECT_EQ(message_of([&] {
                  (void)many.trace({&ray, 1}, options);
              }),
              "rank 0: 2 masks for 1 rays");
    TraceOptions filtered;
    filtered.filter = [](const Ray&, const DistributedHit&) -> bool {
        throw InputError("not this one");
    };
    EXPECT_EQ(message_of([&] { (void)many.trace({&ray, 1}, filtered); }), "rank 0: not this one");
    if (ranks() > 1) {
        if (rank() == 0) filtered.filter = {};
        EXPECT_EQ(message_of([&] {
                      (void)many.trace_any({&ray, 1}, filtered);
                  }),
                  "the ranks differ: rank 0 calls trace_any, rank 1 calls trace_any, filtered");
    }
}

}  // namespace
}  // namespace raydix::mpi::test
