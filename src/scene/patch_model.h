// A model of surface patches that are cut as finely as a wanted number of triangles allows, and of
// fixed boxes and quads. Architecture and trees are described once; small and large requests cut
// the same description.
#pragma once

#include <raydix/mesh.h>

#include <cstdint>
#include <functional>
#include <vector>

#include "scene/builtin_math.h"

namespace raydix::builtin {

/// Place and heading of a thing: turned about y, then moved.
struct Frame {
    Point origin{};
    Circle turn{1.0, 0.0};

    [[nodiscard]] Point place(Point p) const {
        return origin +
               Point{p.x * turn.cos + p.z * turn.sin, p.y, p.z * turn.cos - p.x * turn.sin};
    }
};

/// How often a patch is cut along one direction: at least `least` times, and in proportion to
/// `weight` as the budget grows. Weight 0 keeps it at `least`.
struct Cuts {
    std::uint32_t least = 1;
    double weight = 0.0;
};

/// (u, v) in [0, 1] x [0, 1] -> point. Called from several threads.
using Surface = std::function<Point(double u, double v)>;

class PatchModel {
public:
    /// `least_share` below 1 lowers the least cuts of patches that can be refined, for small
    /// budgets.
    explicit PatchModel(double least_share = 1.0) : least_share_(least_share) {}

    /// Where the following things stand.
    void set_frame(const Frame& frame) { frame_ = frame; }
    [[nodiscard]] const Frame& frame() const { return frame_; }

    void add_patch(Surface surface, Cuts columns, Cuts rows);
    /// Fixed: two triangles, counter-clockwise a b c d.
    void add_quad(Point a, Point b, Point c, Point d);
    /// Fixed: twelve triangles on eight vertices.
    void add_box(Point low, Point high);
    /// Fixed: a box with any eight corners, numbered by their x, y, z bits.
    void add_hexahedron(const Point (&corners)[8]);
    /// Fixed: a mesh, scaled and placed.
    void add_mesh(const Mesh& mesh, double scale);

    [[nodiscard]] std::uint64_t fixed_triangles() const { return fixed_.triangles.size(); }
    /// As many triangles as wanted, a little less if the cuts do not add up; more only if the least
    /// cuts need more.
    [[nodiscard]] Mesh tessellate(std::uint64_t triangles) const;

private:
    struct Patch {
        Surface surface;
        Cuts columns, rows;
        Frame frame;
    };
    struct Grid {
        std::uint32_t columns, rows;
    };
    [[nodiscard]] Grid grid(std::size_t patch, double fineness) const;
    [[nodiscard]] std::uint64_t count(double fineness) const;
    std::uint32_t add_vertex(Point p);

    double least_share_;
    Frame frame_;
    std::vector<Patch> patches_;
    Mesh fixed_;
};

}  // namespace raydix::builtin
