// Lattice cells -> boundary faces with shared edges and vertices -> grids of quads that meet at
// their borders.
#include "scene/quad_net.h"

#include <cmath>
#include <utility>

namespace raydix::builtin {

namespace {

constexpr std::uint32_t none = 0xFFFFFFFFu;

/// Gives out numbers to lattice places in the order in which they are first asked for.
class Numbering {
public:
    explicit Numbering(std::size_t places) : numbers_(places, none) {}
    /// {number, whether it is new}
    std::pair<std::uint32_t, bool> get(std::size_t place) {
        const bool fresh = numbers_[place] == none;
        if (fresh) numbers_[place] = count_++;
        return {numbers_[place], fresh};
    }

private:
    std::vector<std::uint32_t> numbers_;
    std::uint32_t count_ = 0;
};

Cell step(Cell c, int axis) {
    ++c[static_cast<std::size_t>(axis)];
    return c;
}

class SurfaceBuilder {
public:
    explicit SurfaceBuilder(Cell size)
        : size_(size), vertices_(point_count(size)), edges_(3 * point_count(size)) {
        surface_.size = size;
    }

    void add_face(Cell origin, int axis, bool positive) {
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        LatticeSurface::Face face{origin, axis, positive, {}, {}, 0};
        const Cell corners[4] = {origin, step(origin, u), step(origin, v),
                                 step(step(origin, u), v)};
        for (std::size_t k = 0; k < 4; ++k) {
            const auto [number, fresh] = vertices_.get(place(corners[k]));
            face.corners[k] = number;
            if (!fresh) continue;
            face.owned |= 1u << k;
            surface_.vertices.push_back(corners[k]);
        }
        const std::pair<Cell, int> edges[4] = {
            {origin, u}, {corners[2], u}, {origin, v}, {corners[1], v}};
        for (std::size_t k = 0; k < 4; ++k) {
            const auto [from, along] = edges[k];
            const auto [number, fresh] =
                edges_.get(3 * place(from) + static_cast<std::size_t>(along));
            face.edges[k] = number;
            if (!fresh) continue;
            face.owned |= 16u << k;
            surface_.edges.push_back({along, from[static_cast<std::size_t>(along)]});
        }
        surface_.faces.push_back(face);
    }

    LatticeSurface take() { return std::move(surface_); }

private:
    static std::size_t point_count(Cell size) {
        return static_cast<std::size_t>(size[0] + 1) * static_cast<std::size_t>(size[1] + 1) *
               static_cast<std::size_t>(size[2] + 1);
    }
    [[nodiscard]] std::size_t place(Cell c) const {
        return static_cast<std::size_t>(c[0] + (size_[0] + 1) * (c[1] + (size_[1] + 1) * c[2]));
    }

