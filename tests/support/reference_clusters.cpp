#include "support/reference_clusters.h"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <tuple>
#include <vector>

#include "base/math.h"
#include "support/reference_tree.h"
#include "tree/bvh_internals.h"

namespace raydix::test {
namespace {

constexpr std::size_t radius = 8;

struct Cluster {
    Aabb box;
    std::vector<std::uint32_t> ids;  // ascending
    float cost = 0;
    bool leaf = true;
    std::size_t left = 0, right = 0;  // in Forest::all
};

float area(const Aabb& b) {
    const float x = b.hi.x - b.lo.x, y = b.hi.y - b.lo.y, z = b.hi.z - b.lo.z;
    return (x * y + y * z) + z * x;
}

using List = std::vector<std::size_t>;  // clusters by their place in Forest::all

struct Forest {
    std::size_t max_leaf;
    std::vector<Cluster> all;

    std::size_t merge(std::size_t a, std::size_t b) {
        if (all[b].ids.front() < all[a].ids.front()) std::swap(a, b);
        Cluster c;
        c.left = a;
        c.right = b;
        c.box = unite(all[a].box, all[b].box);
        std::ranges::merge(all[a].ids, all[b].ids, std::back_inserter(c.ids));
        c.leaf = false;
        if (c.ids.size() <= max_leaf) {
            const float as_leaf = static_cast<float>(c.ids.size()) * area(c.box);
            c.cost = area(c.box) + (all[a].cost + all[b].cost);
            if (as_leaf <= c.cost) {
                c.cost = as_leaf;
                c.leaf = true;
            }
        }
        all.push_back(std::move(c));
        return all.size() - 1;
    }

    /// The place that i prefers: least area of the union, then nearest in the list; of two as near
    /// as each other, the one whose pair begins at an even multiple of the distance's lowest bit.
    std::size_t nearest(const List& list, std::size_t i) const {
        auto best =
            std::tuple(std::numeric_limits<float>::infinity(), std::size_t{0}, std::size_t{0}, i);
        for (std::size_t j = i > radius ? i - radius : 0; j < list.size() && j <= i + radius; ++j) {
            if (j == i) continue;
            const std::size_t first = std::min(i, j), distance = std::max(i, j) - first;
            const std::size_t bit = std::size_t{1} << std::countr_zero(distance);
            best = std::min(best, std::tuple(area(unite(all[list[i]].box, all[list[j]].box)),
                                             distance, first / bit % 2, j));
        }
        return std::get<3>(best);
    }

    /// One round; `pair_up`: neighbours merge whatever their areas.
    List round(const List& list, bool pair_up) {
        std::vector<std::size_t> choice(list.size());
        for (std::size_t i = 0; i < list.size(); ++i)
            choice[i] = pair_up ? std::min(i ^ 1, list.size() - 1) : nearest(list, i);
        List next;
        for (std::size_t i = 0; i < list.size(); ++i) {
            const bool mutual = choice[i] != i && choice[choice[i]] == i;
            if (!mutual)
                next.push_back(list[i]);
            else if (i < choice[i])
                next.push_back(merge(list[i], list[choice[i]]));
        }
        return next;
    }

