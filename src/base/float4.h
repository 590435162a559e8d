// Four floats side by side for the host's hot loops over arrays: each lane does the plain
// operation, so the bits are those of scalar code. Processors without SSE take the loop.
#pragma once

#include <raydix/types.h>

#include <array>
#include <cstdint>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace raydix {

#if defined(__SSE2__)

struct Float4 {
    __m128 v;

    static Float4 load(const float* p) { return {_mm_loadu_ps(p)}; }
    /// Reads twelve bytes, no more; the last lane is 0.
    static Float4 load(const Vec3& p) {
        const __m128i xy = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(&p.x));
        return {_mm_movelh_ps(_mm_castsi128_ps(xy), _mm_load_ss(&p.z))};
    }
    static Float4 all(float x) { return {_mm_set1_ps(x)}; }
    /// Of whole numbers below 2^31.
    static Float4 of(const std::uint32_t* p) {
        return {_mm_cvtepi32_ps(_mm_loadu_si128(reinterpret_cast<const __m128i*>(p)))};
    }
    void store(float* p) const { _mm_storeu_ps(p, v); }
    /// Rounded towards zero, where that fits.
    void store_whole(std::int32_t* p) const {
        _mm_storeu_si128(reinterpret_cast<__m128i*>(p), _mm_cvttps_epi32(v));
    }
    /// The last lane becomes 0, whatever bits were in it.
    [[nodiscard]] Float4 xyz() const {
        return {_mm_and_ps(v, _mm_castsi128_ps(_mm_setr_epi32(-1, -1, -1, 0)))};
    }
};

inline Float4 operator+(Float4 a, Float4 b) { return {_mm_add_ps(a.v, b.v)}; }
inline Float4 operator-(Float4 a, Float4 b) { return {_mm_sub_ps(a.v, b.v)}; }
inline Float4 operator*(Float4 a, Float4 b) { return {_mm_mul_ps(a.v, b.v)}; }
inline Float4 min_of(Float4 a, Float4 b) { return {_mm_min_ps(a.v, b.v)}; }
inline Float4 max_of(Float4 a, Float4 b) { return {_mm_max_ps(a.v, b.v)}; }

/// A yes or no per lane: all bits of it or none.
struct Mask4 {
    __m128 v;

    static Mask4 load(const std::uint32_t* p) {
        return {_mm_castsi128_ps(_mm_loadu_si128(reinterpret_cast<const __m128i*>(p)))};
    }
};
inline Mask4 operator<(Float4 a, Float4 b) { return {_mm_cmplt_ps(a.v, b.v)}; }
inline Mask4 operator<=(Float4 a, Float4 b) { return {_mm_cmple_ps(a.v, b.v)}; }
inline Mask4 operator&(Mask4 a, Mask4 b) { return {_mm_and_ps(a.v, b.v)}; }
inline Mask4 operator|(Mask4 a, Mask4 b) { return {_mm_or_ps(a.v, b.v)}; }
/// Bit k: yes in lane k.
inline unsigned bits_of(Mask4 mask) { return static_cast<unsigned>(_mm_movemask_ps(mask.v)); }
inline Float4 absolute(Float4 a) { return {_mm_andnot_ps(_mm_set1_ps(-0.0f), a.v)}; }
inline Float4 select(Mask4 mask, Float4 yes, Float4 no) {
    return {_mm_or_ps(_mm_and_ps(mask.v, yes.v), _mm_andnot_ps(mask.v, no.v))};
}

/// Rows become columns.
inline void transpose(Float4& a, Float4& b, Float4& c, Float4& d) {
    _MM_TRANSPOSE4_PS(a.v, b.v, c.v, d.v);
}

#else

struct Float4 {
    std::array<float, 4> v;

    static Float4 load(const float* p) { return {{p[0], p[1], p[2], p[3]}}; }
    static Float4 load(const Vec3& p) { return {{p.x, p.y, p.z, 0}}; }
    static Float4 all(float x) { return {{x, x, x, x}}; }
    static Float4 of(const std::uint32_t* p) {
        const auto at = [p](int k) { return static_cast<float>(p[k]); };
        return {{at(0), at(1), at(2), at(3)}};
    }
    void store(float* p) const {
        for (std::size_t k = 0; k < 4; ++k) p[k] = v[k];
    }
    void store_whole(std::int32_t* p) const {
        for (std::size_t k = 0; k < 4; ++k) p[k] = static_cast<std::int32_t>(v[k]);
    }
    [[nodiscard]] Float4 xyz() const { return {{v[0], v[1], v[2], 0}}; }
};
struct Mask4 {
    std::array<std::uint32_t, 4> v;

    static Mask4 load(const std::uint32_t* p) { return {{p[0], p[1], p[2], p[3]}}; }
};

namespace detail {
template <class Result, class A, class B, class Op>
Result lane_by_lane(const A& a, const B& b, const Op& op) {
    Result r;
    for (std::size_t k = 0; k < 4; ++k) r.v[k] = op(a.v[k], b.v[k]);
    return r;
}
}  // namespace detail

inline Float4 operator+(Float4 a, Float4 b) {
    return detail::lane_by_lane<Float4>(a, b, [](float x, float y) { return x + y; });
}
inline Float4 operator-(Float4 a, Float4 b) {
    return detail::lane_by_lane<Float4>(a, b, [](float x, float y) { return x - y; });
}
inline Float4 operator*(Float4 a, Float4 b) {
    return detail::lane_by_lane<Float4>(a, b, [](float x, float y) { return x * y; });
}
inline Float4 min_of(Float4 a, Float4 b) {
    return detail::lane_by_lane<Float4>(a, b, [](float x, float y) { return x < y ? x : y; });
}
inline Float4 max_of(Float4 a, Float4 b) {
    return detail::lane_by_lane<Float4>(a, b, [](float x, float y) { return x > y ? x : y; });
}
inline Mask4 operator<(Float4 a, Float4 b) {
    return detail::lane_by_lane<Mask4>(a, b, [](float x, float y) { return x < y ? ~0u : 0u; });
}
inline Mask4 operator<=(Float4 a, Float4 b) {
    return detail::lane_by_lane<Mask4>(a, b, [](float x, float y) { return x <= y ? ~0u : 0u; });
}
inline Mask4 operator&(Mask4 a, Mask4 b) {
    return detail::lane_by_lane<Mask4>(a, b, [](auto x, auto y) { return x & y; });
}
inline Mask4 operator|(Mask4 a, Mask4 b) {
    return detail::lane_by_lane<Mask4>(a, b, [](auto x, auto y) { return x | y; });
}
inline unsigned bits_of(Mask4 mask) {
    unsigned bits = 0;
    for (unsigned k = 0; k < 4; ++k) bits |= (mask.v[k] != 0 ? 1u : 0u) << k;
    return bits;
}
inline Float4 absolute(Float4 a) {
    for (float& x : a.v) x = x < 0 ? -x : x + 0.0f;
    return a;
}
inline Float4 select(Mask4 mask, Float4 yes, Float4 no) {
    Float4 r;
    for (std::size_t k = 0; k < 4; ++k) r.v[k] = mask.v[k] != 0 ? yes.v[k] : no.v[k];
    return r;
}

inline void transpose(Float4& a, Float4& b, Float4& c, Float4& d) {
    const std::array<Float4, 4> m{a, b, c, d};
    const auto column = [&m](std::size_t k) {
        return Float4{{m[0].v[k], m[1].v[k], m[2].v[k], m[3].v[k]}};
    };
    a = column(0);
    b = column(1);
    c = column(2);
    d = column(3);
}

#endif

}  // namespace raydix
