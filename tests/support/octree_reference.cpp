#include "support/octree_reference.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <deque>
#include <memory>

#include "base/math.h"
#include "support/reference_tree.h"

namespace raydix::test {
namespace {

struct KeyedItem {
    std::uint64_t code;
    std::uint32_t id;
};

struct Bucket {
    int level;
    std::uint64_t code;
    std::vector<KeyedItem> items;  // all that is below
    std::array<std::unique_ptr<Bucket>, 8> children;
    bool divided = false;
};

struct Insertion {
    int axis_bits, max_level;
    std::size_t max_leaf;

    void put_below(Bucket& bucket, KeyedItem item) const {
        const int shift = 3 * (axis_bits - bucket.level - 1);
        const std::uint64_t code = item.code >> shift;
        std::unique_ptr<Bucket>& child = bucket.children[code & 7];
        if (!child) {
            child = std::make_unique<Bucket>();
            child->level = bucket.level + 1;
            child->code = code;
        }
        put(*child, item);
    }
    void put(Bucket& bucket, KeyedItem item) const {
        bucket.items.push_back(item);
        if (bucket.divided) return put_below(bucket, item);
        if (bucket.items.size() <= max_leaf || bucket.level == max_level) return;
        bucket.divided = true;
        for (const KeyedItem& old : bucket.items) put_below(bucket, old);
    }
};

bool usable(Vec3 p) {
    const auto ok = [](float x) { return x >= -1e12f && x <= 1e12f; };
    return ok(p.x) && ok(p.y) && ok(p.z);
}

/// Buckets in level order as nodes; a leaf's items go to the order.
void flatten(Bucket& root, ReferenceOctree& tree) {
    struct Waiting {
        Bucket* bucket;
        std::uint32_t parent;
    };
    std::vector<KeyedItem>& items = root.items;
    std::ranges::sort(items, [](const KeyedItem& a, const KeyedItem& b) {
        return a.code != b.code ? a.code < b.code : a.id < b.id;
    });
    for (const KeyedItem& item : items) tree.order.push_back(item.id);
    std::deque<Waiting> waiting{{&root, no_node}};
    while (!waiting.empty()) {
        const auto [bucket, parent] = waiting.front();
        waiting.pop_front();
        const auto at = static_cast<std::uint32_t>(tree.nodes.size());
        OctreeNode node{bucket->code,
                        parent,
                        no_node,
                        0,
                        static_cast<std::uint32_t>(bucket->items.size()),
                        0,
                        static_cast<std::uint32_t>(bucket->level)};
        const KeyedItem first =
            *std::ranges::min_element(bucket->items, [](const KeyedItem& a, const KeyedItem& b) {
                return a.code != b.code ? a.code < b.code : a.id < b.id;
            });
        node.first_point = static_cast<std::uint32_t>(
            std::ranges::lower_bound(items, first.code, {}, &KeyedItem::code) - items.begin());
        if (bucket->divided) node.first_child = at + 1 + static_cast<std::uint32_t>(waiting.size());
        for (std::uint32_t octant = 0; octant < 8; ++octant) {
            if (!bucket->children[octant]) continue;
            node.child_mask |= 1u << octant;
            waiting.push_back({bucket->children[octant].get(), at});
        }
        tree.nodes.push_back(node);
    }
}

bool same_bytes(const auto& a, const auto& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

std::string text(const OctreeNode& n) {
    return fmt::format("(code {:x}, parent {}, child {}, points {} + {}, mask {:02x}, level {})",
                       n.code, n.parent, n.first_child, n.first_point, n.point_count, n.child_mask,
                       n.level);
}

}  // namespace

ReferenceOctree reference_octree(std::span<const Vec3> points, const OctreeOptions& options,
                                 bool reversed) {
    ReferenceOctree tree;
    tree.bounds = empty_box();
    std::vector<std::uint32_t> ids;
    for (std::uint32_t id = 0; id < points.size(); ++id) {
        if (!usable(points[id])) {
            ++tree.left_out;
            continue;
        }
        const Vec3 p = without_negative_zero(points[id]);
        tree.bounds = unite(tree.bounds, {p, p});
        ids.push_back(id);
    }
    if (reversed) std::ranges::reverse(ids);
    const int axis_bits = options.bits / 3;
    const Insertion insertion{axis_bits, options.max_level < 0 ? axis_bits : options.max_level,
                              static_cast<std::size_t>(options.max_leaf)};
    Bucket root{};
    for (const std::uint32_t id : ids) {
        const Vec3 p = without_negative_zero(points[id]);
        insertion.put(root, {reference_code({p, p}, tree.bounds, options.bits), id});
    }
    if (!ids.empty()) flatten(root, tree);
    for (const std::uint32_t id : tree.order)
        tree.points.push_back(without_negative_zero(points[id]));
    return tree;
}

std::string difference(const Octree& built, const ReferenceOctree& expected) {
    const Aabb bounds = built.bounds();
    if (!same_bytes(bounds, expected.bounds)) return "bounds";
    if (built.left_out() != expected.left_out) return "left out";
    if (built.nodes().size() != expected.nodes.size())
        return fmt::format("{} nodes, not {}", built.nodes().size(), expected.nodes.size());
    for (std::size_t i = 0; i < expected.nodes.size(); ++i)
        if (!same_bytes(built.nodes()[i], expected.nodes[i]))
            return fmt::format("node {} {}, not {}", i, text(built.nodes()[i]),
                               text(expected.nodes[i]));
    if (!std::ranges::equal(built.order(), expected.order)) return "order";
    if (built.points().size() != expected.points.size()) return "number of points";
    for (std::size_t i = 0; i < expected.points.size(); ++i)
        if (!same_bytes(built.points()[i], expected.points[i])) return fmt::format("point {}", i);
    return {};
}

}  // namespace raydix::test
