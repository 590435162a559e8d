#include "support/line_tree.h"

#include <algorithm>
#include <cmath>

#include "exec/parallel.h"
#include "primitives/sources.h"
#include "trace/triangle_test.h"

namespace raydix::test {
namespace {

constexpr std::uint32_t leaf_size = 6;
/// Of the largest distance from the ray's origin to the node; a float test sees vertices with an
/// error of about 5e-7 of it.
constexpr double margin = 1e-5;

double at(const Vec3& p, int axis) { return (&p.x)[axis]; }

/// Whether the whole line passes the box, widened by `margin`.
template <class Node>
bool meets_line(const Node& node, const double* o, const double* inverse) {
    double reach = 0;
    for (int k = 0; k < 3; ++k)
        reach = std::max({reach, std::abs(node.lo[k] - o[k]), std::abs(node.hi[k] - o[k])});
    const double wide = margin * reach;
    double entry = -HUGE_VAL, exit = HUGE_VAL;
    for (int k = 0; k < 3; ++k) {
        const double lo = node.lo[k] - wide - o[k], hi = node.hi[k] + wide - o[k];
        if (std::isinf(inverse[k])) {
            if (lo > 0 || hi < 0) return false;
            continue;
        }
        const double a = lo * inverse[k], b = hi * inverse[k];
        entry = std::max(entry, std::min(a, b));
        exit = std::min(exit, std::max(a, b));
    }
    return entry <= exit;
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
    nodes_.reserve(ids_.size());
    if (!ids_.empty()) split(0, static_cast<std::uint32_t>(ids_.size()), centers);
    for (const std::uint32_t i : ids_) corners_.push_back(corners_of(source, i));
}

std::uint32_t LineTree::split(std::uint32_t begin, std::uint32_t end,
                              std::span<const Vec3> centers) {
    const auto self = static_cast<std::uint32_t>(nodes_.size());
    Node node{{HUGE_VAL, HUGE_VAL, HUGE_VAL}, {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL}, begin, end, 0};
    for (std::uint32_t i = begin; i < end; ++i)
        for (const std::uint32_t vertex : mesh_.triangles[ids_[i]])
            for (int k = 0; k < 3; ++k) {
                node.lo[k] = std::min(node.lo[k], at(mesh_.vertices[vertex], k));
                node.hi[k] = std::max(node.hi[k], at(mesh_.vertices[vertex], k));
            }
    nodes_.push_back(node);
    if (end - begin <= leaf_size) return self;
    int axis = 0;
    for (int k = 1; k < 3; ++k)
        if (node.hi[k] - node.lo[k] > node.hi[axis] - node.lo[axis]) axis = k;
    const std::uint32_t middle = begin + (end - begin) / 2;
    std::nth_element(ids_.begin() + begin, ids_.begin() + middle, ids_.begin() + end,
                     [&](std::uint32_t a, std::uint32_t b) {
                         return at(centers[a], axis) < at(centers[b], axis);
                     });
    split(begin, middle, centers);
    const std::uint32_t right = split(middle, end, centers);
    nodes_[self].right = right;
    return self;
}

template <class Visit>
void LineTree::visit_candidates(const Ray& ray, const Visit& visit) const {
    if (nodes_.empty()) return;
    double o[3], inverse[3];
    for (int k = 0; k < 3; ++k) {
        o[k] = at(ray.origin, k);
        inverse[k] = 1.0 / at(ray.direction, k);
    }
    std::uint32_t pending[64];
    std::size_t top = 0;
    pending[top++] = 0;
    while (top != 0) {
        const std::uint32_t index = pending[--top];
        const Node& node = nodes_[index];
        if (!meets_line(node, o, inverse)) continue;
        if (node.right == 0) {
            for (std::uint32_t i = node.begin; i < node.end; ++i) visit(ids_[i], corners_[i]);
        } else {
            pending[top++] = node.right;
            pending[top++] = index + 1;
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
