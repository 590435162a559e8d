// The boxes of sources.h for the host's loops: same bits, fewer instructions. source, i -> box,
// validity.
#pragma once

#include "base/float3.h"
#include "primitives/sources.h"
#include "primitives/zero_area.h"

namespace raydix {

/// A corner without -0.
inline Float3 load_corner(const TriangleSource& source, std::uint32_t i, int k) {
    return Float3::load(source.vertices[source.triangles[i][static_cast<std::size_t>(k)]]) +
           Float3::all(0.0f);
}

/// The box of a primitive that is known to be valid.
inline Box3 valid_box(const TriangleSource& source, std::uint32_t i) {
    const Float3 a = load_corner(source, i, 0), b = load_corner(source, i, 1),
                 c = load_corner(source, i, 2);
    return {min_of(min_of(a, b), c), max_of(max_of(a, b), c)};
}
template <class Source>
Box3 valid_box(const Source& source, std::uint32_t i) {
    Aabb plain;
    source.box(i, plain);
    return Box3::load(plain);
}

[[gnu::always_inline]] inline bool host_box(const TriangleSource& source, std::uint32_t i,
                                            Box3& box) {
    const Float3 a = load_corner(source, i, 0), b = load_corner(source, i, 1),
                 c = load_corner(source, i, 2);
    box = {min_of(min_of(a, b), c), max_of(max_of(a, b), c)};
    if (!all_at_most(largest_magnitude(a, b, c), Float3::all(max_coordinate))) return false;
    return any_at_least(box.hi - box.lo, Float3::all(min_diagonal)) || diagonal_in_range(box.box());
}

/// has_zero_area of a valid triangle. Where a component of the cross product is so much larger than
/// what floats may have lost of it that it cannot be 0 in double either, no double is asked.
[[gnu::always_inline]] inline bool host_zero_area(const TriangleSource& source, std::uint32_t i) {
    const Float3 a = load_corner(source, i, 0), b = load_corner(source, i, 1) - a,
                 c = load_corner(source, i, 2) - a;
    const Float3 p = b * rotated(c), q = rotated(b) * c;
    const Float3 lost =
        (absolute(p) + absolute(q)) * Float3::all(0x1p-20f) + Float3::all(0x1p-100f);
    return !any_at_least(absolute(p - q), lost) && has_zero_area(source.corners(i));
}

template <class Source>
bool host_box(const Source& source, std::uint32_t i, Box3& box) {
    Aabb plain;
    const bool valid = source.box(i, plain);
    box = Box3::load(plain);
    return valid;
}

}  // namespace raydix
