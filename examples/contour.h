// The surface where a function is 0, as triangles, in the finest cells of an octree of points and
// the cells around those; and what the edges of a mesh say of it.
#pragma once

#include <raydix/octree.h>
#include <raydix/raydix.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "vec.h"

namespace example {

struct EdgeCount {
    std::size_t open = 0;     // edges of one triangle
    std::size_t crowded = 0;  // of more than two
    std::size_t against = 0;  // of two that turn against each other
    long long euler = 0;      // corners - edges + triangles
};

inline EdgeCount count_edges(const raydix::Mesh& mesh) {
    struct Edge {
        std::uint32_t low, high;
        int way;
    };
    std::vector<Edge> edges;
    std::vector<char> used(mesh.vertices.size(), 0);
    for (const raydix::Triangle& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k) {
            const std::uint32_t a = t[k], b = t[(k + 1) % 3];
            edges.push_back({std::min(a, b), std::max(a, b), a < b ? 1 : -1});
            used[a] = 1;
        }
    std::ranges::sort(edges, [](const Edge& a, const Edge& b) {
        return a.low != b.low ? a.low < b.low : a.high < b.high;
    });
    EdgeCount count;
    count.euler = std::ranges::count(used, 1) + static_cast<long long>(mesh.triangles.size());
    for (std::size_t i = 0, end = 0; i < edges.size(); i = end, --count.euler) {
        int way = 0;
        for (end = i; end < edges.size() && edges[end].low == edges[i].low &&
                      edges[end].high == edges[i].high;
             ++end)
            way += edges[end].way;
        count.open += end - i == 1;
        count.crowded += end - i > 2;
        count.against += end - i == 2 && way != 0;
    }
    return count;
}

/// Cells are cut in six tetrahedra along one diagonal (Kuhn): faces of neighbours are cut alike, so
/// the surface has no crack and each edge inside has two triangles.
class Contour {
public:
    /// `distances(places)`: values at places, negative inside, all in one call.
    template <class Distances>
    Contour(std::span<const Vec3> points, int level, const Distances& distances) {
        find_cells(points, level);
        std::vector<Key> corners;
        for (const Key cell : cells_)
            for (std::uint32_t k = 0; k < 8; ++k) corners.push_back(moved(cell, k));
        corners_ = unique(std::move(corners));
        places_.reserve(corners_.size());
        for (const Key corner : corners_) places_.push_back(place(corner));
        values_ = distances(std::span<const Vec3>(places_));
        for (const Key cell : cells_) cut(cell);
        weld();
    }

    [[nodiscard]] const raydix::Mesh& mesh() const { return mesh_; }
    [[nodiscard]] std::size_t cells() const { return cells_.size(); }
    [[nodiscard]] float cell_size() const { return size_; }

private:
    /// Three coordinates of 21 bits, moved by 2 so that cells around the root have one too.
    using Key = std::uint64_t;
    static Key key(std::int64_t x, std::int64_t y, std::int64_t z) {
        return static_cast<Key>(x + 2) << 42 | static_cast<Key>(y + 2) << 21 |
               static_cast<Key>(z + 2);
    }
    /// By one along the axes whose bit is set: 4 x + 2 y + z.
    static Key moved(Key from, std::uint32_t axes) {
        return from + ((axes & 4) != 0 ? Key{1} << 42 : 0) + ((axes & 2) != 0 ? Key{1} << 21 : 0) +
               (axes & 1);
    }
    [[nodiscard]] Vec3 place(Key at) const {
        const auto coordinate = [&](int shift) {
            return static_cast<float>(static_cast<std::int64_t>(at >> shift & 0x1FFFFF) - 2);
        };
        return lo_ + size_ * Vec3{coordinate(42), coordinate(21), coordinate(0)};
    }
    static std::vector<Key> unique(std::vector<Key> keys) {
        std::ranges::sort(keys);
        keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
        return keys;
    }

