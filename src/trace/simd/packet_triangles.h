// The triangles of a leaf against the rays of a packet. Included once per instruction set by
// simd_kernels.cpp.
#if defined(RAYDIX_SIMD_PACKET_TRIANGLES_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_PACKET_TRIANGLES_H
#undef RAYDIX_SIMD_PACKET_TRIANGLES_H
#else
#define RAYDIX_SIMD_PACKET_TRIANGLES_H
#endif

#include <hwy/highway.h>

#include <bit>

#include "trace/simd/lanes.h"
#include "trace/simd/quads.h"
#include "trace/simd/ray_classes.h"
#include "trace/simd/wide_ray.h"
#include "trace/triangle_test.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

constexpr std::size_t packet_size = 64;

/// Rays of one class (ray_classes.h), as arrays. Places from `count` on are never active: their t
/// is -infinity; the rest repeats a ray in the last vector that holds one, and is not set behind
/// it.
struct Packet {
    HWY_ALIGN float origin[3][packet_size];
    HWY_ALIGN float inverse[3][packet_size];  // limited
    // Of plain nodes: a plane is near + inverse * plane away, or far + inverse * plane.
    HWY_ALIGN float near[3][packet_size], far[3][packet_size];
    HWY_ALIGN float true_inverse[3][packet_size];
    HWY_ALIGN float shear_x[packet_size], shear_y[packet_size], shear_z[packet_size];
    HWY_ALIGN float tmin[packet_size];
    HWY_ALIGN float t[packet_size], u[packet_size], v[packet_size];
    HWY_ALIGN std::uint32_t prim[packet_size];
    std::uint32_t count;
    RayClass kind;
    float pad[3];  // of boxes, the largest of all rays; positive
    float origin_lo[3], origin_hi[3];
    float least_inverse[3], largest_inverse[3];  // magnitudes
    float least_tmin;
    bool one_origin;  // all rays start at origin_lo
};

/// Finds the hits of a packet's rays on the triangles of leaves, with the bits of
/// intersect_triangle; hits go into the packet.
template <bool any>
class PacketTriangles {
public:
    /// `rays`: what the packet was filled with, rays[index[k]].
    PacketTriangles(Packet& packet, const Ray* rays, const std::int32_t* index)
        : p_(packet), rays_(rays), index_(index) {
        for (int axis = 0; axis < 3; ++axis) negative_[axis] = packet.kind.negative(axis);
    }

    /// Rays that have hit.
    [[nodiscard]] std::uint64_t found() const { return found_; }

    /// The rays in `active` against triangles lane to lane + count - 1. Whether any has hit or come
    /// nearer.
    bool test(const TriangleBlock& block, std::uint32_t lane, std::uint32_t count,
              std::uint64_t active) {
        std::uint32_t vectors = 0;
        for (std::size_t i = 0; i < packet_size; i += lanes16)
            vectors += (active >> i & vector_bits) != 0;
        const auto ray_count = static_cast<std::uint32_t>(std::popcount(active));
        const std::uint32_t quads = (ray_count + rays_a_quad - 1) / rays_a_quad;
        if (quads_pay(quads, vectors * count))
            return test_quads(block, ((1u << count) - 1) << lane, active);
        return p_.one_origin ? test_vectors<true>(block, lane, count, active)
                             : test_vectors<false>(block, lane, count, active);
    }

private:
    using V = hn::Vec<F16>;
    static constexpr std::uint64_t vector_bits = (std::uint64_t{1} << lanes16) - 1;

    /// A few rays with four triangles each cost about half as much again as a vector of rays with
    /// one triangle, which goes on longer where there are many.
    static constexpr bool quads_pay(std::uint32_t quads, std::uint32_t tests) {
        return quads <= 2 ? quads <= tests : 3 * quads <= 2 * tests;
    }

    /// Corners as rays see them from where they start.
    struct Corners {
        HWY_ALIGN float from_origin[9][block_lanes];
    };

