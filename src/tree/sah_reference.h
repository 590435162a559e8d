// What the SAH builders sort and divide: boxes of primitives, or of parts of them.
#pragma once

#include <raydix/types.h>

#include <cstdint>

#include "base/float4.h"
#include "base/math.h"

namespace raydix {

/// A primitive's box, or the box of a part of it. One load for each corner.
struct alignas(32) SahReference {
    Vec3 lo;
    std::uint32_t primitive_id;
    Vec3 hi;
    std::uint32_t unused;

    [[nodiscard]] Aabb box() const { return {lo, hi}; }
};
static_assert(sizeof(SahReference) == 32);

inline SahReference make_reference(const Aabb& box, std::uint32_t primitive_id) {
    return {box.lo, primitive_id, box.hi, 0};
}

/// Half the surface of a box in float, xy + yz + zx: all that the SAH builders compare.
inline float sah_area(const Aabb& box) {
    const Vec3 d = box.hi - box.lo;
    return (d.x * d.y + d.y * d.z) + d.z * d.x;
}

/// A box that grows along a list of references.
struct GrowingBox {
    Float4 lo = Float4::all(infinity).xyz(), hi = Float4::all(-infinity).xyz();

    void add(const SahReference& reference) {
        lo = min_of(lo, Float4::load(&reference.lo.x).xyz());
        hi = max_of(hi, Float4::load(&reference.hi.x).xyz());
    }
    void add(const GrowingBox& other) {
        lo = min_of(lo, other.lo);
        hi = max_of(hi, other.hi);
    }
    /// As sah_area.
    [[nodiscard]] float area() const {
        float d[4];
        (hi - lo).store(d);
        return (d[0] * d[1] + d[1] * d[2]) + d[2] * d[0];
    }
    [[nodiscard]] Aabb box() const {
        float l[4], h[4];
        lo.store(l);
        hi.store(h);
        return {{l[0], l[1], l[2]}, {h[0], h[1], h[2]}};
    }
};

}  // namespace raydix
