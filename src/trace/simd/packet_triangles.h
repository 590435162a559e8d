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

#include "trace/all_hits.h"
#include "trace/simd/block_hits.h"
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
    HWY_ALIGN float direction[3][packet_size];
    HWY_ALIGN float shear_x[packet_size], shear_y[packet_size];
    HWY_ALIGN float tmin[packet_size];
    HWY_ALIGN float t[packet_size], u[packet_size], v[packet_size];
    HWY_ALIGN std::uint32_t prim[packet_size];
    std::uint32_t count;
    RayClass kind;
    float pad[3];  // of boxes, the largest of all rays
    float origin_lo[3], origin_hi[3];
    float least_inverse[3], largest_inverse[3];  // magnitudes
    float least_tmin;
    bool one_origin;  // all rays start at origin_lo
};

/// Finds the hits of a packet's rays on the triangles of leaves, with the bits of
/// intersect_triangle; hits go into the packet, or to `all` if all are wanted.
template <Wanted query>
class PacketTriangles {
    static constexpr bool any = wants_any(query);
    /// What floats tell of a hit will do.
    static constexpr bool roughly = query == Wanted::any;

public:
    /// `rays`: what the packet was filled with, rays[index[k]]. `all`: in no order, found_by that
    /// index. `check`: of accepted hits.
    PacketTriangles(Packet& packet, const Ray* rays, const std::int32_t* index,
                    BudgetVector<Hit>* all = nullptr, const HitCheck* check = nullptr)
        : p_(packet), rays_(rays), index_(index), all_(all), check_(check) {}

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
        const auto quads = static_cast<std::uint32_t>((ray_count + rays_a_quad - 1) / rays_a_quad);
        if (quads_pay(quads, vectors * count))
            return test_quads(block, ((1u << count) - 1) << lane, active);
        return p_.one_origin ? test_vectors<true>(block, lane, count, active)
                             : test_vectors<false>(block, lane, count, active);
    }