    template <bool one_origin>
    HWY_INLINE bool test_vectors(const TriangleBlock& block, std::uint32_t lane,
                                 std::uint32_t count, std::uint64_t active) {
        Corners corners;
        if constexpr (one_origin) {
            for (std::size_t k = 0; k < 9; ++k)
                hn::Store(hn::Sub(hn::Load(f4, block.corner[k]), hn::Set(f4, p_.origin_lo[k % 3])),
                          f4, corners.from_origin[k]);
        }
        bool changed = false;
        for (std::size_t vector = 0; vector < packet_size / lanes16; ++vector) {
            const auto wanted =
                static_cast<std::uint32_t>(active >> (vector * lanes16) & vector_bits);
            if (wanted == 0) continue;
            for (std::uint32_t k = lane; k < lane + count; ++k)
                changed |= test_triangle<one_origin>(block, corners, k, vector * lanes16, wanted);
        }
        return changed;
    }

    /// Rays whose tests with four triangles fill a vector.
    static constexpr std::size_t rays_a_quad = lanes16 / 4;

    struct Sheared {
        V x, y, z;  // z before shear_z
    };

    /// The triangles of a block against a few rays each: lane 4 r + l is ray r of a few with lane
    /// l of the block. The bits of test_triangle.
    HWY_INLINE bool test_quads(const TriangleBlock& block, std::uint32_t lanes,
                               std::uint64_t active) {
        std::uint32_t all_lanes = 0;
        for (std::size_t r = 0; r < rays_a_quad; ++r) all_lanes |= lanes << (4 * r);
        bool changed = false;
        while (active != 0) {
            std::uint32_t ray[rays_a_quad], wanted = all_lanes;
            for (std::size_t r = 0; r < rays_a_quad; ++r) {
                if (active != 0) {
                    ray[r] = static_cast<std::uint32_t>(std::countr_zero(active));
                    active &= active - 1;
                } else {
                    ray[r] = ray[0];
                    wanted &= ~(0xFu << (4 * r));
                }
            }
            changed |= test_quad(block, ray, wanted);
        }
        return changed;
    }

    /// Component `axis` of a row's floats in all lanes of its block.
    static HWY_INLINE V spread(V row, std::uint32_t axis) {
        const hn::Repartition<std::uint8_t, F16> bytes;
        const auto index = hn::Set(U16(), 0x03020100u + 0x04040404u * axis);
        return hn::BitCast(
            f16, hn::TableLookupBytes(hn::BitCast(bytes, row), hn::BitCast(bytes, index)));
    }

    HWY_INLINE bool test_quad(const TriangleBlock& block, const std::uint32_t* ray,
                              std::uint32_t wanted) {
        const auto start = [&](std::size_t l) { return &rays_[index_[ray[l / 4]]].origin.x; };
        const auto way = [&](std::size_t l) { return &rays_[index_[ray[l / 4]]].direction.x; };
        const RayClass& kind = p_.kind;
        const V origin = hn::Add(load_blocks(start), hn::Zero(f16));  // -0 becomes +0
        const V direction = load_blocks(way);
        const V slope = hn::Div(direction, spread(direction, kind.kz));
        const V shear_x = spread(slope, kind.kx), shear_y = spread(slope, kind.ky);
        const V origin_x = spread(origin, kind.kx), origin_y = spread(origin, kind.ky),
                origin_z = spread(origin, kind.kz);
        const auto at = [&](int vertex) {
            const auto corner = [&](std::uint32_t axis) {
                return hn::LoadDup128(f16, block.corner[3 * vertex + static_cast<int>(axis)]);
            };
            const V z = hn::Sub(corner(kind.kz), origin_z);
            return Sheared{hn::Sub(hn::Sub(corner(kind.kx), origin_x), hn::Mul(shear_x, z)),
                           hn::Sub(hn::Sub(corner(kind.ky), origin_y), hn::Mul(shear_y, z)), z};
        };
        const Sheared a = at(0), b = at(1), c = at(2);
        const V u = edge(c, b), v = edge(a, c), w = edge(b, a);
        std::uint32_t candidates = wanted & ~bits_of(f16, outside(u, v, w));
        if (candidates == 0) return false;
        std::uint32_t near_edge = candidates & bits_of(f16, on_edge(u, v, w));
        candidates &= ~near_edge;
        bool changed = false;
        for (; near_edge != 0; near_edge &= near_edge - 1) {
            const auto l = static_cast<std::uint32_t>(std::countr_zero(near_edge));
            changed |= test_exactly(block, l % 4, ray[l / 4], 1);
        }
        if (candidates == 0) return changed;
        return accept_quad(block, ray, candidates, origin, direction, a, b, c, u, v, w) || changed;
    }

