// How far a scene reaches in any direction (its support function), by a table of directions: from
// it follows a tight box around what a map makes of the scene, without a look at its triangles.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/double3.h"

namespace raydix {

struct SceneTree;

/// The farthest points of a set along a direction d and against it: most of dot(p, d).
struct Reach {
    double along = -std::numeric_limits<double>::infinity(),
           against = -std::numeric_limits<double>::infinity();
};

/// Directions lie on the faces of a cube, at corners of a grid. A direction between them is a sum
/// of its cell's corners with weights that are not negative, and support functions are sublinear:
/// the same sum of theirs is an upper bound. It is exact where one point is the farthest for all
/// four corners. Boxes keep theirs exactly, since grid lines lie where components change sign.
class Support {
public:
    static constexpr int cells = 8;

    /// Holds a further set too; of(direction): its Reach.
    template <class Of>
    void widen(const Of& of) {
        for (int face = 0; face < 3; ++face)
            for (int i = 0; i <= cells; ++i)
                for (int j = 0; j <= cells; ++j) {
                    double d[3];
                    d[face] = 1.0;
                    d[(face + 1) % 3] = 2.0 * i / cells - 1.0;
                    d[(face + 2) % 3] = 2.0 * j / cells - 1.0;
                    const Reach more = of(Double3{d[0], d[1], d[2]});
                    Reach& known = table_[face][i][j];
                    known = {std::max(known.along, more.along),
                             std::max(known.against, more.against)};
                }
    }

    /// At least the set's reach: more by what grid cells smooth over, and by roundings of 2^-48 of
    /// |d| times its largest coordinate.
    [[nodiscard]] Reach along(Double3 d) const {
        const double ax = std::fabs(d.x), ay = std::fabs(d.y), az = std::fabs(d.z);
        const double longest = std::max({ax, ay, az});
        if (!(longest > 0)) return {0, 0};
        const int face = az == longest ? 2 : ay == longest ? 1 : 0;
        const double w = face == 2   ? d.z
                         : face == 1 ? d.y
                                     : d.x,
                     u = face == 2   ? d.x
                         : face == 1 ? d.z
                                     : d.y,
                     v = face == 2   ? d.y
                         : face == 1 ? d.x
                                     : d.z;
        const double inverse = 1.0 / w, half = 0.5 * cells;
        const double x = (u * inverse + 1.0) * half, y = (v * inverse + 1.0) * half;
        const int i = std::min(static_cast<int>(x), cells - 1),
                  j = std::min(static_cast<int>(y), cells - 1);
        const double f = x - i, g = y - j;
        const Reach &a = table_[face][i][j], &b = table_[face][i][j + 1],
                    &c = table_[face][i + 1][j], &e = table_[face][i + 1][j + 1];
        const double wa = longest * ((1.0 - f) * (1.0 - g)), wb = longest * ((1.0 - f) * g),
                     wc = longest * (f * (1.0 - g)), we = longest * (f * g);
        const double there = (wa * a.along + wb * b.along) + (wc * c.along + we * e.along),
                     back = (wa * a.against + wb * b.against) + (wc * c.against + we * e.against);
        return w > 0 ? Reach{there, back} : Reach{back, there};
    }

private:
    Reach table_[3][cells + 1][cells + 1];
};

/// Of a scene whose extent is not empty, as `Extent` means it: triangles with what rays at them may
/// miss them by. With instances in it, the box around all of it.
[[nodiscard]] Support support_of(const SceneTree& scene);

}  // namespace raydix