private:
    using V = hn::Vec<F16>;
    using Corner = Sheared<F16>;
    /// A vector of doubles, and the floats that become one.
    using D = hn::Repartition<double, F16>;
    using H = weights::HalfOf<D>;
    using VD = hn::Vec<D>;
    static constexpr std::size_t lanes_d = hn::MaxLanes(D());
    static constexpr std::uint64_t vector_bits = (std::uint64_t{1} << lanes16) - 1;

    /// A few rays with four triangles each cost about half as much again as a vector of rays with
    /// one triangle, which goes on longer where there are many.
    static constexpr bool quads_pay(std::uint32_t quads, std::uint32_t tests) {
        return quads <= 2 ? quads <= tests : 3 * quads <= 2 * tests;
    }

    /// One triangle for all vectors of rays: its corners along kx, ky and kz, from where the rays
    /// start if they all start there.
    template <bool one_origin>
    struct Target {
        const TriangleBlock& block;
        const std::uint32_t lane;
        float corner[3][3];
        // From the first hit on: the same in double, and what has_far_corner needs of them.
        double exact[3][3], farthest;
        bool has_exact = false, may_be_far;

        HWY_INLINE Target(const TriangleBlock& of, std::uint32_t at, const Packet& p)
            : block(of), lane(at) {
            for (std::size_t v = 0; v < 3; ++v)
                for (std::size_t k = 0; k < 3; ++k)
                    corner[v][k] = of.corner[3 * v + p.kind.axis(k)][at] -
                                   (one_origin ? p.origin_lo[p.kind.axis(k)] : 0.0f);
        }
        HWY_NOINLINE void add_exact(const Packet& p) {
            for (std::size_t v = 0; v < 3; ++v)
                for (std::size_t k = 0; k < 3; ++k)
                    exact[v][k] = double{block.corner[3 * v + p.kind.axis(k)][lane]} -
                                  double{p.origin_lo[p.kind.axis(k)]};
            const double z[3] = {exact[0][2], exact[1][2], exact[2][2]};
            farthest = max_of(max_of(std::fabs(z[0]), std::fabs(z[1])), std::fabs(z[2]));
            // Rays meet it between its corners, half of far_corner leaves room for rounding.
            const double least = min_of(min_of(std::fabs(z[0]), std::fabs(z[1])), std::fabs(z[2]));
            may_be_far =
                !(z[0] * z[1] > 0 && z[0] * z[2] > 0 && farthest <= least * (far_corner / 2));
            has_exact = true;
        }
    };

    template <bool one_origin>
    HWY_INLINE bool test_vectors(const TriangleBlock& block, std::uint32_t lane,
                                 std::uint32_t count, std::uint64_t active) {
        bool changed = false;
        for (const std::uint32_t end = lane + count; lane < end; ++lane) {
            Target<one_origin> target(block, lane, p_);
            for (std::uint64_t rest = active; rest != 0;) {
                const std::size_t i =
                    static_cast<std::size_t>(std::countr_zero(rest)) / lanes16 * lanes16;
                rest &= ~(vector_bits << i);
                changed |=
                    test_triangle(target, i, static_cast<std::uint32_t>(active >> i & vector_bits));
            }
        }
        return changed;
    }

    /// Rays whose tests with four triangles fill a vector.
    static constexpr std::size_t rays_a_quad = lanes16 / 4;

    /// The triangles of a block against a few rays each: lane 4 r + l is ray r of a few with lane
    /// l of the block. The bits of test_triangle.
    HWY_INLINE bool test_quads(const TriangleBlock& block, std::uint32_t lanes,
                               std::uint64_t active) {
        std::uint32_t all_lanes = 0;
        for (std::size_t r = 0; r < rays_a_quad; ++r) all_lanes |= lanes << (4 * r);
        bool changed = false;
        while (active != 0) {
            std::uint32_t ray[rays_a_quad]{}, wanted = all_lanes;
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

    /// Lane l: values[ray[l / 4]].
    static HWY_INLINE V of_rays(const float* values, const std::uint32_t* ray) {
#if HWY_TARGET == HWY_AVX3
        __m512 out = _mm512_set1_ps(values[ray[0]]);
        out = _mm512_mask_broadcastss_ps(out, 0x00F0, _mm_load_ss(values + ray[1]));
        out = _mm512_mask_broadcastss_ps(out, 0x0F00, _mm_load_ss(values + ray[2]));
        return V{_mm512_mask_broadcastss_ps(out, 0xF000, _mm_load_ss(values + ray[3]))};
#elif HWY_TARGET == HWY_AVX2
        return V{_mm256_insertf128_ps(_mm256_broadcast_ss(values + ray[0]),
                                      _mm_broadcast_ss(values + ray[1]), 1)};
#else
        static_assert(rays_a_quad == 1);
        return hn::Set(f16, values[ray[0]]);
#endif
    }
    /// Where they start along an axis.
    HWY_INLINE V starts_of(std::uint32_t axis, const std::uint32_t* ray) const {
        return p_.one_origin ? hn::Set(f16, p_.origin_lo[axis]) : of_rays(p_.origin[axis], ray);
    }

    HWY_INLINE bool test_quad(const TriangleBlock& block, const std::uint32_t* ray,
                              std::uint32_t wanted) {
        const RayClass& kind = p_.kind;
        const V shear_x = of_rays(p_.shear_x, ray), shear_y = of_rays(p_.shear_y, ray);
        const V origin_x = starts_of(kind.kx, ray), origin_y = starts_of(kind.ky, ray),
                origin_z = starts_of(kind.kz, ray);
        const auto at = [&](int vertex) {
            const auto corner = [&](std::uint32_t axis) {
                return hn::LoadDup128(f16, block.corner[3 * vertex + static_cast<int>(axis)]);
            };
            const V z = hn::Sub(corner(kind.kz), origin_z);
            return Corner{hn::Sub(hn::Sub(corner(kind.kx), origin_x), hn::Mul(shear_x, z)),
                          hn::Sub(hn::Sub(corner(kind.ky), origin_y), hn::Mul(shear_y, z)), z};
        };
        const Corner a = at(0), b = at(1), c = at(2);
        const V u = edge(c, b), v = edge(a, c), w = edge(b, a);
        std::uint32_t candidates = wanted & ~bits_of(f16, astride(f16, u, v, w));
        if (candidates == 0) return false;
        const std::uint32_t clear = bits_of(f16, without_zero(f16, u, v, w));
        bool certain = false;
        if constexpr (roughly) {
            const AnyHit hit = any_hit(f16,
                                       limits(of_rays(p_.tmin, ray), of_rays(p_.t, ray),
                                              of_rays(p_.direction[kind.kz], ray)),
                                       a, b, c, u, v, w, candidates, clear);
            for (std::size_t r = 0; r < rays_a_quad; ++r) {
                if ((hit.certain >> (4 * r) & 0xFu) == 0) continue;
                found_ |= std::uint64_t{1} << ray[r];
                candidates &= ~(0xFu << (4 * r));
            }
            certain = hit.certain != 0;
            candidates &= hit.open;
            if (candidates == 0) return certain;
        }
        return finish_quad(block, ray, candidates, clear) || certain;
    }

    /// The second half of the test for lanes of test_quad; `clear`: those none of whose edge
    /// functions is 0 or NaN. Whether any ray has hit or came nearer.
    HWY_INLINE bool finish_quad(const TriangleBlock& block, const std::uint32_t* ray,
                                std::uint32_t candidates, std::uint32_t clear) {
        const D d;
        const H h;
        const RayClass& kind = p_.kind;
        HWY_ALIGN float from[4][lanes16], way[3][lanes16];  // the fourth: tmin
        for (std::size_t k = 0; k < 3; ++k) {
            hn::Store(starts_of(kind.axis(k), ray), f16, from[k]);
            hn::Store(of_rays(p_.direction[kind.axis(k)], ray), f16, way[k]);
        }
        hn::Store(of_rays(p_.tmin, ray), f16, from[3]);
        HWY_ALIGN float t[lanes16], u[lanes16], v[lanes16];
        std::uint32_t sure = 0;
        for (std::size_t part = 0; part < lanes16; part += lanes_d) {
            if (((candidates & clear) >> part & ((1u << lanes_d) - 1)) == 0) continue;
            VD corner[3][3], way_d[3];
            for (std::uint32_t k = 0; k < 3; ++k) {
                const VD start = hn::PromoteTo(d, hn::Load(h, from[k] + part));
                way_d[k] = hn::PromoteTo(d, hn::Load(h, way[k] + part));
                for (std::uint32_t c = 0; c < 3; ++c) {
                    const float* const row = block.corner[3 * c + kind.axis(k)];
                    hn::Vec<H> at;
                    if constexpr (lanes_d >= block_lanes)
                        at = hn::LoadDup128(h, row);
                    else
                        at = hn::LoadU(h, row + part % block_lanes);
                    corner[c][k] = hn::Sub(hn::PromoteTo(d, at), start);
                }
            }
            const auto at = weights::weigh(d, corner, way_d);
            const auto tmin = hn::PromoteTo(d, hn::Load(h, from[3] + part));
            sure |=
                (weights::inside(d, at) &
                 weights::without_far_corner(d, weights::farthest(corner), at.t, tmin, way_d[2]))
                << part;
            hn::Store(weights::rounded(d, at.t), h, t + part);
            hn::Store(weights::rounded(d, at.u), h, u + part);
            hn::Store(weights::rounded(d, at.v), h, v + part);
        }
        sure &= clear;
        bool changed = false;
        for (; candidates != 0; candidates &= candidates - 1) {
            const auto l = static_cast<std::uint32_t>(std::countr_zero(candidates));
            const std::uint32_t k = ray[l / 4];
            const TriangleHit hit{t[l], u[l], v[l]};
            if ((sure >> l & 1) == 0)
                changed |= test_alone(block, l % 4, k);
            else if (hit.t >= p_.tmin[k] && hit.t <= p_.t[k])
                changed |= take(block, l % 4, k, hit);
        }
        return changed;
    }

    /// The whole test for one ray and one triangle.
    HWY_NOINLINE bool test_alone(const TriangleBlock& block, std::uint32_t lane, std::size_t k) {
        TriangleHit hit;
        return test_exactly<edge_rule(query)>(triangle_ray(k), block, lane, p_.t[k], hit) &&
               take(block, lane, k, hit);
    }
    HWY_INLINE void add(std::size_t k, const TreeHit& hit) {
        all_->push_back(found_by(static_cast<std::uint32_t>(index_[k]), hit));
    }
    /// A hit of ray k that is no farther than the best. Whether it counts.
    HWY_INLINE bool take(const TriangleBlock& block, std::uint32_t lane, std::size_t k,
                         const TriangleHit& hit) {
        if constexpr (wants_accepted(query))
            if (!(*check_)(rays_ + index_[k], {hit.t, block.prim[lane], hit.u, hit.v}))
                return false;
        found_ |= std::uint64_t{1} << k;
        if constexpr (query == Wanted::all)
            add(k, {hit.t, block.prim[lane], hit.u, hit.v});
        else if (!any && (hit.t < p_.t[k] || block.prim[lane] < p_.prim[k]))
            p_.t[k] = hit.t, p_.u[k] = hit.u, p_.v[k] = hit.v, p_.prim[k] = block.prim[lane];
        return true;
    }

    template <bool one_origin>
    HWY_INLINE Corner shear(const Target<one_origin>& target, std::uint32_t vertex,
                            std::size_t i) const {
        const auto at = [&](std::size_t k) {
            const V corner = hn::Set(f16, target.corner[vertex][k]);
            if constexpr (one_origin) return corner;
            return hn::Sub(corner, hn::Load(f16, p_.origin[p_.kind.axis(k)] + i));
        };
        const V z = at(2);
        return {hn::Sub(at(0), hn::Mul(hn::Load(f16, p_.shear_x + i), z)),
                hn::Sub(at(1), hn::Mul(hn::Load(f16, p_.shear_y + i), z)), z};
    }
    /// intersect_triangle for the rays i + (bits of `wanted`): the same bits. Whether any ray came
    /// nearer.
    template <bool one_origin>
    HWY_INLINE bool test_triangle(Target<one_origin>& target, std::size_t i, std::uint32_t wanted) {
        const Corner a = shear(target, 0, i), b = shear(target, 1, i), c = shear(target, 2, i);
        const V u = edge(c, b), v = edge(a, c), w = edge(b, a);
        std::uint32_t candidates = wanted & ~bits_of(f16, astride(f16, u, v, w));
        if (candidates == 0) return false;
        const std::uint32_t clear = bits_of(f16, without_zero(f16, u, v, w));
        bool changed = false;
        if constexpr (roughly) {
            const AnyHit hit = any_hit(f16,
                                       limits(hn::Load(f16, p_.tmin + i), hn::Load(f16, p_.t + i),
                                              hn::Load(f16, p_.direction[p_.kind.kz] + i)),
                                       a, b, c, u, v, w, candidates, clear);
            found_ |= std::uint64_t{hit.certain} << i;
            changed = hit.certain != 0;
            candidates = hit.open;
            if (candidates == 0) return changed;
        }
        return finish_rays(target, i, candidates, clear) || changed;
    }
    [[nodiscard]] HWY_INLINE Limits<F16> limits(V tmin, V tmax, V way) const {
        const std::uint32_t kz = p_.kind.kz;
        return {tmin, tmax, way, p_.pad[kz], p_.kind.negative(static_cast<int>(kz))};
    }

    [[nodiscard]] TriangleRay triangle_ray(std::size_t k) const {
        return triangle_ray_of(p_.kind, {p_.origin[0][k], p_.origin[1][k], p_.origin[2][k]},
                               {p_.direction[0][k], p_.direction[1][k], p_.direction[2][k]},
                               p_.shear_x[k], p_.shear_y[k], p_.tmin[k]);
    }

    /// What doubles say of half a vector of rays.
    struct Half {
        hn::Vec<H> t, u, v;
        std::uint32_t sure;  // the others must be tested alone
    };
    template <bool one_origin>
    HWY_INLINE Half weigh_half(const Target<one_origin>& target, std::size_t i) const {
        const D d;
        const auto doubles = [&](const float* from) {
            return hn::PromoteTo(D(), hn::Load(H(), from + i));
        };
        VD corner[3][3], direction[3], farthest;
        for (std::size_t k = 0; k < 3; ++k) direction[k] = doubles(p_.direction[p_.kind.axis(k)]);
        bool may_be_far = true;
        if constexpr (one_origin) {
            for (std::size_t v = 0; v < 3; ++v)
                for (std::size_t k = 0; k < 3; ++k) corner[v][k] = hn::Set(d, target.exact[v][k]);
            may_be_far = target.may_be_far;
            farthest = hn::Set(d, target.farthest);
        } else {
            for (std::size_t k = 0; k < 3; ++k) {
                const VD origin = doubles(p_.origin[p_.kind.axis(k)]);
                for (std::size_t v = 0; v < 3; ++v)
                    corner[v][k] = hn::Sub(weights::spread(d, target.corner[v][k]), origin);
            }
            farthest = weights::farthest(corner);
        }
        const auto at = weights::weigh(d, corner, direction);
        std::uint32_t sure = weights::inside(d, at);
        if (may_be_far)
            sure &= weights::without_far_corner(d, farthest, at.t, doubles(p_.tmin), direction[2]);
        return {weights::rounded(d, at.t), weights::rounded(d, at.u), weights::rounded(d, at.v),
                sure};
    }

    /// The second half of the test for the rays i + (bits of `candidates`) and one triangle. Both
    /// halves of the vector always: which of them has candidates cannot be foreseen.
    template <bool one_origin>
    HWY_INLINE bool finish_rays(Target<one_origin>& target, std::size_t i, std::uint32_t candidates,
                                std::uint32_t clear) {
        if constexpr (one_origin)
            if (!target.has_exact) target.add_exact(p_);
        const Half lower = weigh_half(target, i), upper = weigh_half(target, i + lanes_d);
        const V t = hn::Combine(f16, upper.t, lower.t), u = hn::Combine(f16, upper.u, lower.u),
                v = hn::Combine(f16, upper.v, lower.v), reach = hn::Load(f16, p_.t + i);
        const std::uint32_t sure = (lower.sure | upper.sure << lanes_d) & clear;
        std::uint32_t alone = candidates & ~sure;
        candidates &= sure & bits_of(f16, hn::Ge(t, hn::Load(f16, p_.tmin + i)));
        const std::uint32_t equal = candidates & bits_of(f16, hn::Eq(t, reach));
        candidates &= bits_of(f16, hn::Lt(t, reach));
        bool changed = false;
        if ((candidates | equal) != 0) {
            if constexpr (!wants_accepted(query)) {
                changed = true;
                found_ |= std::uint64_t{candidates | equal} << i;
            }
            if constexpr (query == Wanted::all || wants_accepted(query)) {
                HWY_ALIGN float values[3][lanes16];
                hn::Store(t, f16, values[0]);
                hn::Store(u, f16, values[1]);
                hn::Store(v, f16, values[2]);
                for (std::uint32_t left = candidates | equal; left != 0; left &= left - 1) {
                    const auto l = static_cast<std::size_t>(std::countr_zero(left));
                    changed |= take(target.block, target.lane, i + l,
                                    {values[0][l], values[1][l], values[2][l]});
                }
            } else if constexpr (!roughly) {
                const auto own = hn::Set(U16(), target.block.prim[target.lane]),
                           old = hn::Load(U16(), p_.prim + i);
                // At equal t the lower primitive wins.
                if (equal != 0)
                    candidates |= equal & bits_of(f16, hn::RebindMask(f16, hn::Lt(own, old)));
                const auto take = mask_of(f16, candidates);
                const auto store = [&](V value, float* to) {
                    hn::Store(hn::IfThenElse(take, value, hn::Load(f16, to)), f16, to);
                };
                store(t, p_.t + i);
                store(u, p_.u + i);
                store(v, p_.v + i);
                hn::Store(hn::IfThenElse(hn::RebindMask(U16(), take), own, old), U16(),
                          p_.prim + i);
            }
        }
        for (; alone != 0; alone &= alone - 1)
            changed |= test_alone(target.block, target.lane,
                                  i + static_cast<std::size_t>(std::countr_zero(alone)));
        return changed;
    }

    Packet& p_;
    const Ray* const rays_;
    const std::int32_t* const index_;
    BudgetVector<Hit>* const all_;
    const HitCheck* const check_;
    std::uint64_t found_ = 0;
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
