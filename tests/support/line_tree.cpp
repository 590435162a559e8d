#include "support/line_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "exec/parallel.h"
#include "primitives/sources.h"
#include "trace/triangle_test.h"

namespace raydix::test {
namespace {

// Vectors of the processor at hand, where the compiler can choose at run time and nothing watches.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(RAYDIX_SANITIZED)
#define RAYDIX_WIDE_CODE __attribute__((target_clones("default", "avx2")))
#else
#define RAYDIX_WIDE_CODE
#endif

constexpr std::uint32_t is_triangle = 1u << 31;
/// Of the largest distance from the ray's origin to the box; a float test sees vertices with an
/// error of about 5e-7 of it.
constexpr double margin = 1e-5;

double at(const Vec3& p, int axis) { return (&p.x)[axis]; }

struct Line {
    double origin[3], direction[3];
};

/// Which of the boxes, widened by `margin`, the whole line passes, one bit each: looked at along
/// every axis, the line crosses the box's rectangle.
RAYDIX_WIDE_CODE unsigned boxes_on(const double (&middle)[3][8], const double (&half)[3][8],
                                   const Line& line) {
    const double* d = line.direction;
    const double ax = std::abs(d[0]), ay = std::abs(d[1]), az = std::abs(d[2]);
    long long met[8];
    for (int k = 0; k < 8; ++k) {
        const double x = middle[0][k] - line.origin[0], y = middle[1][k] - line.origin[1],
                     z = middle[2][k] - line.origin[2];
        const double rx = std::abs(x) + half[0][k], ry = std::abs(y) + half[1][k],
                     rz = std::abs(z) + half[2][k];
        const double reach = rx > ry ? rx : ry, wide = margin * (reach > rz ? reach : rz);
        const double hx = half[0][k] + wide, hy = half[1][k] + wide, hz = half[2][k] + wide;
        // A child that is not there has -infinity or NaN here: neither is at least a distance.
        met[k] = int(hx * ay + hy * ax >= std::abs(x * d[1] - y * d[0])) &
                 (hy * az + hz * ay >= std::abs(y * d[2] - z * d[1])) &
                 (hz * ax + hx * az >= std::abs(z * d[0] - x * d[2]));
    }
    unsigned bits = 0;
    for (int k = 0; k < 8; ++k) bits |= unsigned(met[k]) << k;
    return bits;
}

LeafTriangle corners_of(const TriangleSource& source, std::uint32_t i) {
    return {source.corner(i, 0), source.corner(i, 1), source.corner(i, 2)};
}

TriangleSource source_of(const MeshView& mesh) {
    return {mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
}

}  // namespace

LineTree::LineTree(const MeshView& mesh) : mesh_(mesh) {
    const TriangleSource source = source_of(mesh);
    std::vector<Vec3> centers(mesh.triangles.size());
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
        Aabb box;
        if (!source.box(i, box)) continue;
        centers[i] = center_of(box);
        ids_.push_back(i);
    }
    if (!ids_.empty()) {
        nodes_.emplace_back();
        split(0, ids_, centers);
    }
    for (const std::uint32_t i : ids_) corners_.push_back(corners_of(source, i));
}

void LineTree::split(std::uint32_t self, std::span<std::uint32_t> ids,
                     std::span<const Vec3> centers) {
    struct Part {
        std::span<std::uint32_t> ids;
        double lo[3], hi[3];
    };
    const auto part_of = [&](std::span<std::uint32_t> members) {
        Part part{members, {HUGE_VAL, HUGE_VAL, HUGE_VAL}, {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL}};
        for (const std::uint32_t i : members)
            for (const std::uint32_t vertex : mesh_.triangles[i])
                for (int k = 0; k < 3; ++k) {
                    part.lo[k] = std::min(part.lo[k], at(mesh_.vertices[vertex], k));
                    part.hi[k] = std::max(part.hi[k], at(mesh_.vertices[vertex], k));
                }
        return part;
    };
    std::vector<Part> parts{part_of(ids)};
    for (std::size_t largest = 0; parts.size() < width;) {
        for (std::size_t k = largest = 0; k < parts.size(); ++k)
            if (parts[k].ids.size() > parts[largest].ids.size()) largest = k;
        const Part& part = parts[largest];
        const std::span<std::uint32_t> members = part.ids;
        if (members.size() == 1) break;
        int axis = 0;
        for (int k = 1; k < 3; ++k)
            if (part.hi[k] - part.lo[k] > part.hi[axis] - part.lo[axis]) axis = k;
        const std::size_t middle = members.size() / 2;
        std::nth_element(members.begin(), members.begin() + std::ptrdiff_t(middle), members.end(),
                         [&](std::uint32_t a, std::uint32_t b) {
                             return at(centers[a], axis) < at(centers[b], axis);
                         });
        parts[largest] = part_of(members.first(middle));
        parts.push_back(part_of(members.subspan(middle)));
    }
    Node node{};
    for (std::size_t c = 0; c < width; ++c) {
        for (int k = 0; k < 3; ++k) {
            node.middle[k][c] = c < parts.size() ? (parts[c].lo[k] + parts[c].hi[k]) / 2 : 0;
            node.half[k][c] = c < parts.size() ? (parts[c].hi[k] - parts[c].lo[k]) / 2 : -HUGE_VAL;
        }
        if (c >= parts.size()) continue;
        if (parts[c].ids.size() == 1) {
            node.child[c] =
                is_triangle | static_cast<std::uint32_t>(&parts[c].ids[0] - ids_.data());
        } else {
            node.child[c] = static_cast<std::uint32_t>(nodes_.size());
            nodes_.emplace_back();
        }
    }
    nodes_[self] = node;
    for (std::size_t c = 0; c < parts.size(); ++c)
        if (parts[c].ids.size() > 1) split(node.child[c], parts[c].ids, centers);
}

template <class Visit>
void LineTree::visit_candidates(const Ray& ray, const Visit& visit) const {
    if (nodes_.empty()) return;
    const Line line{{ray.origin.x, ray.origin.y, ray.origin.z},
                    {ray.direction.x, ray.direction.y, ray.direction.z}};
    std::uint32_t pending[128];  // seven more for every level of a balanced tree
    std::size_t top = 0;
    pending[top++] = 0;
    while (top != 0) {
        const Node& node = nodes_[pending[--top]];
        for (unsigned met = boxes_on(node.middle, node.half, line); met != 0; met &= met - 1) {
            const std::uint32_t child = node.child[std::countr_zero(met)];
            if ((child & is_triangle) == 0)
                pending[top++] = child;
            else
                visit(ids_[child & ~is_triangle], corners_[child & ~is_triangle]);
        }
    }
}

Hit LineTree::closest(const Ray& ray) const {
    if (!is_valid(ray)) return {};
    const RayFrame frame = make_frame(ray);
    Hit best;
    float nearest = frame.tmax;
    visit_candidates(ray, [&](std::uint32_t i, const LeafTriangle& corners) {
        TriangleHit hit;
        if (!intersect_triangle<EdgeRule::closed>(frame, corners, frame.tmax, hit)) return;
        if (hit.t > nearest || (hit.t == nearest && best.hit() && i > best.prim)) return;
        nearest = hit.t;
        best = hit_of_tree({hit.t * frame.t_scale, i, hit.u, hit.v});
    });
    return best;
}

std::vector<Hit> LineTree::all(const Ray& ray) const {
    std::vector<Hit> hits;
    if (!is_valid(ray)) return hits;
    const RayFrame frame = make_frame(ray);
    visit_candidates(ray, [&](std::uint32_t i, const LeafTriangle& corners) {
        TriangleHit hit;
        if (intersect_triangle<EdgeRule::half_open>(frame, corners, frame.tmax, hit))
            hits.push_back(hit_of_tree({hit.t * frame.t_scale, i, hit.u, hit.v}));
    });
    std::ranges::sort(hits, [](const Hit& a, const Hit& b) {
        return a.t < b.t || (a.t == b.t && a.prim < b.prim);
    });
    return hits;
}

std::vector<Hit> LineTree::closest(std::span<const Ray> rays) const {
    std::vector<Hit> hits(rays.size());
    for_each_index(
        rays.size(), [&](std::size_t i) { hits[i] = closest(rays[i]); }, 1024);
    return hits;
}

}  // namespace raydix::test
