// A solid as lattice cells whose boundary is a two-manifold.
#pragma once

#include <functional>
#include <vector>

#include "scene/quad_net.h"

namespace raydix::builtin {

class CellSolid {
public:
    /// Takes the cells of [0, size) with distance(cell) < 0, then fills cells, nearest to the solid
    /// first, until around every lattice point both the solid and the void hang together by faces:
    /// no two cells touch in an edge or corner alone. The rim of the lattice must stay clear.
    CellSolid(Cell size, const std::function<double(Cell)>& distance);

    [[nodiscard]] bool inside(Cell c) const { return distances_[index(c)] < 0.0; }

private:
    [[nodiscard]] std::size_t index(Cell c) const {
        return static_cast<std::size_t>(c[0] + size_[0] * (c[1] + size_[1] * c[2]));
    }
    /// Looks at the eight cells around lattice point `c`; false if one had to be filled.
    bool mend(Cell c);

    Cell size_;
    std::vector<double> distances_;
};

}  // namespace raydix::builtin
