// Where a ray meets a triangle, in double: what its corners weigh there, and t. No guard:
// triangle_test.h includes this for one ray and one triangle, simd/block_hits.h once per
// instruction set, inside its namespace, for vectors of rays or of triangles. So all have the same
// bits.

/// t in units of the direction; u, v and w are the weights of v1, v2 and v0.
template <class Number>
struct CornerWeights {
    Number t, u, v, w;
};

/// Number: double, or a vector of doubles. corner[k]: v0, v1 and v2 as the ray sees them from where
/// it starts; they and the direction along kx, ky and kz. `narrow(x)` may drop digits of sheared
/// coordinates; `edge(a, b, c, d)` is a * b - c * d of what is left, to a rounding of its own
/// value: so the weights are right whatever the triangle's shape.
template <class Number, class Narrow, class Edge>
RAYDIX_WEIGHTS CornerWeights<Number> weigh_corners(const Number (&corner)[3][3],
                                                   const Number (&direction)[3], Number one,
                                                   const Narrow& narrow, const Edge& edge) {
    const Number dx = direction[0], dy = direction[1], dz = direction[2];
    // The sheared plane of triangle_test.h, times dz.
    const auto x = [&](int k) { return narrow(corner[k][0] * dz - corner[k][2] * dx); };
    const auto y = [&](int k) { return narrow(corner[k][1] * dz - corner[k][2] * dy); };
    const Number ax = x(0), ay = y(0), bx = x(1), by = y(1), cx = x(2), cy = y(2);
    const Number at_a = edge(cx, by, cy, bx), at_b = edge(ax, cy, ay, cx),
                 at_c = edge(bx, ay, by, ax);
    const Number depth = (at_a * corner[0][2] + at_b * corner[1][2]) + at_c * corner[2][2];
    const Number inverse = one / (((at_a + at_b) + at_c) * dz);
    const Number scale = inverse * dz;
    return {depth * inverse, at_b * scale, at_c * scale, at_a * scale};
}
