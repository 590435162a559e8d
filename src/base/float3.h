// Three floats in one register for the host's hot loops, with the very arithmetic of base/math.h:
// the same operations in the same order, so the same bits. Processors without SSE take the plain
// functions.
#pragma once

#include <raydix/types.h>

#include "base/math.h"

#if defined(__SSE2__)
#include <emmintrin.h>
#if defined(__SSE4_1__)
#include <smmintrin.h>
#endif
#endif

namespace raydix {

#if defined(__SSE2__)

struct Float3 {
    __m128 v;  // the fourth lane is 0 after a load, and nobody's business after arithmetic

    /// Reads twelve bytes, no more.
    static Float3 load(const Vec3& p) {
        const __m128i xy = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(&p.x));
        return {_mm_movelh_ps(_mm_castsi128_ps(xy), _mm_load_ss(&p.z))};
    }
    static Float3 all(float x) { return {_mm_set1_ps(x)}; }
    void store(Vec3& p) const {
        _mm_storel_epi64(reinterpret_cast<__m128i*>(&p.x), _mm_castps_si128(v));
        _mm_store_ss(&p.z, _mm_movehl_ps(v, v));
    }
};

inline Float3 operator+(Float3 a, Float3 b) { return {_mm_add_ps(a.v, b.v)}; }
inline Float3 operator-(Float3 a, Float3 b) { return {_mm_sub_ps(a.v, b.v)}; }
inline Float3 operator*(Float3 a, Float3 b) { return {_mm_mul_ps(a.v, b.v)}; }
inline Float3 min_of(Float3 a, Float3 b) { return {_mm_min_ps(a.v, b.v)}; }
inline Float3 max_of(Float3 a, Float3 b) { return {_mm_max_ps(a.v, b.v)}; }

/// Of signed 32-bit integers.
inline __m128i max_of_bits(__m128i a, __m128i b) {
#if defined(__SSE4_1__)
    return _mm_max_epi32(a, b);
#else
    const __m128i greater = _mm_cmpgt_epi32(a, b);
    return _mm_or_si128(_mm_and_si128(greater, a), _mm_andnot_si128(greater, b));
#endif
}

/// Whether a <= b holds in x, y and z; false with NaN.
inline bool all_at_most(Float3 a, Float3 b) {
    return (_mm_movemask_ps(_mm_cmple_ps(a.v, b.v)) & 7) == 7;
}
/// Whether a >= b holds in x, y or z.
inline bool any_at_least(Float3 a, Float3 b) {
    return (_mm_movemask_ps(_mm_cmpge_ps(a.v, b.v)) & 7) != 0;
}
inline Float3 absolute(Float3 a) { return {_mm_andnot_ps(_mm_set1_ps(-0.0f), a.v)}; }
/// y, z, x.
inline Float3 rotated(Float3 a) { return {_mm_shuffle_ps(a.v, a.v, _MM_SHUFFLE(3, 0, 2, 1))}; }
/// The largest of |a|, |b|, |c| a component; NaN if one of them is. Without signs, floats are in
/// the order of their bits, and NaN comes last: an integer maximum does not lose it as a float one
/// may.
inline Float3 largest_magnitude(Float3 a, Float3 b, Float3 c) {
    const auto bits = [](Float3 x) { return _mm_castps_si128(absolute(x).v); };
    return {_mm_castsi128_ps(max_of_bits(max_of_bits(bits(a), bits(b)), bits(c)))};
}

#else

struct Float3 {
    Vec3 v;

    static Float3 load(const Vec3& p) { return {p}; }
    static Float3 all(float x) { return {{x, x, x}}; }
    void store(Vec3& p) const { p = v; }
};

inline Float3 operator+(Float3 a, Float3 b) { return {a.v + b.v}; }
inline Float3 operator-(Float3 a, Float3 b) { return {a.v - b.v}; }
inline Float3 operator*(Float3 a, Float3 b) {
    return {{a.v.x * b.v.x, a.v.y * b.v.y, a.v.z * b.v.z}};
}
inline Float3 min_of(Float3 a, Float3 b) { return {min_of(a.v, b.v)}; }
inline Float3 max_of(Float3 a, Float3 b) { return {max_of(a.v, b.v)}; }
inline bool all_at_most(Float3 a, Float3 b) {
    return a.v.x <= b.v.x && a.v.y <= b.v.y && a.v.z <= b.v.z;
}
inline bool any_at_least(Float3 a, Float3 b) {
    return a.v.x >= b.v.x || a.v.y >= b.v.y || a.v.z >= b.v.z;
}
inline Float3 absolute(Float3 a) {
    return {{a.v.x < 0 ? -a.v.x : a.v.x, a.v.y < 0 ? -a.v.y : a.v.y, a.v.z < 0 ? -a.v.z : a.v.z}};
}
inline Float3 rotated(Float3 a) { return {{a.v.y, a.v.z, a.v.x}}; }
inline float larger_or_nan(float a, float b) { return a >= b || a != a ? a : b; }
inline Float3 larger_or_nan(Float3 a, Float3 b) {
    return {
        {larger_or_nan(a.v.x, b.v.x), larger_or_nan(a.v.y, b.v.y), larger_or_nan(a.v.z, b.v.z)}};
}
inline Float3 largest_magnitude(Float3 a, Float3 b, Float3 c) {
    return larger_or_nan(larger_or_nan(absolute(a), absolute(b)), absolute(c));
}

#endif

/// A box in two registers.
struct Box3 {
    Float3 lo, hi;

    static Box3 load(const Vec3& lo, const Vec3& hi) {
        return {Float3::load(lo), Float3::load(hi)};
    }
    static Box3 load(const Aabb& box) { return load(box.lo, box.hi); }
    [[nodiscard]] Aabb box() const {
        Aabb out;
        lo.store(out.lo);
        hi.store(out.hi);
        return out;
    }
};

inline Box3 unite(const Box3& a, const Box3& b) { return {min_of(a.lo, b.lo), max_of(a.hi, b.hi)}; }

}  // namespace raydix