    Cell size_;
    Numbering vertices_, edges_;
    LatticeSurface surface_;
};

/// Cuts of every slab when the mean is `density`: whole parts by a fixed dither, so that the sum
/// grows in small steps.
SlabCuts dithered_cuts(const LatticeSurface& surface, double density) {
    SlabCuts cuts;
    std::uint32_t k = 0;
    for (std::size_t axis = 0; axis < 3; ++axis)
        for (int slab = 0; slab < surface.size[axis]; ++slab, ++k) {
            const double turn = k * 0.6180339887498949;
            const double wanted = std::floor(density + (turn - std::floor(turn)));
            cuts[axis].push_back(wanted < 1.0 ? 1u : static_cast<std::uint32_t>(wanted));
        }
    return cuts;
}

std::pair<std::uint32_t, std::uint32_t> face_cuts(const LatticeSurface::Face& face,
                                                  const SlabCuts& cuts) {
    const auto u = static_cast<std::size_t>((face.axis + 1) % 3);
    const auto v = static_cast<std::size_t>((face.axis + 2) % 3);
    return {cuts[u][static_cast<std::size_t>(face.origin[u])],
            cuts[v][static_cast<std::size_t>(face.origin[v])]};
}

}  // namespace

LatticeSurface lattice_surface(Cell size, const std::function<bool(Cell)>& inside) {
    SurfaceBuilder builder(size);
    for (int z = 0; z < size[2]; ++z)
        for (int y = 0; y < size[1]; ++y)
            for (int x = 0; x < size[0]; ++x) {
                const Cell cell{x, y, z};
                if (!inside(cell)) continue;
                for (int axis = 0; axis < 3; ++axis) {
                    Cell below = cell;
                    --below[static_cast<std::size_t>(axis)];
                    const Cell above = step(cell, axis);
                    if (!inside(below)) builder.add_face(cell, axis, false);
                    if (!inside(above)) builder.add_face(above, axis, true);
                }
            }
    return builder.take();
}

SlabCuts even_cuts(const LatticeSurface& surface, std::uint32_t cuts) {
    SlabCuts all;
    for (std::size_t axis = 0; axis < 3; ++axis)
        all[axis].assign(static_cast<std::size_t>(surface.size[axis]), cuts);
    return all;
}

std::uint64_t count_quads(const LatticeSurface& surface, const SlabCuts& cuts) {
    std::uint64_t quads = 0;
    for (const LatticeSurface::Face& face : surface.faces) {
        const auto [columns, rows] = face_cuts(face, cuts);
        quads += std::uint64_t{columns} * rows;
    }
    return quads;
}

SlabCuts cuts_for(const LatticeSurface& surface, std::uint64_t quads) {
    double low = 0.0;
    double high = 2.0 + std::sqrt(static_cast<double>(quads));
    for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (low + high);
        (count_quads(surface, dithered_cuts(surface, middle)) <= quads ? low : high) = middle;
    }
    return dithered_cuts(surface, low);
}

QuadNet::QuadNet(const LatticeSurface& surface, SlabCuts cuts)
    : surface_(&surface), cuts_(std::move(cuts)) {
    auto next = static_cast<std::uint32_t>(surface.vertices.size());
    for (const LatticeSurface::Edge& edge : surface.edges) {
        edge_first_.push_back(next);
        next += cuts_[static_cast<std::size_t>(edge.axis)][static_cast<std::size_t>(edge.slab)] - 1;
    }
    face_quads_.push_back(0);
    for (const LatticeSurface::Face& face : surface.faces) {
        const auto [across, down] = face_cuts(face, cuts_);
        face_first_.push_back(next);
        next += (across - 1) * (down - 1);
        face_quads_.push_back(face_quads_.back() + std::uint64_t{across} * down);
    }
    vertex_count_ = next;
}

std::uint32_t QuadNet::columns(std::size_t face) const {
    return face_cuts(surface_->faces[face], cuts_).first;
}
std::uint32_t QuadNet::rows(std::size_t face) const {
    return face_cuts(surface_->faces[face], cuts_).second;
}

int QuadNet::part(std::size_t face, std::uint32_t i, std::uint32_t j) const {
    const auto [across, down] = face_cuts(surface_->faces[face], cuts_);
    const bool left = i == 0, right = i == across, bottom = j == 0, top = j == down;
    if ((left || right) && (bottom || top)) return (right ? 1 : 0) + (top ? 2 : 0);
    if (bottom || top) return top ? 5 : 4;
    if (left || right) return right ? 7 : 6;
    return 8;
}

std::uint32_t QuadNet::vertex(std::size_t face, std::uint32_t i, std::uint32_t j) const {
    const LatticeSurface::Face& f = surface_->faces[face];
    const int where = part(face, i, j);
    if (where < 4) return f.corners[static_cast<std::size_t>(where)];
    if (where < 6) return edge_first_[f.edges[static_cast<std::size_t>(where - 4)]] + i - 1;
    if (where < 8) return edge_first_[f.edges[static_cast<std::size_t>(where - 4)]] + j - 1;
    return face_first_[face] + (j - 1) * (columns(face) - 1) + i - 1;
}

bool QuadNet::owns(std::size_t face, std::uint32_t i, std::uint32_t j) const {
    const int where = part(face, i, j);
    return where == 8 || (surface_->faces[face].owned >> where & 1) != 0;
}

}  // namespace raydix::builtin