    /// Of each leaf of the octree the finest cell that its points are in, and all that touch it.
    void find_cells(std::span<const Vec3> points, int level) {
        const raydix::Octree octree =
            raydix::build_octree(points, {.max_level = level, .max_leaf = 1});
        const raydix::Aabb root = raydix::node_box(octree, 0);
        const float edge =
            std::max({root.hi.x - root.lo.x, root.hi.y - root.lo.y, root.hi.z - root.lo.z});
        const int side = 1 << level;
        lo_ = root.lo, size_ = edge / static_cast<float>(side);
        const auto cell = [&](float p, float lo) {
            return std::clamp(static_cast<int>((p - lo) / size_), 0, side - 1);
        };
        std::vector<Key> keys;
        for (const raydix::OctreeNode& node : octree.nodes()) {
            if (!node.is_leaf()) continue;
            const Vec3 p = octree.points()[node.first_point];
            const int x = cell(p.x, lo_.x), y = cell(p.y, lo_.y), z = cell(p.z, lo_.z);
            for (int k = 0; k < 27; ++k)
                keys.push_back(key(x + k / 9 - 1, y + k / 3 % 3 - 1, z + k % 3 - 1));
        }
        cells_ = unique(std::move(keys));
    }

    void cut(Key cell) {
        std::array<std::uint32_t, 8> corners{};
        for (std::uint32_t k = 0; k < 8; ++k)
            corners[k] = static_cast<std::uint32_t>(
                std::ranges::lower_bound(corners_, moved(cell, k)) - corners_.begin());
        constexpr std::uint32_t ways[6][2] = {{4, 2}, {2, 1}, {1, 4}, {2, 4}, {1, 2}, {4, 1}};
        for (int k = 0; k < 6; ++k) {
            const std::uint32_t first = ways[k][0], second = first | ways[k][1];
            cut({corners[0], corners[first], corners[second], corners[7]}, k >= 3);
        }
    }
    /// `mirrored`: the corners are in the order of a left-handed tetrahedron.
    void cut(std::array<std::uint32_t, 4> corners, bool mirrored) {
        const auto inside = [&](std::uint32_t corner) { return values_[corner] < 0; };
        // Those inside come first; each exchange mirrors the order.
        for (int end = 3; end > 0; --end)
            for (std::size_t k = 0; k < static_cast<std::size_t>(end); ++k)
                if (!inside(corners[k]) && inside(corners[k + 1])) {
                    std::swap(corners[k], corners[k + 1]);
                    mirrored = !mirrored;
                }
        const auto [a, b, c, d] = corners;
        switch (std::ranges::count_if(corners, inside)) {
            case 1:
                return add({edge(a, b), edge(a, c), edge(a, d)}, mirrored);
            case 2:
                add({edge(a, c), edge(a, d), edge(b, d)}, mirrored);
                return add({edge(a, c), edge(b, d), edge(b, c)}, mirrored);
            case 3:
                return add({edge(a, d), edge(b, d), edge(c, d)}, mirrored);
            default:
                return;
        }
    }
    static Key edge(std::uint32_t a, std::uint32_t b) {
        return static_cast<Key>(std::min(a, b)) << 32 | std::max(a, b);
    }
    void add(std::array<Key, 3> triangle, bool mirrored) {
        if (mirrored) std::swap(triangle[1], triangle[2]);
        triangles_.push_back(triangle);
    }

    /// One vertex for each edge of the grid that is cut, where the function is 0 along it.
    void weld() {
        std::vector<Key> edges;
        for (const std::array<Key, 3>& t : triangles_)
            edges.insert(edges.end(), t.begin(), t.end());
        edges = unique(std::move(edges));
        for (const Key e : edges) {
            const std::size_t a = e >> 32, b = e & 0xFFFFFFFFu;
            // Kept off the ends, where triangles would have no area.
            const float t = std::clamp(values_[a] / (values_[a] - values_[b]), 0.02f, 0.98f);
            mesh_.vertices.push_back((1 - t) * places_[a] + t * places_[b]);
        }
        for (const std::array<Key, 3>& t : triangles_) {
            raydix::Triangle corners{};
            for (std::size_t k = 0; k < 3; ++k)
                corners[k] = static_cast<std::uint32_t>(std::ranges::lower_bound(edges, t[k]) -
                                                        edges.begin());
            mesh_.triangles.push_back(corners);
        }
    }

    Vec3 lo_{};
    float size_ = 0;
    std::vector<Key> cells_, corners_;
    std::vector<Vec3> places_;
    std::vector<float> values_;
    std::vector<std::array<Key, 3>> triangles_;  // by the edges of the grid that they cut
    raydix::Mesh mesh_;
};

}  // namespace example
