// Scene `figure`: a sitting cat as a scanner would see it, closed and two-manifold, with nearly
// even triangles. Solid -> lattice cells inside it -> their boundary, fitted to the solid from
// coarse to fine -> a smooth surface over each boundary face, sampled at the wanted fineness ->
// displaced by relief and scanner noise.
#include <algorithm>
#include <array>
#include <cmath>

#include "exec/parallel.h"
#include "scene/builtin.h"
#include "scene/builtin_math.h"
#include "scene/cell_solid.h"
#include "scene/figure_shape.h"
#include "scene/quad_net.h"

namespace raydix::builtin {

namespace {

constexpr std::uint32_t fitted_cuts = 8;  // quads along a lattice edge of the fitted net
constexpr double surface_area = 7.8;      // square metres, roughly: scales the scanner noise

LatticeSurface figure_lattice() {
    const Cell size{figure_cells[0], figure_cells[1], figure_cells[2]};
    const CellSolid solid(size, [](Cell c) {
        return figure_solid(figure_low + Point{c[0] + 0.5, c[1] + 0.5, c[2] + 0.5} * figure_cell)
            .distance;
    });
    return lattice_surface(size, [&](Cell c) { return solid.inside(c); });
}

/// A net with a place, and later a normal, for each vertex.
struct FittedNet {
    QuadNet net;
    std::vector<Point> points, normals;
};

template <class Visit>  // visit(a, b, c, d): counter-clockwise seen from outside
void for_each_quad(const QuadNet& net, const Visit& visit) {
    for (std::size_t f = 0; f < net.surface().faces.size(); ++f) {
        const bool positive = net.surface().faces[f].positive;
        for (std::uint32_t j = 0; j < net.rows(f); ++j)
            for (std::uint32_t i = 0; i < net.columns(f); ++i) {
                const std::uint32_t a = net.vertex(f, i, j), b = net.vertex(f, i + 1, j);
                const std::uint32_t c = net.vertex(f, i + 1, j + 1), d = net.vertex(f, i, j + 1);
                positive ? visit(a, b, c, d) : visit(a, d, c, b);
            }
    }
}

/// Each vertex halfway to the mean of its neighbours: evens out the spacing.
void relax(FittedNet& fit) {
    std::vector<Point> sum(fit.points.size());
    std::vector<int> count(fit.points.size(), 0);
    for_each_quad(fit.net, [&](auto... corner) {
        const std::array<std::uint32_t, 4> quad{corner...};
        for (std::size_t k = 0; k < 4; ++k) {
            const Point beside = fit.points[quad[(k + 1) % 4]] + fit.points[quad[(k + 3) % 4]];
            sum[quad[k]] = sum[quad[k]] + beside;
            count[quad[k]] += 2;
        }
    });
    for (std::size_t v = 0; v < sum.size(); ++v)
        fit.points[v] = mix(fit.points[v], sum[v] * (1.0 / count[v]), 0.5);
}

/// Newton steps along the gradient, short ones so that no vertex jumps to another limb.
void project(FittedNet& fit) {
    for_each_index(
        fit.points.size(),
        [&](std::size_t v) {
            Point& p = fit.points[v];
            for (int i = 0; i < 2; ++i) {
                const SolidSample s = figure_solid(p);
                const double slope = std::max(dot(s.gradient, s.gradient), 0.05);
                const double far =
                    std::clamp(s.distance / slope, -0.5 * figure_cell, 0.5 * figure_cell);
                p = p - s.gradient * far;
            }
        },
        256);
}

void find_normals(FittedNet& fit) {
    fit.normals.assign(fit.points.size(), {});
    for_each_quad(fit.net, [&](auto... corner) {
        const std::array<std::uint32_t, 4> quad{corner...};
        const Point normal = cross(fit.points[quad[2]] - fit.points[quad[0]],
                                   fit.points[quad[3]] - fit.points[quad[1]]);
        for (const std::uint32_t v : quad) fit.normals[v] = fit.normals[v] + normal;
    });
    for (Point& normal : fit.normals) normal = unit(normal);
}

/// Weights of the cubic through four neighbours (Catmull-Rom) at t in [0, 1] between the middle
/// two.
std::array<double, 4> cubic_weights(double t) {
    return {0.5 * t * (-1.0 + t * (2.0 - t)), 1.0 + 0.5 * t * t * (-5.0 + 3.0 * t),
            0.5 * t * (1.0 + t * (4.0 - 3.0 * t)), 0.5 * t * t * (t - 1.0)};
}

struct Span {
    std::uint32_t first;
    std::array<double, 4> weights;
};
/// Position i of n over `cuts` intervals -> the interval and the weights of its four neighbours.
Span locate(std::uint32_t i, std::uint32_t n, std::uint32_t cuts) {
    const std::uint64_t scaled = std::uint64_t{i} * cuts;
    const auto first = std::min(static_cast<std::uint32_t>(scaled / n), cuts - 1);
    return {first, cubic_weights(static_cast<double>(scaled - std::uint64_t{first} * n) / n)};
}

/// One value from a line of `cuts` + 1: beyond the ends a parabola goes on, so that a border
/// depends on the border's own values alone and neighbours agree on it.
template <class Line>
Point interpolate(const Line& line, const Span& at, std::uint32_t cuts) {
    const auto parabola = [](Point a, Point b, Point c) { return 3.0 * a - 3.0 * b + c; };
    const auto before = [&](Point a, Point b, std::uint32_t next) {
        return cuts > 1 ? parabola(a, b, line(next)) : 2.0 * a - b;
    };
    const Point p1 = line(at.first), p2 = line(at.first + 1);
    const Point p0 = at.first > 0 ? line(at.first - 1) : before(p1, p2, 2);
    const Point p3 = at.first + 2 <= cuts ? line(at.first + 2) : before(p2, p1, cuts - 2);
    return (p0 * at.weights[0] + p1 * at.weights[1]) + (p2 * at.weights[2] + p3 * at.weights[3]);
}

/// Visits the vertices that `face` owns in `net`, each with its place on the smooth surface through
/// `field`, values at the vertices of a net of the same surface with even cuts: visit(vertex,
/// value).
template <class Visit>
void resample_face(const QuadNet& coarse, const std::vector<Point>& field, const QuadNet& net,
                   std::size_t face, const Visit& visit) {
    const std::uint32_t cuts = coarse.columns(face);
    std::vector<Point> grid((cuts + 1) * (cuts + 1)), row(cuts + 1);
    for (std::uint32_t j = 0; j <= cuts; ++j)
        for (std::uint32_t i = 0; i <= cuts; ++i)
            grid[j * (cuts + 1) + i] = field[coarse.vertex(face, i, j)];
    for (std::uint32_t j = 0; j <= net.rows(face); ++j) {
        const Span down = locate(j, net.rows(face), cuts);
        for (std::uint32_t i = 0; i <= cuts; ++i)
            row[i] =
                interpolate([&](std::uint32_t k) { return grid[k * (cuts + 1) + i]; }, down, cuts);
        for (std::uint32_t i = 0; i <= net.columns(face); ++i)
            if (net.owns(face, i, j))
                visit(net.vertex(face, i, j),
                      interpolate([&](std::uint32_t k) { return row[k]; },
                                  locate(i, net.columns(face), cuts), cuts));
    }
}

std::vector<Point> resample(const QuadNet& coarse, const std::vector<Point>& field,
                            const QuadNet& net) {
    std::vector<Point> values(net.vertex_count());
    for_each_index(
        net.surface().faces.size(),
        [&](std::size_t face) {
            resample_face(coarse, field, net, face,
                          [&](std::uint32_t v, Point p) { values[v] = p; });
        },
        4);
    return values;
}

/// Coarse to fine, so that a few rounds of smoothing reach across the whole figure.
FittedNet fit(const LatticeSurface& surface) {
    FittedNet fitted{QuadNet(surface, even_cuts(surface, 1)), {}, {}};
    for (const Cell& c : surface.vertices)
        fitted.points.push_back(figure_low +
                                Point{double(c[0]), double(c[1]), double(c[2])} * figure_cell);
    for (std::uint32_t cuts = 1;; cuts *= 2) {
        // The coarse nets move far and cost little; the fine ones only settle.
        for (std::uint32_t round = 0; round < 4 + fitted_cuts / cuts; ++round) {
            relax(fitted);
            project(fitted);
        }
        if (cuts == fitted_cuts) break;
        QuadNet finer(surface, even_cuts(surface, 2 * cuts));
        std::vector<Point> points = resample(fitted.net, fitted.points, finer);
        fitted = {std::move(finer), std::move(points), {}};
    }
    find_normals(fitted);
    return fitted;
}

/// Height above the smooth solid: muscles, tufts, hair.
double relief(Point p, std::uint64_t seed) {
    const double tufts = layered_noise(Point{p.x * 9.0, p.y * 5.0, p.z * 9.0}, 2, seed);
    const double hair = layered_noise(Point{p.x * 60.0, p.y * 26.0, p.z * 60.0}, 2, seed + 7);
    return 0.006 * tufts + 0.0018 * hair;
}

void place_vertices(const FittedNet& fitted, const QuadNet& net, std::uint64_t seed, Mesh& mesh) {
    // A tenth of an edge at most: rough as a scan, and never enough to fold a triangle over.
    const double edge = std::sqrt(surface_area / static_cast<double>(net.quad_count()));
    const double roughness = std::min(0.06 * edge, 0.0006);
    mesh.vertices.resize(net.vertex_count());
    for_each_index(
        net.surface().faces.size(),
        [&](std::size_t face) {
            std::vector<Point> points, normals;
            std::vector<std::uint32_t> numbers;
            resample_face(fitted.net, fitted.points, net, face, [&](std::uint32_t v, Point p) {
                numbers.push_back(v);
                points.push_back(p);
            });
            resample_face(fitted.net, fitted.normals, net, face,
                          [&](std::uint32_t, Point n) { normals.push_back(unit(n)); });
            for (std::size_t k = 0; k < numbers.size(); ++k) {
                Random random(seed, numbers[k]);
                const double height = relief(points[k], seed) + roughness * random.sign();
                mesh.vertices[numbers[k]] = to_vec3(points[k] + normals[k] * height);
            }
        },
        1);
}

double squared_distance(Vec3 a, Vec3 b) {
    const double x = double(a.x) - b.x, y = double(a.y) - b.y, z = double(a.z) - b.z;
    return (x * x + y * y) + z * z;
}

/// Two triangles per quad, along the shorter diagonal.
void place_triangles(const QuadNet& net, Mesh& mesh) {
    mesh.triangles.resize(2 * net.quad_count());
    for_each_index(
        net.surface().faces.size(),
        [&](std::size_t f) {
            Triangle* out = mesh.triangles.data() + 2 * net.first_quad(f);
            const bool positive = net.surface().faces[f].positive;
            for (std::uint32_t j = 0; j < net.rows(f); ++j)
                for (std::uint32_t i = 0; i < net.columns(f); ++i) {
                    const std::uint32_t a = net.vertex(f, i, j), c = net.vertex(f, i + 1, j + 1);
                    std::uint32_t b = net.vertex(f, i + 1, j), d = net.vertex(f, i, j + 1);
                    if (!positive) std::swap(b, d);
                    const auto& p = mesh.vertices;
                    const bool split_ac =
                        squared_distance(p[a], p[c]) <= squared_distance(p[b], p[d]);
                    *out++ = split_ac ? Triangle{a, b, c} : Triangle{a, b, d};
                    *out++ = split_ac ? Triangle{a, c, d} : Triangle{b, c, d};
                }
        },
        1);
}

}  // namespace

BuiltinResult make_figure(std::uint64_t triangles, std::uint64_t seed) {
    const LatticeSurface surface = figure_lattice();
    const FittedNet fitted = fit(surface);
    const QuadNet net(surface, cuts_for(surface, triangles / 2));
    BuiltinResult result;
    place_vertices(fitted, net, seed, result.mesh);
    place_triangles(net, result.mesh);
    result.cameras.ao_radius = 0.15f;
    result.cameras.cameras = {
        camera("front", {0.9f, 1.5f, 4.6f}, {0.0f, 0.95f, -0.15f}, 28.0f),
        camera("side", {4.4f, 1.2f, 0.8f}, {0.05f, 0.92f, -0.2f}, 30.0f),
        camera("back", {-2.4f, 2.3f, -3.8f}, {0.0f, 0.9f, -0.15f}, 30.0f),
        camera("head", {0.9f, 1.75f, 1.9f}, {0.0f, 1.45f, 0.2f}, 34.0f),
        camera("feet", {1.7f, 0.55f, 1.5f}, {0.25f, 0.25f, 0.1f}, 42.0f),
    };
    return result;
}

}  // namespace raydix::builtin
