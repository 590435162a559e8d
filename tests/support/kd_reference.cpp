#include "support/kd_reference.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "base/math.h"
#include "tree/kdtree_internals.h"

namespace raydix::test {
namespace {

using Cells = std::array<std::uint64_t, 3>;

struct KdItem {
    Cells cells;
    std::uint32_t id;
    Aabb box;
    LeafTriangle corners;
};

float at(Vec3 v, std::size_t axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

struct ReferenceGrid {
    Vec3 lo{};
    float scale = 0;
    std::uint64_t last = 0;

    ReferenceGrid(const Aabb& scene, int bits_per_axis)
        : lo(scene.lo), last((std::uint64_t{1} << bits_per_axis) - 1) {
        const Vec3 edges = scene.hi - scene.lo;
        const float longest = std::max({edges.x, edges.y, edges.z});
        if (longest > 0)
            scale = std::min(std::ldexp(1.0f, bits_per_axis) / longest,
                             std::numeric_limits<float>::max());
    }
    [[nodiscard]] std::uint64_t cell(float center, std::size_t axis) const {
        const float place = std::floor((center - at(lo, axis)) * scale);
        return place >= static_cast<float>(last) ? last : static_cast<std::uint64_t>(place);
    }
    /// The least float in `cell`, between a centre below it and one in it or above: halving the
    /// gap in double until no float is left inside.
    [[nodiscard]] float first_in(std::uint64_t wanted, float below, float above,
                                 std::size_t axis) const {
        while (std::nextafter(below, above) != above) {
            auto middle = static_cast<float>(0.5 * (double(below) + double(above)));
            if (middle <= below || middle >= above) middle = std::nextafter(below, above);
            (cell(middle, axis) >= wanted ? above : below) = middle;
        }
        return above + 0.0f;
    }
};

class Builder {
public:
    Builder(std::vector<KdItem>& items, const ReferenceGrid& grid, const KdTreeOptions& options)
        : items_(items),
          grid_(grid),
          bits_(options.bits),
          max_leaf_(static_cast<std::size_t>(options.max_leaf)),
          nodes_(2, KdNode{}) {
        build(0, 0, items.size(), 0, 0);
    }
    [[nodiscard]] const std::vector<KdNode>& nodes() const { return nodes_; }
    [[nodiscard]] std::uint32_t max_depth() const { return max_depth_; }

private:
    struct Split {
        std::size_t middle, axis;
        float plane;
        int halvings;
    };

    /// Halves space until both halves hold something; `halvings` are done already.
    Split split(std::size_t begin, std::size_t end, int halvings) const {
        for (; halvings < bits_; ++halvings) {
            const auto axis = static_cast<std::size_t>(halvings % 3);
            const int bit = bits_ / 3 - 1 - halvings / 3;
            std::size_t middle = begin;
            while (middle < end && (items_[middle].cells[axis] >> bit & 1) == 0) ++middle;
            if (middle == begin || middle == end) continue;
            float below = -infinity, above = infinity;
            for (std::size_t i = begin; i < end; ++i) {
                const float center = at(center_of(items_[i].box), axis);
                if (i < middle)
                    below = std::max(below, center);
                else
                    above = std::min(above, center);
            }
            const std::uint64_t cell = items_[middle].cells[axis] >> bit << bit;
            return {middle, axis, grid_.first_in(cell, below, above, axis), halvings};
        }
        // All in one cell: the positions are halved where their highest differing bit turns to 1.
        int shared = 0;
        std::uint32_t bit = 1u << 31;
        const auto first = static_cast<std::uint32_t>(begin),
                   last = static_cast<std::uint32_t>(end - 1);
        for (; ((first ^ last) & bit) == 0; bit >>= 1) ++shared;
        return {last & ~(bit - 1), static_cast<std::size_t>((bits_ + shared) % 3), infinity, bits_};
    }

    Aabb build(std::size_t slot, std::size_t begin, std::size_t end, int halvings,
               std::uint32_t depth) {
        max_depth_ = std::max(max_depth_, depth);
        if (end - begin <= max_leaf_) {
            nodes_[slot].first = static_cast<std::uint32_t>(begin);
            nodes_[slot].link = static_cast<std::uint32_t>(end - begin) << 2 | KdNode::leaf_axis;
            Aabb box = empty_box();
            for (std::size_t i = begin; i < end; ++i) box = unite(box, items_[i].box);
            return box;
        }
        const Split s = split(begin, end, halvings);
        const std::size_t child = nodes_.size();
        nodes_[slot].plane = s.plane;
        nodes_[slot].link =
            static_cast<std::uint32_t>((child - 2) / 2) << 2 | static_cast<std::uint32_t>(s.axis);
        nodes_.resize(child + 2, KdNode{});
        const Aabb left = build(child, begin, s.middle, s.halvings + 1, depth + 1);
        const Aabb right = build(child + 1, s.middle, end, s.halvings + 1, depth + 1);
        nodes_[child].lo = at(left.lo, s.axis);
        nodes_[child].hi = at(left.hi, s.axis);
        nodes_[child + 1].lo = at(right.lo, s.axis);
        nodes_[child + 1].hi = at(right.hi, s.axis);
        return unite(left, right);
    }

    std::vector<KdItem>& items_;
    const ReferenceGrid& grid_;
    int bits_;
    std::size_t max_leaf_;
    std::vector<KdNode> nodes_;
    std::uint32_t max_depth_ = 0;
};

/// Order of the interleaved codes, without making them: bit by bit, x first; then by id.
bool code_before(const KdItem& a, const KdItem& b, int bits) {
    for (int bit = bits / 3 - 1; bit >= 0; --bit)
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const auto x = a.cells[axis] >> bit & 1, y = b.cells[axis] >> bit & 1;
            if (x != y) return x < y;
        }
    return a.id < b.id;
}

std::vector<KdItem> items_of(const MeshView& mesh) {
    std::vector<KdItem> items;
    const auto add = [&](std::uint32_t id, Vec3 a, Vec3 b, Vec3 c) {
        if (!in_range(a) || !in_range(b) || !in_range(c) || !diagonal_in_range(box_of(a, b, c)))
            return;
        items.push_back({{}, id, box_of(a, b, c), {a, b, c}});
    };
    const auto vertex = [&](std::uint32_t i) { return without_negative_zero(mesh.vertices[i]); };
    if (mesh.triangles.empty())
        for (std::uint32_t i = 0; i < mesh.vertices.size(); ++i)
            add(i, vertex(i), vertex(i), vertex(i));
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
        const Triangle& t = mesh.triangles[i];
        add(i, vertex(t[0]), vertex(t[1]), vertex(t[2]));
    }
    return items;
}

}  // namespace