    void emit(std::size_t cluster, std::size_t slot, std::uint32_t depth, const BvhInternals& out,
              std::vector<BvhNode>& nodes, std::vector<std::uint32_t>& order) {
        const Cluster& c = all[cluster];
        out.max_depth() = std::max(out.max_depth(), depth);
        if (c.leaf) {
            nodes[slot] = {c.box.lo, static_cast<std::uint32_t>(order.size()), c.box.hi,
                           static_cast<std::uint32_t>(c.ids.size())};
            order.insert(order.end(), c.ids.begin(), c.ids.end());
            return;
        }
        const std::size_t first = nodes.size();
        nodes[slot] = {c.box.lo, static_cast<std::uint32_t>(first), c.box.hi, 0};
        nodes.resize(first + 2);
        ++out.inner_count();
        emit(c.left, first, depth + 1, out, nodes, order);
        emit(c.right, first + 1, depth + 1, out, nodes, order);
    }
};

struct Item {
    std::uint64_t code;
    std::uint32_t id;
    Aabb box;
};

std::vector<Item> items_in_order(std::span<const Aabb> input, int bits) {
    std::vector<Item> items;
    Aabb scene = empty_box();
    for (std::size_t i = 0; i < input.size(); ++i) {
        const Aabb box{without_negative_zero(input[i].lo), without_negative_zero(input[i].hi)};
        if (!in_range(box.lo) || !in_range(box.hi) || is_empty(box)) continue;
        scene = unite(scene, box);
        items.push_back({0, static_cast<std::uint32_t>(i), box});
    }
    for (Item& item : items) item.code = reference_code(item.box, scene, bits);
    std::ranges::stable_sort(items, {}, &Item::code);
    return items;
}

/// Everything around the clustering itself, which gets the forest of primitives in Morton order.
template <class Clustering>
Bvh reference(std::span<const Aabb> boxes, const BuildOptions& options, const Clustering& cluster) {
    const std::vector<Item> items = items_in_order(boxes, options.bits);
    Bvh bvh;
    const BvhInternals out{bvh};
    out.kind() = PrimitiveKind::boxes;
    out.options() = options;
    out.input_count() = boxes.size();
    out.left_out() = boxes.size() - items.size();
    if (items.empty()) return bvh;
    Forest forest{static_cast<std::size_t>(options.max_leaf), {}};
    for (const Item& item : items) forest.all.push_back({item.box, {item.id}, area(item.box)});
    const std::size_t root = cluster(forest, items);

    std::vector<BvhNode> nodes(2, BvhNode{});
    std::vector<std::uint32_t> order;
    forest.emit(root, 0, 0, out, nodes, order);
    out.nodes().reset(nodes.size());
    std::ranges::copy(nodes, out.nodes().data());
    out.order().reset(order.size());
    std::ranges::copy(order, out.order().data());
    out.boxes().reset(order.size());
    for (const Item& item : items)
        out.boxes()[static_cast<std::size_t>(std::ranges::find(order, item.id) - order.begin())] =
            item.box;
    return bvh;
}

/// How many leading bits two keys share; equal codes go on with their positions.
int shared_bits(const std::vector<Item>& items, std::size_t i, std::size_t j) {
    if (items[i].code != items[j].code) return std::countl_zero(items[i].code ^ items[j].code);
    return 64 + std::countl_zero(i ^ j);
}

/// What is left of the primitives [begin, end) of a radix node.
List hierarchical(Forest& forest, const std::vector<Item>& items, std::size_t begin,
                  std::size_t end) {
    constexpr std::size_t most = 16;
    if (end - begin == 1) return {begin};
    std::size_t split = begin + 1;
    while (shared_bits(items, split - 1, split) != shared_bits(items, begin, end - 1)) ++split;
    List list = hierarchical(forest, items, begin, split);
    const List right = hierarchical(forest, items, split, end);
    list.insert(list.end(), right.begin(), right.end());
    const bool root = end - begin == items.size();
    if (end - begin > most || root)
        while (list.size() > (root ? 1 : most)) list = forest.round(list, false);
    return list;
}

struct Plane {
    float cost = std::numeric_limits<float>::infinity();
    std::size_t larger = 0;  // primitives on the fuller side
    std::vector<bool> goes_left;
};

float coordinate(Vec3 v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

/// The best plane among the bins of one axis.
Plane best_plane(const Forest& forest, const List& list, int axis, bool by_count) {
    const auto center2 = [&](std::size_t i) {
        const Aabb& box = forest.all[i].box;
        return coordinate(box.lo, axis) + coordinate(box.hi, axis);
    };
    const auto [low, high] = std::ranges::minmax(list, {}, center2);
    const float origin = center2(low), extent = center2(high) - origin;
    const std::size_t bins = std::min<std::size_t>(8 + list.size() / 20, 32);
    Plane best;
    best.larger = list.size();
    if (extent < 1e-30f) return best;
    const float scale = 0.99999f * static_cast<float>(bins) / extent;
    for (std::size_t last = 0; last + 1 < bins; ++last) {
        Plane plane;
        std::array<Aabb, 2> box{empty_box(), empty_box()};
        std::array<std::size_t, 2> count{};
        for (const std::size_t i : list) {
            const bool left = static_cast<std::size_t>((center2(i) - origin) * scale) <= last;
            plane.goes_left.push_back(left);
            box[left ? 0 : 1] = unite(box[left ? 0 : 1], forest.all[i].box);
            ++count[left ? 0 : 1];
        }
        if (count[0] == 0 || count[1] == 0) continue;
        plane.cost = area(box[0]) * static_cast<float>(count[0]) +
                     area(box[1]) * static_cast<float>(count[1]);
        plane.larger = std::max(count[0], count[1]);
        if (by_count ? plane.larger < best.larger : plane.cost < best.cost) best = plane;
    }
    return best;
}

float cost_of(const Forest& forest, const List& list, const std::vector<bool>& goes_left) {
    std::array<Aabb, 2> box{empty_box(), empty_box()};
    std::array<std::size_t, 2> count{};
    for (std::size_t k = 0; k < list.size(); ++k) {
        const std::size_t side = goes_left[k] ? 0 : 1;
        box[side] = unite(box[side], forest.all[list[k]].box);
        ++count[side];
    }
    if (count[0] == 0 || count[1] == 0) return std::numeric_limits<float>::infinity();
    return area(box[0]) * static_cast<float>(count[0]) +
           area(box[1]) * static_cast<float>(count[1]);
}

/// Up to 5: every division; up to 16: every plane through a centroid. None that costs 0.
Plane best_of_small(const Forest& forest, const List& list) {
    Plane best;
    const std::size_t n = list.size();
    if (n < 3) return best;
    const auto offer = [&](const auto& is_left) {
        std::vector<bool> goes_left;
        for (std::size_t k = 0; k < n; ++k) goes_left.push_back(is_left(k));
        if (const float cost = cost_of(forest, list, goes_left); cost < best.cost) {
            best.cost = cost;
            best.goes_left = goes_left;
        }
    };
    if (n <= 5) {
        for (std::size_t left = 1; left < std::size_t{1} << (n - 1); ++left)
            offer([&](std::size_t k) { return (left >> k & 1) != 0; });
    } else {
        for (int axis = 0; axis < 3; ++axis) {
            const auto center2 = [&](std::size_t k) {
                const Aabb& box = forest.all[list[k]].box;
                return coordinate(box.lo, axis) + coordinate(box.hi, axis);
            };
            for (std::size_t plane = 0; plane < n; ++plane)
                offer([&](std::size_t k) { return center2(k) <= center2(plane); });
        }
    }
    if (best.cost == 0) best.goes_left.clear();
    return best;
}

std::size_t binned(Forest& forest, const List& list, int depth) {
    if (list.size() == 1) return list[0];
    Plane best;
    if (list.size() <= 16) {
        best = best_of_small(forest, list);
    } else if (depth < 96) {
        for (int axis = 0; axis < 3; ++axis)
            if (Plane plane = best_plane(forest, list, axis, false); plane.cost < best.cost)
                best = std::move(plane);
        if (best.cost == 0) {
            best.larger = list.size();
            for (int axis = 0; axis < 3; ++axis)
                if (Plane plane = best_plane(forest, list, axis, true); plane.larger < best.larger)
                    best = std::move(plane);
        }
    }
    std::array<List, 2> sides;
    for (std::size_t k = 0; k < list.size(); ++k) {
        const bool left = best.goes_left.empty() ? k < list.size() / 2 : best.goes_left[k];
        sides[left ? 0 : 1].push_back(list[k]);
    }
    const std::size_t left = binned(forest, sides[0], depth + 1);
    return forest.merge(left, binned(forest, sides[1], depth + 1));
}

}  // namespace

Bvh reference_binned(std::span<const Aabb> boxes, const BuildOptions& options) {
    return reference(boxes, options, [](Forest& forest, const std::vector<Item>& items) {
        List list(items.size());
        for (std::size_t i = 0; i < list.size(); ++i) list[i] = i;
        return binned(forest, list, 0);
    });
}

Bvh reference_ploc(std::span<const Aabb> boxes, const BuildOptions& options) {
    return reference(boxes, options, [](Forest& forest, const std::vector<Item>& items) {
        List list(items.size());
        for (std::size_t i = 0; i < list.size(); ++i) list[i] = i;
        bool slow = false;
        while (list.size() > 1) {
            List next = forest.round(list, slow);
            slow = list.size() > 1024 && list.size() - next.size() < list.size() / 16;
            list = std::move(next);
        }
        return list[0];
    });
}

Bvh reference_hploc(std::span<const Aabb> boxes, const BuildOptions& options) {
    return reference(boxes, options, [](Forest& forest, const std::vector<Item>& items) {
        return hierarchical(forest, items, 0, items.size())[0];
    });
}

}  // namespace raydix::test
