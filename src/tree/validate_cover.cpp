// A triangle is cut at faces of the boxes until each piece lies in one of them, or meets none.
#include "tree/validate_cover.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/math.h"
#include "exec/search.h"
#include "tree/clip.h"
#include "tree/validate.h"

namespace raydix {
namespace {

/// Part of the largest coordinate by which corners of pieces may be off. A gap of one float is
/// larger.
constexpr double slack_of_coordinate = 0x1p-44;

struct Extent {
    Polygon::Point lo, hi;
};

class CoverSearch {
public:
    CoverSearch(const LeafTriangle& t, std::size_t boxes) : patience_(1024 + 256 * boxes) {
        for (const Vec3& p : {t.v0, t.v1, t.v2})
            for (const float x : {p.x, p.y, p.z}) slack_ = std::max(slack_, std::fabs(double(x)));
        slack_ *= slack_of_coordinate;
    }

    bool covered(const Polygon& piece, const std::vector<Aabb>& boxes) {
        const Extent extent = extent_of(piece);
        std::vector<Aabb> near;
        if (patience_ < boxes.size()) return false;
        patience_ -= boxes.size();
        for (const Aabb& box : boxes) {
            if (holds(box, extent)) return true;
            if (meets(box, extent)) near.push_back(box);
        }
        std::size_t axis = 0;
        double plane = 0;
        if (near.empty() || !find_face(near, extent, axis, plane)) return is_point(extent);
        for (const double sign : {1.0, -1.0}) {
            const Polygon half = clip(piece, axis, plane, sign);
            // Cut again and again, a piece gains no more than a corner per face of a box.
            if (half.count + 2 > half.corners.size()) return false;
            if (half.count != 0 && !covered(half, near)) return false;
        }
        return true;
    }

private:
    static Extent extent_of(const Polygon& piece) {
        Extent e{piece.corners[0], piece.corners[0]};
        for (std::size_t i = 1; i < piece.count; ++i)
            for (std::size_t k = 0; k < 3; ++k) {
                e.lo[k] = std::min(e.lo[k], piece.corners[i][k]);
                e.hi[k] = std::max(e.hi[k], piece.corners[i][k]);
            }
        return e;
    }
    static double lo(const Aabb& box, std::size_t k) { return (&box.lo.x)[k]; }
    static double hi(const Aabb& box, std::size_t k) { return (&box.hi.x)[k]; }

    [[nodiscard]] bool holds(const Aabb& box, const Extent& e) const {
        for (std::size_t k = 0; k < 3; ++k)
            if (e.lo[k] < lo(box, k) - slack_ || e.hi[k] > hi(box, k) + slack_) return false;
        return true;
    }
    [[nodiscard]] bool meets(const Aabb& box, const Extent& e) const {
        for (std::size_t k = 0; k < 3; ++k)
            if (e.hi[k] < lo(box, k) - slack_ || e.lo[k] > hi(box, k) + slack_) return false;
        return true;
    }
    [[nodiscard]] bool is_point(const Extent& e) const {
        for (std::size_t k = 0; k < 3; ++k)
            if (e.hi[k] - e.lo[k] > 4 * slack_) return false;
        return true;
    }
    /// Of all faces that cut the piece the one nearest to its middle, in parts of its size: halves
    /// are the fastest way down to many boxes.
    [[nodiscard]] bool find_face(const std::vector<Aabb>& boxes, const Extent& e, std::size_t& axis,
                                 double& plane) const {
        double best = 0.5;
        for (const Aabb& box : boxes)
            for (std::size_t k = 0; k < 3; ++k)
                for (const double at : {lo(box, k), hi(box, k)}) {
                    if (!(at > e.lo[k] + slack_ && at < e.hi[k] - slack_)) continue;
                    const double off = std::fabs((at - e.lo[k]) / (e.hi[k] - e.lo[k]) - 0.5);
                    if (off >= best) continue;
                    best = off;
                    axis = k;
                    plane = at;
                }
        return best < 0.5;
    }

    double slack_ = 0;
    std::size_t patience_;
};

}  // namespace

bool boxes_cover(const LeafTriangle& triangle, std::span<const Aabb> boxes) {
    return CoverSearch(triangle, boxes.size())
        .covered(polygon_of(triangle.v0, triangle.v1, triangle.v2), {boxes.begin(), boxes.end()});
}

Fault validate_cover(const Bvh& bvh) {
    if (!may_split_primitives(bvh) || bvh.triangles().empty()) return {};
    struct Held {
        std::uint32_t primitive_id, position, leaf;
    };
    std::vector<Held> held(bvh.order().size());
    const std::span<const BvhNode> nodes = bvh.nodes();
    for (std::uint32_t i = 0; i < nodes.size(); ++i)
        for (std::uint32_t k = 0; k < nodes[i].count; ++k) {
            const std::uint32_t position = nodes[i].first + k;
            held[position] = {bvh.order()[position], position, i};
        }
    std::sort(held.begin(), held.end(), [](const Held& a, const Held& b) {
        return a.primitive_id != b.primitive_id ? a.primitive_id < b.primitive_id
                                                : a.position < b.position;
    });
    const std::size_t bad = first_index_where(held.size(), [&](std::size_t i) {
        const std::uint32_t id = held[i].primitive_id;
        if (i != 0 && held[i - 1].primitive_id == id) return false;
        std::vector<Aabb> boxes;
        for (std::size_t k = i; k < held.size() && held[k].primitive_id == id; ++k)
            boxes.push_back({nodes[held[k].leaf].lo, nodes[held[k].leaf].hi});
        return !boxes_cover(bvh.triangles()[held[i].position], boxes);
    });
    if (bad == held.size()) return {};
    return "nodes: the boxes of the leaves that hold primitive " +
           std::to_string(held[bad].primitive_id) + " do not cover it";
}

}  // namespace raydix
