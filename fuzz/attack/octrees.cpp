// Octrees: their own invariants, points in boxes and the node of a point against all points one by
// one, neighbours against their definition.
#include <raydix/octree.h>

#include <algorithm>

#include "attack/attack.h"
#include "attack/parts.h"
#include "attack/ray_families.h"
#include "attack/vectors.h"

namespace raydix::attack {
namespace {

bool holds(const Aabb& box, Vec3 p) {
    return box.lo.x <= p.x && p.x <= box.hi.x && box.lo.y <= p.y && p.y <= box.hi.y &&
           box.lo.z <= p.z && p.z <= box.hi.z;
}
bool is_finite_box(const Aabb& box) { return is_finite(box.lo) && is_finite(box.hi); }

/// Whether the node's cell is the last one along an axis: all bits of its coordinate are set.
bool is_last(const OctreeNode& node, std::uint32_t axis) {
    bool all = true;
    for (std::uint32_t k = 0; k < node.level; ++k)
        all = all && (node.code >> (3 * k + 2 - axis) & 1) != 0;
    return all;
}

/// The deepest node whose box holds `p`, by the documented rule; all nodes are tried.
std::uint32_t locate_by_boxes(const Octree& tree, Vec3 p) {
    if (tree.empty() || !is_finite(p)) return no_node;
    std::uint32_t found = no_node, level = 0;
    for (std::uint32_t i = 0; i < tree.nodes().size(); ++i) {
        const OctreeNode& node = tree.nodes()[i];
        const Aabb box = node_box(tree, i);
        bool inside = true;
        for (std::uint32_t axis = 0; axis < 3; ++axis)
            inside = inside && at(box.lo, axis) <= at(p, axis) &&
                     (at(p, axis) < at(box.hi, axis) ||
                      (at(p, axis) == at(box.hi, axis) && is_last(node, axis)));
        if (inside && (found == no_node || node.level > level)) {
            found = i;
            level = node.level;
        }
    }
    return found;
}

class OctreeDuel {
public:
    explicit OctreeDuel(Case& c)
        : case_(c),
          made_(any_mesh(c.random, c.random.chance(0.1) ? 600 : 60)),
          over_points_(c.random.chance(0.5)) {
        options_.bits = c.random.chance(0.3) ? 30 : 63;
        const int deepest = options_.bits == 30 ? 10 : 21;
        options_.max_level = c.random.chance(0.7) ? -1 : c.random.whole(0, deepest);
        options_.max_leaf = c.random.whole(1, 8);
        options_.threads = c.random.chance(0.9) ? 1 : 2;
        tree_ = build();
    }

    void run() {
        const CheckReport report = check(tree_);
        expect(report.ok, "check", report.broken);
        const std::string hash = tree_hash(tree_);
        options_.threads = 3;
        expect(hash == tree_hash(build()), "tree_hash with other threads");
        compare_boxes();
        compare_places();
        for (int i = 0; i < 8 && !tree_.empty(); ++i)
            compare_neighbours(case_.random.below(tree_.nodes().size()));
    }

private:
    Octree build() const {
        return over_points_ ? build_octree(std::span<const Vec3>(made_.mesh.vertices), options_)
                            : build_octree(made_.mesh, options_);
    }
    Vec3 place() { return make_point(case_.random, made_.mesh, finite_bounds(made_.mesh)); }

    void compare_boxes() {
        std::vector<Aabb> boxes(20);
        for (Aabb& box : boxes) {
            box = {place(), place()};
            for (std::uint32_t axis = 0; axis < 3; ++axis)
                if (at(box.lo, axis) > at(box.hi, axis))
                    std::swap(at(box.lo, axis), at(box.hi, axis));
        }
        const PointsInBoxes rows = points_in_boxes(tree_, boxes, 1);
        for (std::size_t q = 0; q < boxes.size(); ++q) {
            std::vector<std::uint32_t> wanted;
            for (std::size_t k = 0; k < tree_.order().size(); ++k)
                if (is_finite_box(boxes[q]) && holds(boxes[q], tree_.points()[k]))
                    wanted.push_back(tree_.order()[k]);
            std::sort(wanted.begin(), wanted.end());
            const auto row =
                std::span(rows.ids).subspan(rows.offsets[q], rows.offsets[q + 1] - rows.offsets[q]);
            expect(same_bytes(row, std::span<const std::uint32_t>(wanted)), "points_in_boxes",
                   text_of(boxes[q].lo) + text_of(boxes[q].hi));
            expect(points_in_box(tree_, boxes[q]) == wanted, "points_in_box");
        }
    }

    void compare_places() {
        const std::vector<Vec3>& points = made_.mesh.vertices;
        std::vector<Vec3> queries(20);
        for (Vec3& query : queries)
            query = case_.random.chance(0.4) ? points[case_.random.below(points.size())] : place();
        const std::vector<std::uint32_t> nodes = locate(tree_, queries, 1);
        for (std::size_t q = 0; q < queries.size(); ++q) {
            expect(nodes[q] == locate_by_boxes(tree_, queries[q]), "locate", text_of(queries[q]));
            expect(locate(tree_, queries[q]) == nodes[q], "single locate", text_of(queries[q]));
        }
    }

    /// A neighbour's box touches the node's on the side of the step, and it is no deeper.
    void compare_neighbours(std::uint32_t node) {
        const std::array<std::uint32_t, 26> all = neighbours(tree_, node);
        const std::array<Direction, 26> directions = all_directions();
        const Aabb own = node_box(tree_, node);
        const auto side = [](int step, float lo, float hi) { return step > 0 ? hi : lo; };
        for (std::size_t k = 0; k < all.size(); ++k) {
            const Direction step = directions[k];
            const std::uint32_t other = neighbour(tree_, node, step);
            expect(other == all[k], "neighbours");
            if (other == no_node) continue;
            const Vec3 shared{side(step.dx, own.lo.x, own.hi.x), side(step.dy, own.lo.y, own.hi.y),
                              side(step.dz, own.lo.z, own.hi.z)};
            expect(tree_.nodes()[other].level <= tree_.nodes()[node].level &&
                       holds(node_box(tree_, other), shared),
                   "a neighbour touches");
        }
    }

    void expect(bool right, const char* what, const std::string& detail = {}) {
        case_.expect(right, "octrees", what, [&] {
            return text("    family %s, bits %d, max_level %d, max_leaf %d, over %s\n    ",
                        family_name(made_.family), options_.bits, options_.max_level,
                        options_.max_leaf, over_points_ ? "points" : "triangles") +
                   detail + "\n" + text_of(made_.mesh);
        });
    }

    Case& case_;
    TestMesh made_;
    bool over_points_;
    OctreeOptions options_;
    Octree tree_;
};

}  // namespace

static void attack_octrees(Case& c) { OctreeDuel(c).run(); }

static const Kind octrees_kind("octrees", attack_octrees, 0.5);

}  // namespace raydix::attack
