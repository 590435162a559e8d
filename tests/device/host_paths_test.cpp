// What a device computes, run on the host, against the host's own faster paths: the same bits, so
// that a tree built and traced on either is the same. Needs no device.
#include <gtest/gtest.h>
#include <raydix/raydix.h>
#include <raydix/trace.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <vector>

#include "device/work.h"
#include "keys/host_encode.h"
#include "support/support.h"
#include "trace/host_slabs.h"

namespace raydix::device_test {
namespace {

template <class T>
bool same_bits(const T& a, const T& b) {
    return std::memcmp(&a, &b, sizeof(T)) == 0;
}

/// Triangles of many sizes, some far out, flat, -0, NaN, infinite or out of range.
Mesh odd_mesh(std::uint64_t seed) {
    Mesh mesh = test::random_soup(5000, seed);
    std::mt19937_64 random(seed);
    const float values[] = {0.0f,    -0.0f,  1e-13f, -3e-20f,  1e12f,     -1e12f,
                            1.1e12f, 1e-45f, 5e11f,  infinity, -infinity, std::nanf("")};
    for (std::size_t i = 0; i < mesh.vertices.size(); i += 7) {
        float* p = &mesh.vertices[i].x;
        p[random() % 3] = values[random() % std::size(values)];
    }
    for (std::size_t i = 0; i < mesh.triangles.size(); i += 11)
        mesh.triangles[i][1] = mesh.triangles[i][2];
    return mesh;
}

template <class Source>
void expect_same_boxes(const Source& source, std::uint32_t n) {
    std::uint32_t valid = 0;
    for (std::uint32_t i = 0; i < n; ++i) {
        Aabb plain;
        Box3 fast;
        const bool plain_valid = source.box(i, plain);
        ASSERT_EQ(host_box(source, i, fast), plain_valid) << i;
        if (!plain_valid) continue;
        ASSERT_TRUE(same_bits(fast.box(), plain)) << i;
        ++valid;
    }
    EXPECT_GT(valid, n / 2);
    EXPECT_LT(valid, n);
}

template <class Key, class Source>
void expect_same_codes(const Source& source, std::uint32_t n, const Aabb& bounds) {
    const Grid grid = make_grid(bounds, CodeFormat<Key>::axis_bits);
    std::vector<Key> plain(n), fast(n);
    std::vector<std::uint32_t> valid;
    for (std::uint32_t i = 0; i < n; ++i) {
        EncodeMorton<Source, Key>{source, grid, plain.data()}(i);
        if (plain[i] != left_out_key<Key>) valid.push_back(i);
    }
    host_encode(source, grid, false, n, fast.data());
    ASSERT_EQ(plain, fast);
    // Where all are valid there are faster loops; runs of valid ones are fed to them.
    for (std::size_t k = 0; k < valid.size();) {
        std::size_t end = k + 1;
        while (end < valid.size() && valid[end] == valid[end - 1] + 1) ++end;
        const std::uint32_t first = valid[k], count = valid[end - 1] + 1 - first;
        std::vector<Key> run(first + count), slow(first + count);
        encode_range<true>(source, HostGrid(grid), first, first + count, slow.data() + first);
        ASSERT_TRUE(std::equal(slow.begin() + first, slow.end(), plain.begin() + first)) << first;
#if defined(__x86_64__)
        if (deposits_bits_fast()) {
            encode_range_bmi2<true>(source, HostGrid(grid), first, first + count,
                                    run.data() + first);
            ASSERT_TRUE(std::equal(run.begin() + first, run.end(), plain.begin() + first)) << first;
        }
#endif
        k = end;
    }
}

TEST(HostPaths, BoxesAndCodes) {
    const Mesh mesh = odd_mesh(7);
    const TriangleSource triangles{mesh.vertices.data(), mesh.triangles.data(),
                                   mesh.vertices.size()};
    const auto n = static_cast<std::uint32_t>(mesh.triangles.size());
    const auto points = static_cast<std::uint32_t>(mesh.vertices.size());
    expect_same_boxes(triangles, n);
    expect_same_boxes(PointSource{mesh.vertices.data()}, points);
    for (const Aabb& bounds :
         {build_bvh(mesh).bounds(), Aabb{{0, 0, 0}, {0, 0, 0}}, Aabb{{-1e12f, 0, 0}, {1e12f, 1, 2}},
          Aabb{{0.5f, 0.5f, 0.5f}, {0.5f, 0.5f, 0.5f + 0x1p-24f}}}) {
        // Only primitives within the bounds have a defined cell.
        std::vector<Triangle> inside;
        for (std::uint32_t i = 0; i < n; ++i) {
            Aabb box;
            if (!triangles.box(i, box) || same_bits(unite(bounds, box), bounds))
                inside.push_back(mesh.triangles[i]);
        }
        const TriangleSource source{mesh.vertices.data(), inside.data(), mesh.vertices.size()};
        expect_same_codes<std::uint32_t>(source, static_cast<std::uint32_t>(inside.size()), bounds);
        expect_same_codes<std::uint64_t>(source, static_cast<std::uint32_t>(inside.size()), bounds);
    }
}

template <class Key>
void expect_same_tree(const Mesh& mesh, int bits) {
    const Bvh tree = build_bvh(mesh, {.bits = bits, .max_leaf = 1});
    const auto n = static_cast<std::uint32_t>(tree.order().size()), inner = n - 1;
    const TriangleSource source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    std::vector<Key> by_id(mesh.triangles.size()), keys;
    const Grid grid = make_grid(tree.bounds(), CodeFormat<Key>::axis_bits);
    for (std::size_t i = 0; i < by_id.size(); ++i)
        EncodeMorton<TriangleSource, Key>{source, grid, by_id.data()}(i);
    for (const std::uint32_t id : tree.order()) keys.push_back(by_id[id]);

    std::vector<std::uint64_t> kept((inner + 63) / 64, ~std::uint64_t{0});
    std::vector<std::uint32_t> before(kept.size()), parent_slot(inner);
    for (std::size_t w = 0; w < before.size(); ++w) before[w] = static_cast<std::uint32_t>(64 * w);
    std::vector<BvhNode> nodes(2 * std::size_t{inner} + 2, BvhNode{{0, 0, 0}, 0, {0, 0, 0}, 0});
    nodes[0].first = pair_slot(0);
    std::vector<RadixRange> ranges(inner);
    std::vector<std::uint8_t> meeting(inner);
    std::uint32_t depth = 0;
    for (std::uint32_t i = 0; i < inner; ++i) FindRange<Key>{{keys.data(), n}, ranges.data()}(i);
    const EmitRadixNode<> emit{{kept.data(), before.data()}, 1, nodes.data(), parent_slot.data()};
    for (std::uint32_t i = 0; i < inner; ++i) EmitFromRange{emit, ranges.data()}(i);
    const FitTriangles fit{
        {tree.triangles().data()}, nodes.data(), parent_slot.data(), meeting.data(), &depth};
    for (std::uint32_t i = 0; i < inner; ++i) fit(i);
    EXPECT_EQ(depth, tree.max_depth());
    ASSERT_EQ(nodes.size(), tree.nodes().size());
    for (std::size_t slot = 0; slot < nodes.size(); ++slot)
        ASSERT_TRUE(same_bits(nodes[slot], tree.nodes()[slot])) << slot;
}

TEST(HostPaths, Trees) {
    for (const std::uint64_t seed : {1u, 2u, 3u}) {
        Mesh mesh = odd_mesh(seed);
        // Repeated triangles: equal codes, told apart by their positions.
        for (std::size_t i = 0; i < 600; ++i) mesh.triangles[i + 1000] = mesh.triangles[3];
        expect_same_tree<std::uint32_t>(mesh, 30);
        expect_same_tree<std::uint64_t>(mesh, 63);
    }
}

TEST(HostPaths, Slabs) {
    std::mt19937 random(11);
    std::uniform_real_distribution<float> place(-2.0f, 3.0f), part(-1.0f, 1.0f);
    std::size_t hits = 0, pairs = 0;
    for (int i = 0; i < 200000; ++i) {
        Ray ray{{place(random), place(random), place(random)},
                0.0f,
                {part(random), part(random), part(random)},
                infinity};
        if (i % 3 == 0) ray.direction.x = i % 2 ? 0.0f : -0.0f;
        if (i % 5 == 0) ray.direction.z = -0.0f;
        if (!is_valid(ray)) continue;
        alignas(64) BvhNode pair[2];
        for (BvhNode& node : pair) {
            const Vec3 a{place(random), place(random), place(random)},
                b{place(random), i % 6 ? place(random) : a.y, 1.0f};
            node = {min_of(a, b), 0, max_of(a, b), 1};
        }
        if (i % 3 == 0) pair[i % 2].lo.x = ray.origin.x;  // in the plane: 0 * Inf
        const RayFrame frame = make_frame(ray);
        const SlabFrame slabs = make_slab_frame(frame, {{-2, -2, -2}, {3, 3, 3}});
        const float tmax = i % 4 == 0 ? place(random) : frame.tmax;
        const PairInterval both = HostSlabs(slabs, frame.tmin).intersect(pair, tmax);
        for (int k = 0; k < 2; ++k) {
            const SlabInterval one = intersect_slabs(slabs, &pair[k].lo.x, frame.tmin, tmax);
            ASSERT_EQ((both.hit >> k & 1) != 0, one.entry <= one.exit) << "pair " << i;
            if (one.entry > one.exit) continue;
            ASSERT_EQ(k == 0 ? both.entry_a : both.entry_b, one.entry) << "pair " << i;
            ++hits;
        }
        ++pairs;
    }
    EXPECT_GT(hits, pairs / 10);
    EXPECT_LT(hits, 2 * pairs);
}

/// Scenes that are flat at the ray's own origin get no padding: their planes are 0 * Inf for a ray
/// along another axis.
TEST(HostPaths, SlabsWithoutPadding) {
    const Vec3 origin{1, 2, 3};
    int compared = 0;
    for (int along = 0; along < 3; ++along) {
        for (int open = 0; open < 3; ++open) {
            if (open == along) continue;  // the axis in which the scene extends
            for (const float zero : {0.0f, -0.0f}) {
                Ray ray{origin, 0.0f, {zero, zero, zero}, infinity};
                (&ray.direction.x)[along] = 1.0f;
                Aabb root{origin, origin};
                (&root.lo.x)[open] -= 1.0f;
                (&root.hi.x)[open] += 1.0f;
                alignas(64) BvhNode pair[2] = {{root.lo, 0, origin, 1}, {origin, 0, root.hi, 1}};
                const RayFrame frame = make_frame(ray);
                const SlabFrame slabs = make_slab_frame(frame, root);
                const PairInterval both = HostSlabs(slabs, frame.tmin).intersect(pair, frame.tmax);
                EXPECT_EQ(both.hit, 3) << "along " << along << ", open " << open;
                for (int k = 0; k < 2; ++k) {
                    const SlabInterval one =
                        intersect_slabs(slabs, &pair[k].lo.x, frame.tmin, frame.tmax);
                    EXPECT_LE(one.entry, one.exit) << "along " << along << ", open " << open;
                    EXPECT_EQ(k == 0 ? both.entry_a : both.entry_b, one.entry);
                    ++compared;
                }
            }
        }
    }
    EXPECT_EQ(compared, 24);
}

/// The closest answer of the device's work is the library's, bit for bit.
TEST(HostPaths, Rays) {
    const Mesh mesh = test::random_soup(300, 5, 0.8f);
    const Bvh tree = build_bvh(mesh);
    std::vector<LeafTriangle> corners;
    for (const Triangle& t : mesh.triangles)
        corners.push_back({mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]});
    std::mt19937 random(3);
    std::uniform_real_distribution<float> place(-1.0f, 2.0f), part(-1.0f, 1.0f);
    std::vector<Ray> rays;
    for (int i = 0; i < 5000; ++i)
        rays.push_back({{place(random), place(random), place(random)},
                        0.0f,
                        {part(random), part(random), i % 9 ? part(random) : 0.0f},
                        infinity});
    const std::vector<Hit> hits = trace(tree, rays);
    const AllHits all = trace_all(tree, rays);
    const BvhNode root{tree.bounds().lo, 0, tree.bounds().hi, 0};
    std::vector<RayAnswer> answers(rays.size());
    std::size_t found = 0;
    for (std::uint32_t i = 0; i < rays.size(); ++i) {
        AnswerRay{rays.data(), corners.data(), static_cast<std::uint32_t>(corners.size()), &root,
                  answers.data()}(i);
        ASSERT_TRUE(same_bits<TreeHit>(answers[i].closest, hits[i])) << i;
        ASSERT_EQ(answers[i].crossings, all.offsets[i + 1] - all.offsets[i]) << i;
        found += hits[i].hit();
    }
    EXPECT_GT(found, rays.size() / 10);
}

}  // namespace
}  // namespace raydix::device_test
