// Batches of public rays through an Embree scene: an array of Ray in, an array of Hit (or of 0 and
// 1) out, in blocks over the threads, 1, 8 or 16 rays a call. The conversion on both sides is as
// cheap as it can be made: what does not change from call to call is written once a block, and
// rows are transposed four by four.
#pragma once

#include <raydix/types.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include "base/float4.h"
#include "embree_api.h"
#include "exec/parallel.h"
#include "one_by_one.h"

namespace raydix::bench {

struct EmbreeMode {
    int width = 1;  // rays a call: 1, 8 or 16
    bool coherent = false;

    [[nodiscard]] bool single() const { return width == 1; }
    [[nodiscard]] std::string name() const {
        return std::to_string(width) + (coherent ? "-wide coherent" : "-wide incoherent");
    }
};
inline constexpr EmbreeMode embree_modes[] = {{1, true},  {1, false}, {8, true},
                                              {8, false}, {16, true}, {16, false}};

namespace detail {

template <int Width>
struct EmbreeTypes;
template <>
struct EmbreeTypes<1> {
    using Rays = RTCRay;
    using RayHits = RTCRayHit;
};
template <>
struct EmbreeTypes<8> {
    using Rays = RTCRay8;
    using RayHits = RTCRayHit8;
};
template <>
struct EmbreeTypes<16> {
    using Rays = RTCRay16;
    using RayHits = RTCRayHit16;
};

/// Embree asks its callers to let denormal numbers count as zero.
class FlushDenormals {
public:
    FlushDenormals(const FlushDenormals&) = delete;
    FlushDenormals& operator=(const FlushDenormals&) = delete;
#ifdef __SSE2__
    FlushDenormals() : saved_(_mm_getcsr()) { _mm_setcsr(saved_ | 0x8040u); }
    ~FlushDenormals() { _mm_setcsr(saved_); }

private:
    unsigned saved_;
#else
    FlushDenormals() = default;
#endif
};

/// Four rows of four floats that are `stride` floats apart, into four columns.
inline void copy_transposed(const float* from, std::size_t stride, float* c0, float* c1, float* c2,
                            float* c3) {
    Float4 a = Float4::load(from), b = Float4::load(from + stride),
           c = Float4::load(from + 2 * stride), d = Float4::load(from + 3 * stride);
    transpose(a, b, c, d);
    a.store(c0);
    b.store(c1);
    c.store(c2);
    d.store(c3);
}

inline void set_ray(RTCRay& to, const Ray& ray) {
    to.org_x = ray.origin.x;
    to.org_y = ray.origin.y;
    to.org_z = ray.origin.z;
    to.tnear = ray.tmin;
    to.dir_x = ray.direction.x;
    to.dir_y = ray.direction.y;
    to.dir_z = ray.direction.z;
    to.tfar = ray.tmax;
}

/// `count` rays; the lanes behind them repeat what was there before and are switched off.
template <class Rays>
void set_rays(Rays& to, const Ray* rays, std::size_t count) {
    std::size_t k = 0;
    for (; k + 4 <= count; k += 4) {
        const float* from = &rays[k].origin.x;
        copy_transposed(from, 8, to.org_x + k, to.org_y + k, to.org_z + k, to.tnear + k);
        copy_transposed(from + 4, 8, to.dir_x + k, to.dir_y + k, to.dir_z + k, to.tfar + k);
    }
    for (; k < count; ++k) {
        to.org_x[k] = rays[k].origin.x;
        to.org_y[k] = rays[k].origin.y;
        to.org_z[k] = rays[k].origin.z;
        to.tnear[k] = rays[k].tmin;
        to.dir_x[k] = rays[k].direction.x;
        to.dir_y[k] = rays[k].direction.y;
        to.dir_z[k] = rays[k].direction.z;
        to.tfar[k] = rays[k].tmax;
    }
}

/// Hits of scenes that hold more than one mesh have places for these; of others, nothing.
template <class Out>
void set_place(Out& hit, unsigned geometry, unsigned instance) {
    if constexpr (requires { hit.instance; }) {
        const bool missed = geometry == RTC_INVALID_GEOMETRY_ID;
        hit.geometry = geometry;
        hit.instance = missed ? no_primitive : instance;
    }
}

/// The geometry ids are masks of the rays that missed: 0, the one geometry of a scene, or all ones.
/// Out: Hit, or what begins like it.
template <class RayHits, class Out>
void get_hits(const RayHits& from, Out* hits, std::size_t count) {
    static_assert(RTC_INVALID_GEOMETRY_ID == ~0u && no_primitive == ~0u);
    std::size_t k = 0;
    for (; k + 4 <= count; k += 4) {
        const Mask4 missed = Mask4::load(from.hit.geomID + k);
        const auto bits = [k](const unsigned* ids) {
            return Float4::load(reinterpret_cast<const float*>(ids + k));
        };
        Float4 t = select(missed, Float4::all(infinity), Float4::load(from.ray.tfar + k)),
               prim = select(missed, bits(from.hit.geomID), bits(from.hit.primID)),
               u = select(missed, Float4::all(0), Float4::load(from.hit.u + k)),
               v = select(missed, Float4::all(0), Float4::load(from.hit.v + k));
        transpose(t, prim, u, v);
        t.store(&hits[k].t);
        prim.store(&hits[k + 1].t);
        u.store(&hits[k + 2].t);
        v.store(&hits[k + 3].t);
        for (std::size_t i = k; i < k + 4; ++i)
            set_place(hits[i], from.hit.geomID[i], from.hit.instID[0][i]);
    }
    for (; k < count; ++k) {
        const bool missed = from.hit.geomID[k] == RTC_INVALID_GEOMETRY_ID;
        hits[k] = missed ? Out{}
                         : Out{from.ray.tfar[k], from.hit.primID[k], from.hit.u[k], from.hit.v[k]};
        set_place(hits[k], from.hit.geomID[k], from.hit.instID[0][k]);
    }
}

template <int Width, class Out>
void closest_block(RTCScene scene, bool coherent, std::span<const Ray> rays, Out* hits) {
    EmbreeQuery query(coherent);
    typename EmbreeTypes<Width>::RayHits packet{};
    alignas(64) int valid[Width];
    std::fill_n(valid, Width, -1);
    if constexpr (Width == 1) {
        packet.ray.mask = ~0u;
    } else {
        std::fill_n(packet.ray.mask, Width, ~0u);
    }
    for (std::size_t i = 0; i < rays.size(); i += Width) {
        const std::size_t count = std::min<std::size_t>(Width, rays.size() - i);
        if constexpr (Width == 1) {
            set_ray(packet.ray, rays[i]);
            packet.hit.geomID = RTC_INVALID_GEOMETRY_ID;
            intersect(valid, scene, query, packet);
            const RTCHit& hit = packet.hit;
            hits[i] = hit.geomID != RTC_INVALID_GEOMETRY_ID
                          ? Out{packet.ray.tfar, hit.primID, hit.u, hit.v}
                          : Out{};
            set_place(hits[i], hit.geomID, hit.instID[0]);
        } else {
            set_rays(packet.ray, &rays[i], count);
            std::fill_n(packet.hit.geomID, Width, RTC_INVALID_GEOMETRY_ID);
            std::fill(valid + count, valid + Width, 0);
            intersect(valid, scene, query, packet);
            get_hits(packet, hits + i, count);
        }
    }
}

template <int Width>
void any_block(RTCScene scene, bool coherent, std::span<const Ray> rays, std::uint8_t* found) {
    EmbreeQuery query(coherent);
    typename EmbreeTypes<Width>::Rays packet{};
    alignas(64) int valid[Width];
    std::fill_n(valid, Width, -1);
    if constexpr (Width == 1) {
        packet.mask = ~0u;
    } else {
        std::fill_n(packet.mask, Width, ~0u);
    }
    for (std::size_t i = 0; i < rays.size(); i += Width) {
        const std::size_t count = std::min<std::size_t>(Width, rays.size() - i);
        if constexpr (Width == 1) {
            set_ray(packet, rays[i]);
            occluded(valid, scene, query, packet);
            found[i] = packet.tfar < 0;
        } else {
            set_rays(packet, &rays[i], count);
            std::fill(valid + count, valid + Width, 0);
            occluded(valid, scene, query, packet);
            for (std::size_t k = 0; k < count; ++k) found[i + k] = packet.tfar[k] < 0;
        }
    }
}

/// Calls block(width as a constant, begin, end) for blocks of all rays.
template <class Block>
void for_each_ray_block(int width, std::size_t rays, const Block& block) {
    for_each_block(rays, rays_of_a_block, [&](std::size_t, std::size_t begin, std::size_t end) {
        const FlushDenormals flush;
        if (width == 1) block(std::integral_constant<int, 1>(), begin, end);
        if (width == 8) block(std::integral_constant<int, 8>(), begin, end);
        if (width == 16) block(std::integral_constant<int, 16>(), begin, end);
    });
}

}  // namespace detail

/// On the threads of the calling context (with_threads). rays [n] -> hits [n].
template <class Out = Hit>
void trace_embree(RTCScene scene, EmbreeMode mode, std::span<const Ray> rays,
                  std::span<std::type_identity_t<Out>> hits) {
    detail::for_each_ray_block(
        mode.width, rays.size(), [&](auto width, std::size_t begin, std::size_t end) {
            detail::closest_block<width()>(scene, mode.coherent, rays.subspan(begin, end - begin),
                                           hits.data() + begin);
        });
}

/// rays [n] -> found [n]: 1 where anything is hit.
inline void trace_any_embree(RTCScene scene, EmbreeMode mode, std::span<const Ray> rays,
                             std::span<std::uint8_t> found) {
    detail::for_each_ray_block(
        mode.width, rays.size(), [&](auto width, std::size_t begin, std::size_t end) {
            detail::any_block<width()>(scene, mode.coherent, rays.subspan(begin, end - begin),
                                       found.data() + begin);
        });
}

}  // namespace raydix::bench
