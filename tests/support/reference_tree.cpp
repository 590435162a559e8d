#include "support/reference_tree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "base/math.h"
#include "tree/bvh_internals.h"

namespace raydix::test {
namespace {

struct KeyedPrimitive {
    std::uint64_t code;
    std::uint32_t primitive_id;
    Aabb box;
};

bool usable(const Aabb& box) {
    if (!in_range(box.lo) || !in_range(box.hi) || is_empty(box)) return false;
    const double x = double(box.hi.x) - box.lo.x, y = double(box.hi.y) - box.lo.y,
                 z = double(box.hi.z) - box.lo.z;
    const double squared = x * x + y * y + z * z;
    return squared == 0 || std::sqrt(squared) >= double(min_diagonal);
}

std::uint64_t cell_of(float center, float lo, float scale, int bits_per_axis) {
    const float cell = std::floor((center - lo) * scale);
    const std::uint64_t last = (std::uint64_t{1} << bits_per_axis) - 1;
    return cell >= static_cast<float>(last) ? last : static_cast<std::uint64_t>(cell);
}

struct Builder {
    const std::vector<KeyedPrimitive>& items;
    std::size_t max_leaf;
    std::vector<BvhNode> nodes;
    std::uint32_t inner_count = 0;
    std::uint32_t max_depth = 0;

    /// The first position of the right half of [begin, end): where the highest bit that differs
    /// between the first and the last key turns to 1. Equal codes are told apart by their
    /// positions.
    std::size_t split(std::size_t begin, std::size_t end) const {
        const bool equal = items[begin].code == items[end - 1].code;
        const auto key = [&](std::size_t i) { return equal ? std::uint64_t{i} : items[i].code; };
        std::uint64_t bit = std::uint64_t{1} << 63;
        while (((key(begin) ^ key(end - 1)) & bit) == 0) bit >>= 1;
        std::size_t i = begin;
        while ((key(i) & bit) == 0) ++i;
        return i;
    }

    void build(std::size_t slot, std::size_t begin, std::size_t end, std::uint32_t depth) {
        max_depth = std::max(max_depth, depth);
        Aabb box = empty_box();
        std::uint32_t first = static_cast<std::uint32_t>(begin), count = 0;
        if (end - begin <= max_leaf) {
            count = static_cast<std::uint32_t>(end - begin);
            for (std::size_t i = begin; i < end; ++i) box = unite(box, items[i].box);
        } else {
            ++inner_count;
            first = static_cast<std::uint32_t>(nodes.size());
            nodes.resize(nodes.size() + 2);
            const std::size_t middle = split(begin, end);
            build(first, begin, middle, depth + 1);
            build(first + 1, middle, end, depth + 1);
            for (const std::size_t child : {first, first + 1})
                box = unite(box, {nodes[child].lo, nodes[child].hi});
        }
        nodes[slot] = {box.lo, first, box.hi, count};
    }
};

/// boxes [input primitives], unusable ones included -> everything but the copied primitives.
Bvh build(const std::vector<Aabb>& boxes, PrimitiveKind kind, const BuildOptions& options) {
    std::vector<KeyedPrimitive> items;
    Aabb scene = empty_box();
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        if (!usable(boxes[i])) continue;
        scene = unite(scene, boxes[i]);
        items.push_back({0, static_cast<std::uint32_t>(i), boxes[i]});
    }
    for (KeyedPrimitive& item : items) item.code = reference_code(item.box, scene, options.bits);
    std::stable_sort(
        items.begin(), items.end(),
        [](const KeyedPrimitive& a, const KeyedPrimitive& b) { return a.code < b.code; });

