// A closed surface as a net of square faces of a cubic lattice, each cut into a grid of smaller
// quads. All edges across one slab of the lattice are cut alike, so the grids of neighbours always
// meet: the surface is closed and two-manifold by construction, and the cuts per slab tune the
// number of quads finely.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

namespace raydix::builtin {

using Cell = std::array<int, 3>;

/// The boundary faces of a set of lattice cells. Fixed; shared by nets of different fineness.
struct LatticeSurface {
    struct Face {
        Cell origin;    // lattice point with the least coordinates
        int axis;       // of the normal; u runs along axis + 1, v along axis + 2 (modulo 3)
        bool positive;  // normal along +axis: (u, v) turns counter-clockwise seen from outside
        std::array<std::uint32_t, 4> corners;  // lattice vertex at (0,0), (1,0), (0,1), (1,1)
        std::array<std::uint32_t, 4> edges;    // v = 0, v = 1, u = 0, u = 1
        unsigned owned = 0;  // bits 0-3: owns that corner, bits 4-7: owns that edge
    };
    struct Edge {
        int axis, slab;
    };
    Cell size{};
    std::vector<Face> faces;
    std::vector<Edge> edges;
    std::vector<Cell> vertices;  // lattice coordinates
};

/// inside(cell) is asked for all cells of [0, size) and must be false on the lattice's rim.
LatticeSurface lattice_surface(Cell size, const std::function<bool(Cell)>& inside);

/// How often the edges along each axis are cut, per slab.
using SlabCuts = std::array<std::vector<std::uint32_t>, 3>;

/// The same everywhere.
SlabCuts even_cuts(const LatticeSurface& surface, std::uint32_t cuts);
/// Cuts whose number of quads comes close to `quads`.
SlabCuts cuts_for(const LatticeSurface& surface, std::uint64_t quads);
std::uint64_t count_quads(const LatticeSurface& surface, const SlabCuts& cuts);

/// Numbers the vertices of a cut surface: lattice vertices, then those inside edges, then those
/// inside faces.
class QuadNet {
public:
    QuadNet(const LatticeSurface& surface, SlabCuts cuts);

    [[nodiscard]] const LatticeSurface& surface() const { return *surface_; }
    [[nodiscard]] std::uint64_t vertex_count() const { return vertex_count_; }
    [[nodiscard]] std::uint64_t quad_count() const { return face_quads_.back(); }
    [[nodiscard]] std::uint32_t columns(std::size_t face) const;
    [[nodiscard]] std::uint32_t rows(std::size_t face) const;
    /// Quads of all faces before this one.
    [[nodiscard]] std::uint64_t first_quad(std::size_t face) const { return face_quads_[face]; }
    /// Vertex at column i of [0, columns], row j of [0, rows].
    [[nodiscard]] std::uint32_t vertex(std::size_t face, std::uint32_t i, std::uint32_t j) const;
    /// True for exactly one face among those that share the vertex.
    [[nodiscard]] bool owns(std::size_t face, std::uint32_t i, std::uint32_t j) const;

private:
    /// 0-3: that corner; 4-7: that edge; 8: inside.
    [[nodiscard]] int part(std::size_t face, std::uint32_t i, std::uint32_t j) const;

    const LatticeSurface* surface_;
    SlabCuts cuts_;
    std::vector<std::uint32_t> edge_first_, face_first_;  // first vertex inside each edge and face
    std::vector<std::uint64_t> face_quads_;               // prefix sums, one more than faces
    std::uint64_t vertex_count_ = 0;
};

}  // namespace raydix::builtin