KdTree reference_kdtree(const MeshView& mesh, const KdTreeOptions& options) {
    std::vector<KdItem> items = items_of(mesh);
    const bool points = mesh.triangles.empty();
    KdTree tree;
    const KdTreeInternals access{tree};
    access.kind() = points ? PrimitiveKind::points : PrimitiveKind::triangles;
    access.options() = options;
    access.input_count() = points ? mesh.vertices.size() : mesh.triangles.size();
    access.left_out() = access.input_count() - items.size();
    if (items.empty()) return tree;
    for (const KdItem& item : items) access.bounds() = unite(tree.bounds(), item.box);
    const ReferenceGrid grid(tree.bounds(), options.bits / 3);
    for (KdItem& item : items)
        for (std::size_t axis = 0; axis < 3; ++axis)
            item.cells[axis] = grid.cell(at(center_of(item.box), axis), axis);
    std::ranges::sort(
        items, [&](const KdItem& a, const KdItem& b) { return code_before(a, b, options.bits); });
    const Builder builder(items, grid, options);
    access.nodes().reset(builder.nodes().size());
    std::ranges::copy(builder.nodes(), access.nodes().data());
    access.inner_count() = static_cast<std::uint32_t>(builder.nodes().size() / 2 - 1);
    access.max_depth() = builder.max_depth();
    access.order().reset(items.size());
    if (points)
        access.points().reset(items.size());
    else
        access.triangles().reset(items.size());
    for (std::size_t i = 0; i < items.size(); ++i) {
        access.order()[i] = items[i].id;
        if (points)
            access.points()[i] = items[i].corners.v0;
        else
            access.triangles()[i] = items[i].corners;
    }
    return tree;
}

std::vector<KdNeighbor> nearest_of_all(std::span<const Vec3> points, std::span<const Vec3> queries,
                                       std::uint32_t k) {
    std::vector<KdNeighbor> result;
    for (const Vec3& q : queries) {
        std::vector<KdNeighbor> all;
        const bool valid = std::isfinite(q.x) && std::isfinite(q.y) && std::isfinite(q.z);
        for (std::uint32_t i = 0; valid && i < points.size(); ++i) {
            if (!in_range(points[i])) continue;
            const float dx = points[i].x - q.x, dy = points[i].y - q.y, dz = points[i].z - q.z;
            all.push_back({(dx * dx + dy * dy) + dz * dz, i});
        }
        const std::size_t kept = std::min<std::size_t>(k, all.size());
        std::ranges::partial_sort(all, all.begin() + static_cast<std::ptrdiff_t>(kept),
                                  [](const KdNeighbor& a, const KdNeighbor& b) {
                                      return a.d2 != b.d2 ? a.d2 < b.d2 : a.point < b.point;
                                  });
        all.resize(kept);
        all.resize(k, KdNeighbor{});
        result.insert(result.end(), all.begin(), all.end());
    }
    return result;
}

}  // namespace raydix::test
