// Maps and vectors in long double: what points and normals of hits are compared with.
#pragma once

#include <raydix/types.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace raydix::test {

using Real = long double;
using Column = std::array<Real, 3>;

template <class Point>
Column column(const Point& p) {
    return {p.x, p.y, p.z};
}
inline Column minus(const Column& a, const Column& b) {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
inline Column times(const Column& a, Real by) { return {a[0] * by, a[1] * by, a[2] * by}; }
inline Real product(const Column& a, const Column& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline Column crossed(const Column& a, const Column& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline Column unit(const Column& a) { return times(a, 1 / std::sqrt(product(a, a))); }

/// Rows and a move.
using Matrix = std::array<std::array<Real, 4>, 3>;

inline Matrix composed(const Matrix& outer, const Matrix& inner) {
    Matrix out{};
    for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 4; ++c) {
            out[r][c] = c == 3 ? outer[r][3] : 0;
            for (std::size_t k = 0; k < 3; ++k) out[r][c] += outer[r][k] * inner[k][c];
        }
    return out;
}
inline Column mapped(const Matrix& by, const Column& p) {
    Column out{};
    for (std::size_t r = 0; r < 3; ++r)
        out[r] = by[r][0] * p[0] + by[r][1] * p[1] + by[r][2] * p[2] + by[r][3];
    return out;
}

/// Largest sum of a row's magnitudes.
inline Real norm_of(const Matrix& m) {
    Real most = 0;
    for (const auto& row : m)
        most = std::max(most, std::fabs(row[0]) + std::fabs(row[1]) + std::fabs(row[2]));
    return most;
}

/// A map from a mesh to the world; how large the numbers are on the way, and how far it distorts.
struct LongMap {
    Matrix m{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    Matrix most = m;  // of magnitudes
    Real condition = 1;
    int levels = 0;

    LongMap() = default;
    template <class AnyTransform>
    explicit LongMap(const AnyTransform& t) : levels(1) {
        for (std::size_t r = 0; r < 3; ++r)
            for (std::size_t c = 0; c < 4; ++c)
                m[r][c] = t.m[r][c], most[r][c] = std::fabs(m[r][c]);
        Matrix inverse{};
        for (std::size_t r = 0; r < 3; ++r) {
            Column axis{};
            axis[r] = 1;
            const Column row = inverse_transpose(axis);
            std::copy(row.begin(), row.end(), inverse[r].begin());
        }
        condition = norm_of(m) * norm_of(inverse);
    }
    /// First through `inner`, then through this.
    [[nodiscard]] LongMap after(const LongMap& inner) const {
        LongMap out;
        out.m = composed(m, inner.m);
        out.most = composed(most, inner.most);
        out.condition = condition * inner.condition;
        out.levels = levels + inner.levels;
        return out;
    }
    [[nodiscard]] Column inverse_transpose(const Column& v) const {
        const auto row = [&](std::size_t r) { return Column{m[r][0], m[r][1], m[r][2]}; };
        const Column x = crossed(row(1), row(2)), y = crossed(row(2), row(0)),
                     z = crossed(row(0), row(1));
        const Real det = product(row(0), x);
        return {product(x, v) / det, product(y, v) / det, product(z, v) / det};
    }
    /// Where a normal turns, of unit length.
    [[nodiscard]] Column turned(const Column& normal) const {
        return unit(inverse_transpose(normal));
    }
};

}  // namespace raydix::test