    HWY_INLINE bool accept_quad(const TriangleBlock& block, const std::uint32_t* ray,
                                std::uint32_t candidates, V origin, V direction, const Sheared& a,
                                const Sheared& b, const Sheared& c, V u, V v, V w) {
        const V determinant = hn::Add(hn::Add(u, v), w);
        const V inverse = hn::Div(hn::Set(f16, 1.0f), direction);
        const V shear_z = spread(inverse, p_.kind.kz);
        V t = hn::Div(depth_of(a, b, c, u, v, w, shear_z), determinant);
        V entry = hn::Set(f16, -infinity), exit = hn::Set(f16, infinity);
        for (std::uint32_t axis = 0; axis < 3; ++axis) {
            const V p = hn::LoadDup128(f16, block.corner[axis]),
                    q = hn::LoadDup128(f16, block.corner[3 + axis]),
                    r = hn::LoadDup128(f16, block.corner[6 + axis]);
            const V lo = hn::Min(hn::Min(p, q), r), hi = hn::Max(hn::Max(p, q), r);
            const V o = spread(origin, axis), i = spread(inverse, axis);
            const V near = hn::Mul(hn::Sub(negative_[axis] ? hi : lo, o), i);
            const V far = hn::Mul(hn::Sub(negative_[axis] ? lo : hi, o), i);
            entry = hn::IfThenElse(hn::Gt(near, entry), near, entry);
            exit = hn::IfThenElse(hn::Lt(far, exit), far, exit);
        }
        t = held_within(t, entry, exit);
        const Lanes sound = is_sound(determinant);
        candidates &= bits_of(f16, sound);
        HWY_ALIGN float ts[lanes16], us[lanes16], vs[lanes16];
        hn::Store(t, f16, ts);
        hn::Store(hn::Div(v, determinant), f16, us);
        hn::Store(hn::Div(w, determinant), f16, vs);
        bool changed = false;
        for (; candidates != 0; candidates &= candidates - 1) {
            const auto l = static_cast<std::uint32_t>(std::countr_zero(candidates));
            const std::uint32_t k = ray[l / 4], prim = block.prim[l % 4];
            if (!(ts[l] >= p_.tmin[k] && ts[l] <= p_.t[k])) continue;
            found_ |= std::uint64_t{1} << k;
            changed = true;
            if (any) continue;
            if (ts[l] < p_.t[k] || prim < p_.prim[k])
                p_.t[k] = ts[l], p_.u[k] = us[l], p_.v[k] = vs[l], p_.prim[k] = prim;
        }
        return changed;
    }

