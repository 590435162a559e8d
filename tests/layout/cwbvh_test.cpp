// Compressed nodes: quantised boxes against exact arithmetic in integers, octant slots against all
// assignments, and whole trees decoded again.
#include <gtest/gtest.h>
#include <raydix/cwbvh.h>
#include <raydix/error.h>
#include <raydix/raydix.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>
#include <random>
#include <set>

#include "base/math.h"
#include "layout/cwbvh.h"
#include "support/quantised_steps.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t cwbvh_seed = 80;

/// Quotients of long doubles do not round here: sizes are within 2^60 of each other.
using Exact = long double;

Exact step_of(int exponent) { return std::ldexp(Exact{1}, exponent - 127); }

TEST(Cwbvh, StepsAreTheNearestOutward) {
    std::mt19937_64 random(cwbvh_seed);
    std::uint64_t tight = 0;
    for (int turn = 0; turn < 200'000; ++turn) {
        const auto number = [&] {
            const int size = static_cast<int>(random() % 56) - 16;  // 2^-16 to 2^39
            return std::ldexp(static_cast<float>(static_cast<std::int64_t>(random()) >> 40),
                              size - 23);
        };
        float v[3] = {number(), number(), number()};
        if (turn % 5 == 0) v[2] = std::nextafter(v[1], infinity);
        if (turn % 7 == 0) v[1] = v[0];
        std::sort(v, v + 3);
        const int exponent = step_exponent(v[0], v[2]);
        const Exact step = step_of(exponent), extent = Exact{v[2]} - v[0], at = Exact{v[1]} - v[0];
        ASSERT_GE(255 * step, extent);
        ASSERT_TRUE(exponent == 1 || 255 * step / 2 < extent) << v[0] << " " << v[2];
        const auto [below, above] = quantised_steps(v[0], v[2], v[1]);
        ASSERT_TRUE(below >= 0 && below <= above && above <= 255);
        ASSERT_TRUE(below * step <= at && (below + 1) * step > at)
            << v[0] << " " << v[1] << " " << v[2];
        ASSERT_TRUE(above * step >= at && (above == 0 || (above - 1) * step < at));
        tight += below == above;
    }
    EXPECT_GT(tight, 1000u);  // planes that need no rounding were among them
}

/// 2^-100 is far below the last place of a double beside 2^30, and yet decides.
TEST(Cwbvh, ADifferenceNoDoubleHoldsIsRoundedTheRightWay) {
    const float tiny = 0x1p-100f, large = 0x1p30f;
    const int exponent = step_exponent(-tiny, large);
    EXPECT_GE(255 * step_of(exponent), Exact{large});
    const int q = static_cast<int>(Exact{large} / step_of(exponent));
    ASSERT_EQ(q * step_of(exponent), Exact{large});  // a whole number of steps
    const float all = 255 * 0x1p20f;                 // as many steps as there are
    EXPECT_EQ(step_exponent(-tiny, all), step_exponent(0, all) + 1);
    for (const float origin : {0.0f, -tiny, tiny}) {
        ASSERT_EQ(step_exponent(origin, large), exponent);
        const auto [below, above] = quantised_steps(origin, large, large);
        EXPECT_EQ(below, origin > 0 ? q - 1 : q);
        EXPECT_EQ(above, origin < 0 ? q + 1 : q);
        EXPECT_EQ(is_at_most(origin, exponent, q, large), origin <= 0);
        EXPECT_EQ(is_at_least(origin, exponent, q, large), origin >= 0);
    }
}

double gain_of(std::span<const Aabb> boxes, std::span<const int> slots) {
    Aabb all = empty_box();
    for (const Aabb& box : boxes) all = unite(all, box);
    double sum = 0;
    for (std::size_t k = 0; k < boxes.size(); ++k) {
        const Vec3 d = center_of(boxes[k]) - center_of(all);
        sum +=
            (slots[k] & 1 ? d.x : -d.x) + (slots[k] & 2 ? d.y : -d.y) + (slots[k] & 4 ? d.z : -d.z);
    }
    return sum;
}