    Builder builder{items, static_cast<std::size_t>(options.max_leaf), {}};
    if (!items.empty()) {
        builder.nodes.resize(2, BvhNode{});
        builder.build(0, 0, items.size(), 0);
    }
    Bvh bvh;
    const BvhInternals access{bvh};
    access.nodes().reset(builder.nodes.size());
    std::ranges::copy(builder.nodes, access.nodes().data());
    access.order().reset(items.size());
    for (std::size_t i = 0; i < items.size(); ++i) access.order()[i] = items[i].primitive_id;
    access.kind() = kind;
    access.options() = options;
    access.inner_count() = builder.inner_count;
    access.max_depth() = builder.max_depth;
    access.input_count() = boxes.size();
    access.left_out() = boxes.size() - items.size();
    return bvh;
}

Aabb clean(const Aabb& b) { return {without_negative_zero(b.lo), without_negative_zero(b.hi)}; }

}  // namespace

std::uint64_t reference_code(const Aabb& box, const Aabb& scene, int bits) {
    const int bits_per_axis = bits / 3;
    const Vec3 c = center_of(box), edges = scene.hi - scene.lo;
    const float longest = std::max({edges.x, edges.y, edges.z});
    if (longest == 0) return 0;
    // The quotient of a scene thinner than 1e-32 is beyond float: the largest one stands in for it.
    const float scale =
        std::min(std::ldexp(1.0f, bits_per_axis) / longest, std::numeric_limits<float>::max());
    const std::array<std::uint64_t, 3> cells{cell_of(c.x, scene.lo.x, scale, bits_per_axis),
                                             cell_of(c.y, scene.lo.y, scale, bits_per_axis),
                                             cell_of(c.z, scene.lo.z, scale, bits_per_axis)};
    std::uint64_t code = 0;
    for (int bit = bits_per_axis - 1; bit >= 0; --bit)
        for (const std::uint64_t cell : cells) code = code << 1 | (cell >> bit & 1);
    return code;
}

Bvh reference_tree(const MeshView& mesh, const BuildOptions& options) {
    if (mesh.triangles.empty()) return reference_tree(mesh.vertices, options);
    const auto vertex = [&](std::uint32_t i) { return without_negative_zero(mesh.vertices[i]); };
    std::vector<Aabb> boxes;
    for (const Triangle& t : mesh.triangles) {
        const std::array<Vec3, 3> v{vertex(t[0]), vertex(t[1]), vertex(t[2])};
        const bool fit = in_range(v[0]) && in_range(v[1]) && in_range(v[2]);
        boxes.push_back(fit ? box_of(v[0], v[1], v[2]) : empty_box());
    }
    Bvh bvh = build(boxes, PrimitiveKind::triangles, options);
    auto& corners = BvhInternals{bvh}.triangles();
    corners.reset(bvh.order().size());
    for (std::size_t i = 0; i < bvh.order().size(); ++i) {
        const Triangle& t = mesh.triangles[bvh.order()[i]];
        corners[i] = {vertex(t[0]), vertex(t[1]), vertex(t[2])};
    }
    return bvh;
}

Bvh reference_tree(std::span<const Aabb> input, const BuildOptions& options) {
    std::vector<Aabb> boxes;
    for (const Aabb& box : input) boxes.push_back(clean(box));
    Bvh bvh = build(boxes, PrimitiveKind::boxes, options);
    BvhInternals{bvh}.boxes().reset(bvh.order().size());
    for (std::size_t i = 0; i < bvh.order().size(); ++i)
        BvhInternals{bvh}.boxes()[i] = boxes[bvh.order()[i]];
    return bvh;
}

Bvh reference_tree(std::span<const Vec3> input, const BuildOptions& options) {
    std::vector<Aabb> boxes;
    for (const Vec3& p : input) boxes.push_back(clean({p, p}));
    Bvh bvh = build(boxes, PrimitiveKind::points, options);
    BvhInternals{bvh}.points().reset(bvh.order().size());
    for (std::size_t i = 0; i < bvh.order().size(); ++i)
        BvhInternals{bvh}.points()[i] = boxes[bvh.order()[i]].lo;
    return bvh;
}

}  // namespace raydix::test