    template <bool one_origin>
    HWY_INLINE Sheared shear(const TriangleBlock& block, const Corners& corners, int vertex,
                             std::uint32_t lane, std::size_t i) const {
        const auto at = [&](std::uint32_t axis) {
            const int k = 3 * vertex + static_cast<int>(axis);
            if constexpr (one_origin) return hn::Set(f16, corners.from_origin[k][lane]);
            return hn::Sub(hn::Set(f16, block.corner[k][lane]), hn::Load(f16, p_.origin[axis] + i));
        };
        const V z = at(p_.kind.kz);
        return {hn::Sub(at(p_.kind.kx), hn::Mul(hn::Load(f16, p_.shear_x + i), z)),
                hn::Sub(at(p_.kind.ky), hn::Mul(hn::Load(f16, p_.shear_y + i), z)), z};
    }
    static HWY_INLINE V edge(const Sheared& a, const Sheared& b) {
        return hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x));
    }
    using Lanes = hn::Mask<F16>;
    /// Edge functions of both signs.
    static HWY_INLINE Lanes outside(V u, V v, V w) {
        const V zero = hn::Zero(f16);
        return hn::And(hn::Lt(hn::Min(hn::Min(u, v), w), zero),
                       hn::Gt(hn::Max(hn::Max(u, v), w), zero));
    }
    static HWY_INLINE Lanes on_edge(V u, V v, V w) {
        const V zero = hn::Zero(f16);
        return hn::Or(hn::Or(hn::Eq(u, zero), hn::Eq(v, zero)), hn::Eq(w, zero));
    }
    static HWY_INLINE V depth_of(const Sheared& a, const Sheared& b, const Sheared& c, V u, V v,
                                 V w, V shear_z) {
        return hn::Add(
            hn::Add(hn::Mul(u, hn::Mul(shear_z, a.z)), hn::Mul(v, hn::Mul(shear_z, b.z))),
            hn::Mul(w, hn::Mul(shear_z, c.z)));
    }
    /// t within the triangle's box.
    static HWY_INLINE V held_within(V t, V entry, V exit) {
        V held = hn::IfThenElse(hn::Gt(t, entry), t, entry);
        held = hn::IfThenElse(hn::Lt(held, exit), held, exit);
        return hn::IfThenElse(hn::Le(entry, exit), held, t);
    }
    static HWY_INLINE Lanes is_sound(V determinant) {
        return hn::And(hn::Ne(determinant, hn::Zero(f16)),
                       hn::Lt(hn::Abs(determinant), hn::Set(f16, infinity)));
    }

    /// intersect_triangle for the rays i + (bits of `wanted`): the same bits. Whether any ray came
    /// nearer.
    template <bool one_origin>
    HWY_INLINE bool test_triangle(const TriangleBlock& block, const Corners& corners,
                                  std::uint32_t lane, std::size_t i, std::uint32_t wanted) {
        const Sheared a = shear<one_origin>(block, corners, 0, lane, i),
                      b = shear<one_origin>(block, corners, 1, lane, i),
                      c = shear<one_origin>(block, corners, 2, lane, i);
        const V u = edge(c, b), v = edge(a, c), w = edge(b, a);
        std::uint32_t candidates = wanted & ~bits_of(f16, outside(u, v, w));
        if (candidates == 0) return false;
        const std::uint32_t near_edge = candidates & bits_of(f16, on_edge(u, v, w));
        bool changed = false;
        if (near_edge != 0) changed = test_exactly(block, lane, i, near_edge);
        candidates &= ~near_edge;
        if (candidates == 0) return changed;
        return accept(block, lane, i, candidates, a, b, c, u, v, w) || changed;
    }

    [[nodiscard]] RayFrame frame_of(std::size_t k) const {
        RayFrame frame;
        frame.origin = {p_.origin[0][k], p_.origin[1][k], p_.origin[2][k]};
        frame.inverse = {p_.true_inverse[0][k], p_.true_inverse[1][k], p_.true_inverse[2][k]};
        frame.kx = static_cast<int>(p_.kind.kx), frame.ky = static_cast<int>(p_.kind.ky),
        frame.kz = static_cast<int>(p_.kind.kz);
        frame.shear_x = p_.shear_x[k], frame.shear_y = p_.shear_y[k], frame.shear_z = p_.shear_z[k];
        frame.tmin = p_.tmin[k], frame.tmax = p_.t[k];
        frame.t_scale = 1.0f;
        return frame;
    }

    HWY_NOINLINE bool test_exactly(const TriangleBlock& block, std::uint32_t lane, std::size_t i,
                                   std::uint32_t rays) {
        bool changed = false;
        for (; rays != 0; rays &= rays - 1) {
            const std::size_t k = i + static_cast<std::size_t>(std::countr_zero(rays));
            TriangleHit hit;
            if (!intersect_triangle<EdgeRule::closed>(frame_of(k), triangle_of(block, lane),
                                                      p_.t[k], hit))
                continue;
            found_ |= std::uint64_t{1} << k;
            if (hit.t < p_.t[k] || block.prim[lane] < p_.prim[k]) {
                p_.t[k] = hit.t, p_.u[k] = hit.u, p_.v[k] = hit.v, p_.prim[k] = block.prim[lane];
                changed = true;
            }
        }
        return changed;
    }

    HWY_INLINE bool accept(const TriangleBlock& block, std::uint32_t lane, std::size_t i,
                           std::uint32_t candidates, const Sheared& a, const Sheared& b,
                           const Sheared& c, V u, V v, V w) {
        const V determinant = hn::Add(hn::Add(u, v), w);
        const V shear_z = hn::Load(f16, p_.shear_z + i);
        V t = hn::Div(depth_of(a, b, c, u, v, w, shear_z), determinant);
        V entry = hn::Set(f16, -infinity), exit = hn::Set(f16, infinity);
        for (int axis = 0; axis < 3; ++axis) {
            const float p = block.corner[axis][lane], q = block.corner[3 + axis][lane],
                        r = block.corner[6 + axis][lane];
            const float lo = min_of(min_of(p, q), r), hi = max_of(max_of(p, q), r);
            const V origin = hn::Load(f16, p_.origin[axis] + i);
            const V inverse = hn::Load(f16, p_.true_inverse[axis] + i);
            const V near =
                hn::Mul(hn::Sub(hn::Set(f16, negative_[axis] ? hi : lo), origin), inverse);
            const V far =
                hn::Mul(hn::Sub(hn::Set(f16, negative_[axis] ? lo : hi), origin), inverse);
            entry = hn::IfThenElse(hn::Gt(near, entry), near, entry);
            exit = hn::IfThenElse(hn::Lt(far, exit), far, exit);
        }
        t = held_within(t, entry, exit);
        const V reach = hn::Load(f16, p_.t + i);
        const Lanes sound = is_sound(determinant);
        const auto in_reach = hn::And(hn::Ge(t, hn::Load(f16, p_.tmin + i)), hn::Le(t, reach));
        candidates &= bits_of(f16, hn::And(sound, in_reach));
        if (candidates == 0) return false;
        found_ |= std::uint64_t{candidates} << i;
        if constexpr (any) return true;
        // At equal t the lower primitive wins.
        const U16 u16;
        const auto prim = hn::Set(u16, block.prim[lane]);
        const auto old_prim = hn::Load(u16, p_.prim + i);
        const auto better =
            hn::Or(hn::Lt(t, reach), hn::RebindMask(f16, hn::Eq(hn::Min(prim, old_prim), prim)));
        const auto take = hn::And(better, mask_of(f16, candidates));
        hn::Store(hn::IfThenElse(take, t, reach), f16, p_.t + i);
        hn::Store(hn::IfThenElse(take, hn::Div(v, determinant), hn::Load(f16, p_.u + i)), f16,
                  p_.u + i);
        hn::Store(hn::IfThenElse(take, hn::Div(w, determinant), hn::Load(f16, p_.v + i)), f16,
                  p_.v + i);
        hn::Store(hn::IfThenElse(hn::RebindMask(u16, take), prim, old_prim), u16, p_.prim + i);
        return true;
    }

    Packet& p_;
    const Ray* const rays_;
    const std::int32_t* const index_;
    bool negative_[3];
    std::uint64_t found_ = 0;
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