TEST(Cwbvh, OctantSlotsAreTheBestOfAllAssignments) {
    std::mt19937_64 random(cwbvh_seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    for (const std::size_t count : {1u, 2u, 3u, 5u, 8u})
        for (int turn = 0; turn < (sanitized ? 2 : count == 8 ? 4 : 20); ++turn) {
            std::vector<Aabb> boxes;
            for (std::size_t k = 0; k < count; ++k) {
                const Vec3 at{unit(), unit(), unit()};
                boxes.push_back({at, at + Vec3{unit(), unit(), unit()}});
            }
            std::vector<int> slots(8), order(8);
            assign_octant_slots(boxes, slots.data());
            EXPECT_EQ(std::set<int>(slots.begin(), slots.begin() + static_cast<int>(count)).size(),
                      count);
            std::iota(order.begin(), order.end(), 0);
            double best = -INFINITY;
            do best = std::max(best, gain_of(boxes, order));
            while (std::next_permutation(order.begin(), order.end()));
            EXPECT_NEAR(gain_of(boxes, slots), best, 1e-5) << count << " children, turn " << turn;
        }
}

/// Eight boxes at the corners of a cube lie in the slots of their corners.
TEST(Cwbvh, CornersOfACubeLieInTheirSlots) {
    std::vector<Aabb> boxes;
    for (int k = 0; k < 8; ++k) {
        const Vec3 at{k & 1 ? 5.0f : 0.0f, k & 2 ? 5.0f : 0.0f, k & 4 ? 5.0f : 0.0f};
        boxes.push_back({at, at + Vec3{1, 1, 1}});
    }
    std::array<int, 8> slots{};
    assign_octant_slots(boxes, slots.data());
    for (int k = 0; k < 8; ++k) EXPECT_EQ(slots[static_cast<std::size_t>(k)], k);
}

/// Everything below node w lies in `box` when decoded; returns the depth.
class Decoder {
public:
    explicit Decoder(const Cwbvh& tree)
        : arrays_(tree.arrays()), nodes_(arrays_.nodes.size()), seen_(arrays_.triangles.size()) {}

    std::uint32_t walk(std::uint32_t w) {
        const CwbvhNode& node = arrays_.nodes[w];
        EXPECT_EQ(nodes_.at(w)++, 0);
        std::uint32_t child = node.child_base, deepest = 0;
        for (int s = 0; s < 8; ++s) {
            const std::uint32_t meta = node.meta[s], ones = meta >> 5, low = meta & 31;
            EXPECT_EQ((node.inner_mask >> s & 1) != 0, low >= 24);
            if (meta == 0) continue;
            std::uint32_t below = 0;
            if (low >= 24) {
                EXPECT_EQ(low, 24u + static_cast<std::uint32_t>(s));
                EXPECT_EQ(ones, 1u);
                for (int g = 0; g < 8; ++g)
                    if (arrays_.nodes[child].meta[g] != 0) expect_triangles_within(child, w, s);
                below = walk(child++);
            } else {
                EXPECT_TRUE(ones == 1 || ones == 3 || ones == 7);
                for (std::uint32_t k = 0; ones >> k != 0; ++k) {
                    const std::uint32_t at = node.triangle_base + low + k;
                    ++seen_.at(at);
                    expect_within(at, w, s);
                }
            }
            deepest = std::max(deepest, below + 1);
        }
        return deepest;
    }
    /// Each node once; each triangle in one leaf.
    [[nodiscard]] bool complete() const {
        const auto once = [](int times) { return times == 1; };
        return std::ranges::all_of(nodes_, once) && std::ranges::all_of(seen_, once);
    }

private:
    void expect_within(std::uint32_t triangle, std::uint32_t w, int slot) {
        const CwbvhTriangle& t = arrays_.triangles[triangle];
        EXPECT_TRUE(contains_exactly(arrays_.nodes[w], slot, box_of(t.v0, t.v1, t.v2)));
    }
    /// Triangles of the leaves of `child`, a child of w.
    void expect_triangles_within(std::uint32_t child, std::uint32_t w, int slot) {
        const CwbvhNode& node = arrays_.nodes[child];
        for (const std::uint8_t meta : node.meta)
            for (std::uint32_t k = 0; (meta & 31) < 24 && meta >> (5 + k) != 0; ++k)
                expect_within(node.triangle_base + (meta & 31u) + k, w, slot);
    }
    const Cwbvh::Arrays& arrays_;
    std::vector<int> nodes_, seen_;
};

void expect_decodes(const Mesh& mesh, const BuildOptions& options = {}) {
    const Bvh bvh = build_bvh(mesh, options);
    const Cwbvh tree(bvh);
    ASSERT_EQ(tree.empty(), bvh.empty());
    if (tree.empty()) return;
    Decoder decoder(tree);
    EXPECT_EQ(decoder.walk(0), tree.stats().max_depth);
    EXPECT_TRUE(decoder.complete());
    EXPECT_EQ(tree.stats().references, bvh.order().size());
    std::vector<std::uint32_t> ids, wanted(bvh.order().begin(), bvh.order().end());
    for (const CwbvhTriangle& t : tree.arrays().triangles.view()) ids.push_back(t.prim);
    std::ranges::sort(ids);
    std::ranges::sort(wanted);
    EXPECT_EQ(ids, wanted);
}

TEST(Cwbvh, DecodesToTheTreeItWasMadeFrom) {
    for (std::size_t n = 0; n <= 30; ++n) expect_decodes(random_soup(n, n + 1, 0.2f));
    for (const Builder builder : {Builder::karras, Builder::ploc, Builder::binned})
        for (const int leaf : {1, 3, 4, 255})
            expect_decodes(random_soup(3000, 9), {.builder = builder, .max_leaf = leaf});
    for (const Model& scene : builtin_triangle_scenes(5000)) expect_decodes(scene.mesh());
}

TEST(Cwbvh, HugeTinyFarFlatAndEqualTriangles) {
    const Mesh soup = random_soup(1000, 4, 0.2f);
    expect_decodes(scaled(soup, 1e12f));
    expect_decodes(scaled(soup, 1e-6f));
    expect_decodes(scaled(soup, 1e-11f));
    expect_decodes(moved(soup, {9e11f, -1e8f, 1e5f}));
    expect_decodes(moved(scaled(soup, 1e12f), {1e-30f, -1e-20f, 0}));
    expect_decodes(lattice_mesh(1000, 4, 7));
    for (int axis = 0; axis < 3; ++axis) {
        Mesh flat = soup;
        for (Vec3& v : flat.vertices) (&v.x)[axis] = 0.3f;
        expect_decodes(flat);
    }
    Mesh equal = soup;
    for (Triangle& t : equal.triangles) t = equal.triangles[0];
    expect_decodes(equal);
    for (Vec3& v : equal.vertices) v = {1, 2, 3};
    expect_decodes(equal);
}

TEST(Cwbvh, SameBitsForEveryThreadCount) {
    const Bvh bvh = build_bvh(load_model("builtin:figure?triangles=20000").mesh());
    const Cwbvh one(bvh, 1);
    for (const int threads : {2, 5, 0}) {
        const Cwbvh other(bvh, threads);
        ASSERT_EQ(one.stats().nodes, other.stats().nodes);
        EXPECT_EQ(0, std::memcmp(one.arrays().nodes.data(), other.arrays().nodes.data(),
                                 one.stats().node_bytes));
        EXPECT_EQ(0, std::memcmp(one.arrays().triangles.data(), other.arrays().triangles.data(),
                                 one.stats().triangle_bytes));
        EXPECT_EQ(one.stats().sah, other.stats().sah);
    }
}

TEST(Cwbvh, StatisticsAddUp) {
    const Bvh bvh = build_bvh(load_model("builtin:atrium?triangles=20000").mesh(), {.max_leaf = 1});
    const CwbvhStats stats = Cwbvh(bvh).stats();
    EXPECT_EQ(stats.inner_children, stats.nodes - 1);
    EXPECT_LE(stats.references, 3 * stats.leaf_children);
    EXPECT_EQ(stats.triangles, bvh.order().size());
    EXPECT_EQ(stats.bytes, 80 * stats.nodes + 48 * stats.references);
    EXPECT_DOUBLE_EQ(stats.bytes_per_triangle, double(stats.bytes) / double(stats.triangles));
    EXPECT_GT(stats.children_per_node, 4.0);
    EXPECT_LE(stats.children_per_node, 8.0);
    EXPECT_GT(stats.widening, 1.0);
    EXPECT_LT(stats.widening, 1.5);
    EXPECT_LT(stats.sah, *tree_stats(bvh).sah);
}

TEST(Cwbvh, ATreeThatWasMovedFromIsEmpty) {
    Cwbvh tree(build_bvh(random_soup(300, 5)));
    const Cwbvh other = std::move(tree), nothing{Bvh()};
    EXPECT_FALSE(other.empty());
    for (const Cwbvh* empty : {static_cast<const Cwbvh*>(&tree), &nothing}) {
        EXPECT_TRUE(empty->empty());
        EXPECT_EQ(empty->stats().nodes, 0u);
        EXPECT_EQ(empty->stats().widening, 1.0) << "without surface";
    }
}

TEST(Cwbvh, RefusesTreesWithoutTriangles) {
    const std::vector<Vec3> points{{0, 0, 0}, {1, 1, 1}};
    EXPECT_THROW(Cwbvh{build_bvh(std::span(points))}, InputError);
}

}  // namespace
}  // namespace raydix::test
