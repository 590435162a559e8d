// Distances at cell centres -> cells without non-manifold contacts.
#include "scene/cell_solid.h"

namespace raydix::builtin {

namespace {

/// Whether the chosen ones of eight cells around a point hang together by faces; bits 0-2 of a cell
/// are its x, y, z side.
bool hangs_together(unsigned cells) {
    unsigned reached = cells & (~cells + 1);  // the lowest one
    for (int round = 0; round < 7; ++round)
        for (unsigned cell = 0; cell < 8; ++cell)
            if (reached >> cell & 1u)
                reached |= cells & (1u << (cell ^ 1u) | 1u << (cell ^ 2u) | 1u << (cell ^ 4u));
    return reached == cells;
}

}  // namespace

CellSolid::CellSolid(Cell size, const std::function<double(Cell)>& distance) : size_(size) {
    for (int z = 0; z < size[2]; ++z)
        for (int y = 0; y < size[1]; ++y)
            for (int x = 0; x < size[0]; ++x) distances_.push_back(distance({x, y, z}));
    for (bool whole = false; !whole;) {
        whole = true;
        for (int z = 1; z < size[2]; ++z)
            for (int y = 1; y < size[1]; ++y)
                for (int x = 1; x < size[0]; ++x) whole = mend({x, y, z}) && whole;
    }
}

bool CellSolid::mend(Cell c) {
    unsigned solid = 0;
    double least = 1e30;
    std::size_t nearest = 0;
    for (unsigned k = 0; k < 8; ++k) {
        const int dx = k & 1u ? 0 : 1, dy = k & 2u ? 0 : 1, dz = k & 4u ? 0 : 1;
        const std::size_t cell = index({c[0] - dx, c[1] - dy, c[2] - dz});
        if (distances_[cell] < 0.0)
            solid |= 1u << k;
        else if (distances_[cell] < least) {
            least = distances_[cell];
            nearest = cell;
        }
    }
    if (hangs_together(solid) && hangs_together(~solid & 0xFFu)) return true;
    distances_[nearest] = -1.0;
    return false;
}

}  // namespace raydix::builtin
