// What a rank holds of a scene: meshes in a scene of raydix, and the names of their triangles in
// the whole.
#pragma once

#include <raydix/bvh.h>
#include <raydix/double.h>
#include <raydix/mpi.h>
#include <raydix/scene.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "mpi/rank_tree.h"

namespace raydix::mpi {

/// A triangle's name in the whole; names are in the order of ties.
struct TriangleName {
    std::uint32_t geometry;
    std::uint64_t prim;

    friend auto operator<=>(const TriangleName&, const TriangleName&) = default;
};

/// Names of the triangles of a rank's own meshes, by their ids there.
class TriangleNames {
public:
    /// A mesh whose triangles count on from `first`.
    void add_mesh(TriangleName first) { meshes_.push_back({first, none}); }
    /// A mesh whose triangles have names of their own.
    void add_mesh(std::span<const TriangleName> names) {
        meshes_.push_back({{}, triangles_.size()});
        triangles_.insert(triangles_.end(), names.begin(), names.end());
    }
    /// An id that no mesh has.
    void skip() { add_mesh(TriangleName{}); }
    [[nodiscard]] TriangleName of(std::uint32_t geometry, std::uint32_t prim) const {
        const NamesOfMesh& mesh = meshes_[geometry];
        if (mesh.begin != none) return triangles_[mesh.begin + prim];
        return {mesh.first.geometry, mesh.first.prim + prim};
    }
    [[nodiscard]] std::uint64_t bytes() const {
        return meshes_.size() * sizeof(NamesOfMesh) + triangles_.size() * sizeof(TriangleName);
    }

private:
    static constexpr std::size_t none = std::size_t(-1);
    struct NamesOfMesh {
        TriangleName first;
        std::size_t begin;  // in triangles_
    };
    std::vector<NamesOfMesh> meshes_;
    std::vector<TriangleName> triangles_;
};

/// A triangle that moves to another rank.
template <class T>
struct MovingTriangle {
    using Point = BasicVec3<T>;
    Point corners[3];
    std::uint32_t mask;
    TriangleName name;
};

/// Finite and within the range of coordinates (contract.md 1).
template <class Point>
[[nodiscard]] bool is_in_range(const Point& p) {
    const auto within = [](auto x) { return std::fabs(x) <= decltype(x)(1e12); };
    return within(p.x) && within(p.y) && within(p.z);
}

/// Around a triangle; empty if one of its corners is not in range.
template <class T, class Point>
[[nodiscard]] RankBox<T> box_of_corners(const Point& a, const Point& b, const Point& c) {
    RankBox<T> box = RankBox<T>::empty();
    for (const Point* p : {&a, &b, &c}) {
        if (!is_in_range(*p)) return RankBox<T>::empty();
        box.unite({{p->x, p->y, p->z}, {p->x, p->y, p->z}});
    }
    return box;
}

/// Boxes around all of `boxes`, at most `most`: halved at medians. Empty ones are left out.
template <class T>
[[nodiscard]] std::vector<RankBox<T>> cover(std::vector<RankBox<T>> boxes, std::size_t most) {
    struct Halving {
        std::vector<RankBox<T>>& boxes;
        std::vector<RankBox<T>> found;

        void divide(std::size_t begin, std::size_t end, std::size_t parts) {
            RankBox<T> box = RankBox<T>::empty();
            for (std::size_t i = begin; i < end; ++i) box.unite(boxes[i]);
            if (parts < 2 || end - begin < 2) return found.push_back(box);
            const std::size_t middle = begin + (end - begin) / 2;
            const int axis = box.longest_axis();
            const auto at = [&](std::size_t i) {
                return boxes.begin() + static_cast<std::ptrdiff_t>(i);
            };
            std::nth_element(at(begin), at(middle), at(end), [axis](const auto& a, const auto& b) {
                return a.lo[axis] + a.hi[axis] < b.lo[axis] + b.hi[axis];
            });
            divide(begin, middle, parts / 2);
            divide(middle, end, parts - parts / 2);
        }
    };
    std::erase_if(boxes, [](const RankBox<T>& box) { return !(box.lo[0] <= box.hi[0]); });
    Halving halving{boxes, {}};
    if (!boxes.empty()) halving.divide(0, boxes.size(), most);
    return halving.found;
}

}  // namespace raydix::mpi
