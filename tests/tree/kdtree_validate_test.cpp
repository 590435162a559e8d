// kd_check names the invariant that was broken: one planted fault each.
#include <gtest/gtest.h>
#include <raydix/kdtree.h>

#include <cmath>
#include <cstring>
#include <functional>

#include "support/point_sets.h"
#include "support/support.h"
#include "tree/kdtree_internals.h"

namespace raydix::test {
namespace {

/// What kd_check says of a good tree after `damage`.
std::string broken_after(const std::function<void(const KdTreeInternals&)>& damage,
                         const MeshView* mesh = nullptr) {
    const Mesh soup = random_soup(400, 2);
    KdTree tree = build_kdtree(soup, {.max_leaf = 4});
    EXPECT_EQ(kd_check(tree, soup).broken, "");
    damage(KdTreeInternals{tree});
    const CheckReport report = mesh ? kd_check(tree, *mesh) : kd_check(tree);
    EXPECT_EQ(report.ok, report.broken.empty());
    return report.broken;
}

/// The first slot from 2 on that is a leaf, or is not.
std::uint32_t find_slot(const KdTreeInternals& tree, bool leaf) {
    std::uint32_t slot = 2;
    while (tree.nodes()[slot].is_leaf() != leaf) ++slot;
    return slot;
}

void expect_names(const char* text, const std::function<void(const KdTreeInternals&)>& damage) {
    const std::string said = broken_after(damage);
    EXPECT_NE(said.find(text), std::string::npos) << '"' << said << "\" does not say " << text;
}

using Access = const KdTreeInternals&;

TEST(KdCheck, Counts) {
    expect_names("31 code bits", [](Access t) { t.options().bits = 31; });
    expect_names("max_leaf 0", [](Access t) { t.options().max_leaf = 0; });
    expect_names("goes into no k-d tree", [](Access t) { t.kind() = PrimitiveKind::boxes; });
    expect_names("400 references to 0 points", [](Access t) { t.kind() = PrimitiveKind::points; });
    expect_names("left out", [](Access t) { ++t.input_count(); });
    expect_names("slots", [](Access t) { ++t.inner_count(); });
}

TEST(KdCheck, Topology) {
    expect_names("a cycle", [](Access t) {
        KdNode& node = t.nodes()[find_slot(t, false)];
        node.link = t.nodes()[0].link;
    });
    expect_names("children at slot", [](Access t) { t.nodes()[0].link = 0xFFFFFFFCu; });
    expect_names("starts at position", [](Access t) { ++t.nodes()[find_slot(t, true)].first; });
    expect_names("holds 0 primitives", [](Access t) {
        std::uint32_t slot = 2;
        while (!t.nodes()[slot].is_leaf() || t.nodes()[slot ^ 1].is_leaf()) ++slot;
        t.nodes()[slot].link = KdNode::leaf_axis;
    });
    expect_names("max_leaf is 3", [](Access t) { t.options().max_leaf = 3; });
    expect_names("a leaf may hold 9", [](Access t) { t.options().max_leaf = 9; });
    expect_names("deepest leaf", [](Access t) { ++t.max_depth(); });
    expect_names("padding", [](Access t) { t.nodes()[1].link = 4; });
    expect_names("the root's interval", [](Access t) { t.nodes()[0].hi = 1; });
}

TEST(KdCheck, Primitives) {
    expect_names("names primitive 400 of 400", [](Access t) { t.order()[7] = 400; });
    expect_names("more than one place", [](Access t) { t.order()[7] = t.order()[8]; });
    expect_names("belongs in no tree", [](Access t) { t.triangles()[5].v1.y = std::nanf(""); });
    expect_names("the bounds", [](Access t) { t.bounds().hi.z += 1; });
}

TEST(KdCheck, Splits) {
    expect_names("do not ascend", [](Access t) {
        std::swap(t.order()[3], t.order()[300]);
        std::swap(t.triangles()[3], t.triangles()[300]);
    });
    expect_names("splits axis", [](Access t) { t.nodes()[find_slot(t, false)].link ^= 1; });
    expect_names("but its codes differ at", [](Access t) {
        float& plane = t.nodes()[find_slot(t, false)].plane;
        plane = std::nextafter(plane, infinity);
    });
    expect_names("not where codes first differ", [](Access t) {
        // Moves one primitive from a right leaf to its left sibling.
        for (std::uint32_t slot = 2;; slot += 2) {
            KdNode &left = t.nodes()[slot], &right = t.nodes()[slot + 1];
            if (!left.is_leaf() || !right.is_leaf() || left.count() == 4 || right.count() == 1)
                continue;
            left.link += 4;
            right.link -= 4;
            ++right.first;
            return;
        }
    });
}

TEST(KdCheck, Intervals) {
    expect_names("interval", [](Access t) {
        float& hi = t.nodes()[find_slot(t, false)].hi;
        hi = std::nextafter(hi, -infinity);
    });
    expect_names("interval", [](Access t) {
        float& lo = t.nodes()[find_slot(t, true)].lo;
        lo = std::nextafter(lo, -infinity);
    });
}

TEST(KdCheck, AgainstTheMesh) {
    const Mesh other = random_soup(400, 3), fewer = random_soup(399, 2);
    const MeshView views[] = {other, fewer};
    EXPECT_NE(broken_after([](Access) {}, &views[0]).find("not what the mesh holds"),
              std::string::npos);
    EXPECT_NE(broken_after([](Access) {}, &views[1]).find("a mesh with 399"), std::string::npos);
}

TEST(KdCheck, HashSeesEveryPart) {
    const Mesh soup = random_soup(300, 5);
    const std::string hash = kd_hash(build_kdtree(soup));
    const std::function<void(Access)> damages[] = {
        [](Access t) { t.options().bits = 30; },
        [](Access t) { t.options().max_leaf = 7; },
        [](Access t) { t.bounds().lo.x -= 1; },
        [](Access t) { t.nodes()[2].lo -= 1; },
        [](Access t) { t.nodes()[3].hi += 1; },
        [](Access t) { t.nodes()[0].plane += 1; },
        [](Access t) { t.nodes()[0].link ^= 1; },
        [](Access t) { std::swap(t.order()[0], t.order()[1]); },
    };
    for (const auto& damage : damages) {
        KdTree tree = build_kdtree(soup);
        ASSERT_EQ(kd_hash(tree), hash);
        damage(KdTreeInternals{tree});
        EXPECT_NE(kd_hash(tree), hash) << &damage - damages;
    }
    EXPECT_EQ(kd_hash(build_kdtree(Mesh{})).size(), 32u);
}

TEST(KdCheck, ATreeThatWasNeverBuiltIsEmpty) {
    EXPECT_EQ(kd_check(KdTree()).broken, "");
    EXPECT_EQ(kd_hash(KdTree()), kd_hash(build_kdtree(std::span<const Vec3>{})));
}

}  // namespace
}  // namespace raydix::test
