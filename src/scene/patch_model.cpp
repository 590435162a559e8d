// Patches and a wanted number of triangles -> the fineness that meets it -> one mesh, patch after
// patch.
#include "scene/patch_model.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "exec/parallel.h"

namespace raydix::builtin {

namespace {

/// Whole cuts; `dither` in [0, 1) differs from patch to patch, so that the total grows in small
/// steps.
std::uint32_t whole_cuts(const Cuts& cuts, double fineness, double dither) {
    const double wanted = std::floor(cuts.weight * fineness + dither);
    return wanted <= cuts.least ? cuts.least : static_cast<std::uint32_t>(wanted);
}

double dither(std::size_t i, double step) {
    const double turns = static_cast<double>(i) * step;
    return turns - std::floor(turns);
}

}  // namespace

void PatchModel::add_patch(Surface surface, Cuts columns, Cuts rows) {
    for (Cuts* cuts : {&columns, &rows})
        if (cuts->weight > 0.0 && cuts->least > 3)  // fewer than three would fold a tube flat
            cuts->least = std::max(3u, static_cast<std::uint32_t>(cuts->least * least_share_));
    patches_.push_back({std::move(surface), columns, rows, frame_});
}

std::uint32_t PatchModel::add_vertex(Point p) {
    fixed_.vertices.push_back(to_vec3(frame_.place(p)));
    return static_cast<std::uint32_t>(fixed_.vertices.size() - 1);
}

void PatchModel::add_quad(Point a, Point b, Point c, Point d) {
    const std::uint32_t v = add_vertex(a);
    add_vertex(b);
    add_vertex(c);
    add_vertex(d);
    fixed_.triangles.push_back({v, v + 1, v + 2});
    fixed_.triangles.push_back({v, v + 2, v + 3});
}

void PatchModel::add_box(Point low, Point high) {
    Point corners[8];
    for (unsigned k = 0; k < 8; ++k)
        corners[k] = {k & 1u ? high.x : low.x, k & 2u ? high.y : low.y, k & 4u ? high.z : low.z};
    add_hexahedron(corners);
}

void PatchModel::add_hexahedron(const Point (&corners)[8]) {
    const std::uint32_t v = add_vertex(corners[0]);
    for (int k = 1; k < 8; ++k) add_vertex(corners[k]);
    constexpr std::uint32_t sides[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                           {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    for (const auto& s : sides) {
        fixed_.triangles.push_back({v + s[0], v + s[1], v + s[2]});
        fixed_.triangles.push_back({v + s[0], v + s[2], v + s[3]});
    }
}

void PatchModel::add_mesh(const Mesh& mesh, double scale) {
    const auto first = static_cast<std::uint32_t>(fixed_.vertices.size());
    fixed_.vertices.reserve(first + mesh.vertices.size());
    fixed_.triangles.reserve(fixed_.triangles.size() + mesh.triangles.size());
    for (const Vec3& p : mesh.vertices) add_vertex(Point{p.x, p.y, p.z} * scale);
    for (const Triangle& t : mesh.triangles)
        fixed_.triangles.push_back({first + t[0], first + t[1], first + t[2]});
}

PatchModel::Grid PatchModel::grid(std::size_t patch, double fineness) const {
    const Patch& p = patches_[patch];
    return {whole_cuts(p.columns, fineness, dither(patch, 0.6180339887498949)),
            whole_cuts(p.rows, fineness, dither(patch, 0.4142135623730950))};
}

std::uint64_t PatchModel::count(double fineness) const {
    std::uint64_t triangles = fixed_triangles();
    for (std::size_t i = 0; i < patches_.size(); ++i) {
        const Grid g = grid(i, fineness);
        triangles += 2 * std::uint64_t{g.columns} * g.rows;
    }
    return triangles;
}

Mesh PatchModel::tessellate(std::uint64_t triangles) const {
    double low = 0.0, high = 1e4;
    for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (low + high);
        (count(middle) <= triangles ? low : high) = middle;
    }
    std::vector<std::uint64_t> first_vertex{fixed_.vertices.size()};
    std::vector<std::uint64_t> first_triangle{fixed_.triangles.size()};
    for (std::size_t i = 0; i < patches_.size(); ++i) {
        const Grid g = grid(i, low);
        first_vertex.push_back(first_vertex.back() + std::uint64_t{g.columns + 1} * (g.rows + 1));
        first_triangle.push_back(first_triangle.back() + 2 * std::uint64_t{g.columns} * g.rows);
    }
    Mesh mesh = fixed_;
    mesh.vertices.resize(first_vertex.back());
    mesh.triangles.resize(first_triangle.back());
    for_each_index(
        patches_.size(),
        [&](std::size_t i) {
            const Grid g = grid(i, low);
            Vec3* vertex = mesh.vertices.data() + first_vertex[i];
            Triangle* triangle = mesh.triangles.data() + first_triangle[i];
            const auto base = static_cast<std::uint32_t>(first_vertex[i]);
            const std::uint32_t stride = g.columns + 1;
            for (std::uint32_t r = 0; r <= g.rows; ++r)
                for (std::uint32_t c = 0; c <= g.columns; ++c)
                    *vertex++ = to_vec3(patches_[i].frame.place(
                        patches_[i].surface(double(c) / g.columns, double(r) / g.rows)));
            for (std::uint32_t r = 0; r < g.rows; ++r)
                for (std::uint32_t c = 0; c < g.columns; ++c) {
                    const std::uint32_t v = base + r * stride + c;
                    *triangle++ = {v, v + 1, v + stride + 1};
                    *triangle++ = {v, v + stride + 1, v + stride};
                }
        },
        1);
    return mesh;
}

}  // namespace raydix::builtin
