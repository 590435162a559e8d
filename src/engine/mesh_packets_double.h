// Rays in double through one mesh in packets: the nodes take float rays about the tree's center,
// as packet.h has them, the leaves vectors of rays in double with one triangle, or where few are
// left, each of them with four. Included once per instruction set.
#if defined(RAYDIX_ENGINE_MESH_PACKETS_DOUBLE_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_ENGINE_MESH_PACKETS_DOUBLE_H
#undef RAYDIX_ENGINE_MESH_PACKETS_DOUBLE_H
#else
#define RAYDIX_ENGINE_MESH_PACKETS_DOUBLE_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <limits>
#include <vector>

#include "base/plain_scale.h"
#include "engine/scene_job_double.h"
#include "engine/triangle_leaves_double.h"
#include "trace/simd/packets.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// How rays in double that packets take widen boxes once more (docs/algorithms/double.md).
constexpr PadGrowth growth_of_doubles{0x1p-23f, 0.0f};
/// Packets take rays that start within so many sizes of the bounds.
constexpr double farthest_of_packet = 0x1p6;

/// The rays of a packet as triangles see them, by their places in it. Those from `count` on repeat
/// the last one up to the end of a vector.
struct PacketLinesD {
    HWY_ALIGN double origin[3][packet_size];
    HWY_ALIGN double shear[2][packet_size];
    HWY_ALIGN double way[packet_size], per_depth[packet_size];
    HWY_ALIGN double tmin[packet_size], start[packet_size];  // start: BoxDistances::start
    HWY_ALIGN double t[packet_size], u[packet_size], v[packet_size], area[packet_size];
    std::uint32_t prim[packet_size];
    RayClass kind;
    bool one_origin;

    [[nodiscard]] HWY_INLINE TriangleLineD line(std::size_t k) const {
        TriangleLineD out;
        for (int a = 0; a < 3; ++a) out.origin[a] = origin[a][k];
        out.shear[0] = shear[0][k], out.shear[1] = shear[1][k];
        out.way = way[k], out.per_depth = per_depth[k], out.tmin = tmin[k];
        return out;
    }
};

/// The triangles of leaves against the rays of a packet (LeavesOfPacket).
template <Wanted query>
class PacketTrianglesD {
    static constexpr bool any = query == Wanted::any;
    static_assert(any || query == Wanted::closest);

public:
    /// What PacketWalk gives leaves.
    struct Source {
        using OfPacket = PacketTrianglesD;
        const WideTreeD& tree;
        PacketLinesD& lines;
    };

    PacketTrianglesD(Packet& packet, const std::int32_t*, Source& source)
        : p_(packet), r_(source.lines), tree_(source.tree) {}

    [[nodiscard]] std::uint64_t found() const { return found_; }
    RAYDIX_PREFETCHING void ask_for(std::uint32_t word) const {
        HWY_NAMESPACE::ask_for(tree_, word);
    }

    void visit(std::uint32_t place, std::uint32_t count, std::uint64_t active) {
        const TriangleBlockD& block = tree_.blocks[place / block_lanes];
        const std::uint32_t first = place % block_lanes;
        std::uint32_t vectors = 0;
        for (std::size_t i = 0; i < packet_size; i += lanes_d8)
            vectors += (active >> i & vector_bits) != 0;
        const auto rays = static_cast<std::uint32_t>(std::popcount(active));
        if (4 * rays <= 3 * vectors * count)
            visit_by_ray(block, ((1u << count) - 1) << first, active);
        else if (r_.one_origin)
            visit_by_vector<true>(block, first, count, active);
        else
            visit_by_vector<false>(block, first, count, active);
    }

private:
    using V = hn::Vec<D8>;
    static constexpr std::uint64_t vector_bits = (std::uint64_t{1} << lanes_d8) - 1;

    HWY_INLINE void visit_by_ray(const TriangleBlockD& block, std::uint32_t lanes,
                                 std::uint64_t active) {
        for (; active != 0; active &= active - 1) {
            const auto k = static_cast<std::size_t>(std::countr_zero(active));
            for (std::size_t l = 0; l < block_lanes; l += lanes_d4) {
                const std::uint32_t tested = lanes >> l & ((1u << lanes_d4) - 1);
                if (lanes_d4 < block_lanes && tested == 0) continue;
                if (test_four(block, l, tested, k)) break;
            }
        }
    }
    /// Whether any hit will do, and there is one.
    HWY_INLINE bool test_four(const TriangleBlockD& block, std::size_t l, std::uint32_t tested,
                              std::size_t k) {
        hn::Vec<D4> v, w;
        const CrossingsD<D4> at = cross_four(block, l, tested, r_.kind, r_.line(k), r_.t[k], v, w);
        if ((at.hit | at.open) == 0) return false;
        if (at.hit != 0) {
            if constexpr (any) return find(k);
            alignas(32) double t[4], over_v[4], over_w[4], area[4];
            hn::Store(at.t, d4, t);
            hn::Store(v, d4, over_v);
            hn::Store(w, d4, over_w);
            hn::Store(at.area, d4, area);
            for (std::uint32_t left = at.hit; left != 0; left &= left - 1) {
                const auto n = static_cast<std::size_t>(std::countr_zero(left));
                take(k, {t[n], block.prim[l + n], over_v[n], over_w[n], area[n]});
            }
        }
        for (std::uint32_t left = at.open; left != 0; left &= left - 1)
            if (test_closely(block,
                             static_cast<std::uint32_t>(l) +
                                 static_cast<std::uint32_t>(std::countr_zero(left)),
                             k) &&
                any)
                return true;
        return false;
    }
    HWY_INLINE bool find(std::size_t k) {
        found_ |= std::uint64_t{1} << k;
        return true;
    }
    HWY_INLINE void take(std::size_t k, const BestD& hit) {
        if (!(hit.t < r_.t[k] || (hit.t == r_.t[k] && hit.prim < r_.prim[k]))) return;
        r_.t[k] = hit.t, r_.u[k] = hit.u, r_.v[k] = hit.v, r_.area[k] = hit.area;
        r_.prim[k] = hit.prim;
        p_.t[k] = BoxDistances{1.0, r_.start[k]}.above(hit.t);
    }
    /// Whether it hits.
    HWY_NOINLINE bool test_closely(const TriangleBlockD& block, std::uint32_t lane, std::size_t k) {
        BasicTriangleHit<double> hit;
        if (!intersect_triangle<EdgeRule::closed>(r_.line(k).ray(r_.kind), block.triangle(lane),
                                                  r_.t[k], hit))
            return false;
        if constexpr (any)
            find(k);
        else
            take(k, {hit.t, block.prim[lane], hit.u, hit.v, 1.0});
        return true;
    }

    template <bool one_origin>
    HWY_INLINE void visit_by_vector(const TriangleBlockD& block, std::uint32_t first,
                                    std::uint32_t count, std::uint64_t active) {
        // By triangle and corner, axes in the order kx, ky, kz; from where the rays start if they
        // all start there.
        alignas(32) double corner[9][block_lanes];
        for (int v = 0; v < 3; ++v)
            for (std::uint32_t a = 0; a < 3; ++a) {
                const std::uint32_t axis = r_.kind.axis(a);
                for (std::size_t l = 0; l < block_lanes; l += lanes_d4) {
                    auto at = hn::Load(d4, block.corner[3 * v + static_cast<int>(axis)] + l);
                    if constexpr (one_origin) at = hn::Sub(at, hn::Set(d4, r_.origin[axis][0]));
                    hn::Store(at, d4, corner[3 * v + static_cast<int>(a)] + l);
                }
            }
        for (std::size_t i = 0; i < packet_size; i += lanes_d8) {
            auto wanted = static_cast<std::uint32_t>(active >> i & vector_bits);
            for (std::uint32_t lane = first; lane < first + count && wanted != 0; ++lane) {
                test_vector<one_origin>(block, corner, lane, i, wanted);
                if constexpr (any) wanted &= ~static_cast<std::uint32_t>(found_ >> i & vector_bits);
            }
        }
    }

    template <bool one_origin>
    HWY_INLINE void test_vector(const TriangleBlockD& block, const double (&corner)[9][block_lanes],
                                std::uint32_t lane, std::size_t i, std::uint32_t wanted) {
        const V shear_x = hn::Load(d8, r_.shear[0] + i), shear_y = hn::Load(d8, r_.shear[1] + i);
        const auto shear = [&](int v) -> Sheared<D8> {
            const auto at = [&](std::uint32_t a) {
                const V seen = hn::Set(d8, corner[3 * v + static_cast<int>(a)][lane]);
                if constexpr (one_origin)
                    return seen;
                else
                    return hn::Sub(seen, hn::Load(d8, r_.origin[r_.kind.axis(a)] + i));
            };
            const V z = at(2);
            return {hn::Sub(at(0), hn::Mul(shear_x, z)), hn::Sub(at(1), hn::Mul(shear_y, z)), z};
        };
        const Sheared<D8> a = shear(0), b = shear(1), c = shear(2);
        const V u = edge(c, b);
        V v = edge(a, c), w = edge(b, a);
        const std::uint32_t candidates = wanted & ~bits_of(d8, astride(d8, u, v, w));
        if (candidates == 0) return;
        const CrossingsD<D8> at =
            find_crossings(d8, a, b, c, u, v, w, hn::Load(d8, r_.per_depth + i),
                           hn::Load(d8, r_.tmin + i), hn::Load(d8, r_.t + i), candidates);
        if constexpr (any)
            found_ |= std::uint64_t{at.hit} << i;
        else if (at.hit != 0)
            take_vector(at, v, w, block.prim[lane], i);
        for (std::uint32_t left = at.open; left != 0; left &= left - 1)
            test_closely(block, lane, i + static_cast<std::size_t>(std::countr_zero(left)));
    }
    HWY_INLINE void take_vector(const CrossingsD<D8>& at, V v, V w, std::uint32_t prim,
                                std::size_t i) {
        HWY_ALIGN double t[lanes_d8], over_v[lanes_d8], over_w[lanes_d8], area[lanes_d8];
        hn::Store(at.t, d8, t);
        hn::Store(v, d8, over_v);
        hn::Store(w, d8, over_w);
        hn::Store(at.area, d8, area);
        for (std::uint32_t left = at.hit; left != 0; left &= left - 1) {
            const auto n = static_cast<std::size_t>(std::countr_zero(left));
            take(i + n, {t[n], prim, over_v[n], over_w[n], area[n]});
        }
    }

    Packet& p_;
    PacketLinesD& r_;
    const WideTreeD& tree_;
    std::uint64_t found_ = 0;
};

/// Components `first` on of rays, four of them, a vector each: origin and tmin, or from 4 on
/// direction and tmax.
HWY_INLINE void read_four(const RayD* rays, const std::int64_t* index, std::size_t first,
                          hn::Vec<D4> (&out)[4]) {
    const auto load = [&](std::size_t ray, std::size_t component) {
        return hn::LoadU(d4, &rays[index[ray]].origin.x + first + component);
    };
    if constexpr (lanes_d4 == 4) {
        const auto r0 = load(0, 0), r1 = load(1, 0), r2 = load(2, 0), r3 = load(3, 0);
        const auto low01 = hn::InterleaveLower(d4, r0, r1), low23 = hn::InterleaveLower(d4, r2, r3),
                   high01 = hn::InterleaveUpper(d4, r0, r1),
                   high23 = hn::InterleaveUpper(d4, r2, r3);
        out[0] = hn::ConcatLowerLower(d4, low23, low01);
        out[1] = hn::ConcatLowerLower(d4, high23, high01);
        out[2] = hn::ConcatUpperUpper(d4, low23, low01);
        out[3] = hn::ConcatUpperUpper(d4, high23, high01);
    } else {
        for (std::size_t half = 0; half < 4; half += 2) {
            const auto a = load(0, half), b = load(1, half);
            out[half] = hn::InterleaveLower(d4, a, b);
            out[half + 1] = hn::InterleaveUpper(d4, a, b);
        }
    }
}

/// The rays of a job through its only mesh, which all of them can see, in packets.
template <bool any>
class MeshPacketsD {
    static constexpr Wanted wanted = any ? Wanted::any : Wanted::closest;
    using Leaves = PacketTrianglesD<wanted>;
    using Source = typename Leaves::Source;

public:
    explicit MeshPacketsD(SceneJobD& job)
        : job_(job), mesh_(*job.tree->only_mesh()), tree_(*mesh_.tree) {}

    /// Calls alone(k) for rays that packets do not take.
    template <class Alone>
    void trace(const Alone& alone) {
        job_.stack.reserve_words(wide_stack_capacity(tree_.arrays.stats.max_depth));
        HWY_ALIGN std::int64_t index[packet_size];
        std::size_t k = 0;
        for (; k < job_.n; k += packet_size) {
            const std::size_t count = std::min(job_.n - k, packet_size);
            for (std::size_t n = 0; n < packet_size; ++n)
                index[n] = static_cast<std::int64_t>(job_.place(k + std::min(n, count - 1)));
            const std::uint32_t code = code_of(job_.rays[index[0]]);
            if (code == odd_ray_class || !fill(index, count, code)) break;
            walk(index, count);
        }
        if (k < job_.n) trace_sorted(k, alone);
    }

private:
    using V = hn::Vec<D4>;
    using I = hn::RebindToSigned<D4>;
    using FH = hn::Rebind<float, D4>;

    /// The class of a ray; odd_ray_class if packets do not take it.
    [[nodiscard]] std::uint32_t code_of(const RayD& ray) const {
        const Vec3d d = ray.direction;
        const double ax = std::fabs(d.x), ay = std::fabs(d.y), az = std::fabs(d.z);
        const double longest = max_of(max_of(ax, ay), az);
        if (!is_valid(ray) || !is_plainly_scaled(longest)) return odd_ray_class;
        const Vec3d o = tree_.space.local(ray.origin);
        const auto far = [&](double at, int a) {
            return max_of(std::fabs(tree_.lo[a] - at), std::fabs(tree_.hi[a] - at));
        };
        if (!(far(o.x, 0) + far(o.y, 1) + far(o.z, 2) <= farthest_of_packet * tree_.size))
            return odd_ray_class;
        const std::uint32_t kz = az == longest ? 2 : ay == longest ? 1 : 0;
        return (std::signbit(d.x) ? 1u : 0u) + (std::signbit(d.y) ? 2u : 0u) +
               (std::signbit(d.z) ? 4u : 0u) + 8 * kz;
    }

    /// From the first window on that is not of one class: rays by class.
    template <class Alone>
    HWY_NOINLINE void trace_sorted(std::size_t from, const Alone& alone) {
        std::vector<std::uint8_t> codes(job_.n - from);
        std::uint32_t next[ray_class_count + 1] = {};
        for (std::size_t k = from; k < job_.n; ++k) {
            codes[k - from] = static_cast<std::uint8_t>(code_of(job_.rays[job_.place(k)]));
            ++next[codes[k - from] + 1];
        }
        for (std::uint32_t c = 0; c < ray_class_count; ++c) next[c + 1] += next[c];
        std::uint32_t begin[ray_class_count + 1];
        std::copy_n(next, ray_class_count + 1, begin);
        std::vector<std::uint32_t> sorted(codes.size());
        for (std::size_t k = from; k < job_.n; ++k)
            sorted[next[codes[k - from]]++] = static_cast<std::uint32_t>(k);
        HWY_ALIGN std::int64_t index[packet_size];
        for (std::uint32_t code = 0; code < odd_ray_class; ++code)
            for (std::uint32_t at = begin[code]; at < begin[code + 1]; at += packet_size) {
                const std::size_t count = std::min<std::size_t>(begin[code + 1] - at, packet_size);
                for (std::size_t n = 0; n < packet_size; ++n)
                    index[n] =
                        static_cast<std::int64_t>(job_.place(sorted[at + std::min(n, count - 1)]));
                if (fill(index, count, code))
                    walk(index, count);
                else
                    for (std::size_t n = 0; n < count; ++n) alone(sorted[at + n]);
            }
        for (std::uint32_t at = begin[odd_ray_class]; at < begin[ray_class_count]; ++at)
            alone(sorted[at]);
    }

    /// False if the rays are not all of that class.
    HWY_NOINLINE bool fill(const std::int64_t* index, std::size_t count, std::uint32_t code) {
        const RayClass kind = ray_class_of(code);
        const auto kz = kind.kz;
        const V scale = hn::Set(d4, tree_.space.scale), size = hn::Set(d4, tree_.size),
                zero = hn::Zero(d4), most = hn::Set(d4, std::numeric_limits<double>::max());
        auto same = hn::Eq(zero, zero);
        V first[3];
        auto one = same;
        // Floats are read in vectors of their own, up to the end of the last one.
        const std::size_t filled = (count + lanes16 - 1) / lanes16 * lanes16;
        for (std::size_t i = 0; i < filled; i += lanes_d4) {
            V place[4], way[4], local[3], size_of[3], far = zero;
            read_four(job_.rays, index + i, 0, place);
            read_four(job_.rays, index + i, 4, way);
            for (int a = 0; a < 3; ++a) {
                const V origin = hn::Add(place[a], zero);  // -0 becomes +0
                hn::Store(origin, d4, lines_.origin[a] + i);
                if (i == 0) first[a] = hn::Set(d4, lines_.origin[a][0]);
                one = hn::And(one, hn::Eq(origin, first[a]));
                local[a] = hn::Mul(scale, hn::Sub(origin, hn::Set(d4, tree_.center[a])));
                far = hn::Add(far, hn::Max(hn::Abs(hn::Sub(hn::Set(d4, tree_.lo[a]), local[a])),
                                           hn::Abs(hn::Sub(hn::Set(d4, tree_.hi[a]), local[a]))));
                size_of[a] = hn::Abs(way[a]);
                const auto negative = hn::Lt(hn::BitCast(I(), way[a]), hn::Zero(I()));
                same = hn::And(same,
                               hn::RebindMask(d4, kind.negative(a) ? negative : hn::Not(negative)));
            }
            const V longest = size_of[kz];
            for (std::uint32_t a = 0; a < 3; ++a) {
                if (a == kz) continue;
                same = hn::And(same,
                               a < kz ? hn::Le(size_of[a], longest) : hn::Lt(size_of[a], longest));
            }
            const V tmin = place[3], tmax = way[3];
            same = hn::And(same, hn::And(hn::Ge(longest, hn::Set(d4, plainly_scaled_from)),
                                         hn::Le(longest, hn::Set(d4, plainly_scaled_to))));
            same = hn::And(same, hn::And(hn::Le(tmin, tmax), hn::Ge(tmax, zero)));
            // As make_frame scales them: directions by a power of two, distances by its inverse.
            const auto near_unit =
                hn::And(hn::Gt(longest, hn::Set(d4, 0x1p-3)), hn::Lt(longest, hn::Set(d4, 0x1p3)));
            const auto power =
                hn::And(hn::BitCast(I(), longest), hn::Set(I(), std::int64_t{0x7FF} << 52));
            const V one_each = hn::Set(d4, 1.0),
                    length = hn::IfThenElse(near_unit, one_each, hn::BitCast(d4, power)),
                    scaled_by = hn::IfThenElse(
                        near_unit, one_each,
                        hn::BitCast(d4, hn::Sub(hn::Set(I(), std::int64_t{2046} << 52), power)));
            hn::Store(scaled_by, d4, scale_ + i);
            for (int a = 0; a < 3; ++a) way[a] = hn::Mul(way[a], scaled_by);
            same = hn::And(same, hn::Le(far, hn::Mul(hn::Set(d4, farthest_of_packet), size)));
            const V dz = way[kz];
            hn::Store(dz, d4, lines_.way + i);
            hn::Store(hn::Div(hn::Set(d4, 1.0), dz), d4, lines_.per_depth + i);
            hn::Store(hn::Div(way[kind.kx], dz), d4, lines_.shear[0] + i);
            hn::Store(hn::Div(way[kind.ky], dz), d4, lines_.shear[1] + i);
            const V least = hn::Set(d4, std::numeric_limits<double>::denorm_min());
            const V begin = hn::IfThenElseZero(hn::Gt(tmin, zero),
                                               hn::Max(hn::Mul(tmin, length), least)),
                    end = hn::Min(hn::Mul(hn::Min(tmax, most), length), most);
            hn::Store(begin, d4, lines_.tmin + i);
            hn::Store(end, d4, lines_.t + i);
            // As find_place.
            const V in_boxes = hn::Mul(scale, dz);
            const V ahead = kind.negative(static_cast<int>(kz))
                                ? hn::Sub(local[kz], hn::Set(d4, tree_.hi[kz]))
                                : hn::Sub(hn::Set(d4, tree_.lo[kz]), local[kz]);
            const auto from_afar = hn::Gt(ahead, hn::Add(size, size));
            V start = zero;
            if (!hn::AllFalse(d4, from_afar))
                start =
                    hn::IfThenElseZero(from_afar, hn::Div(hn::Sub(ahead, size), hn::Abs(in_boxes)));
            hn::Store(start, d4, lines_.start + i);
            const FH h;
            for (int a = 0; a < 3; ++a) {
                const V d = hn::Mul(scale, way[a]);
                hn::Store(hn::DemoteTo(h, d), h, direction_[a] + i);
                hn::Store(hn::DemoteTo(h, hn::Add(local[a], hn::Mul(start, d))), h, origin_[a] + i);
            }
            const V limit = hn::Set(d4, BoxDistances::most);
            const auto moved = [&](V t, double by, double more) {
                return hn::Min(
                    hn::Add(hn::Mul(hn::Sub(t, start), hn::Set(d4, by)), hn::Set(d4, more)), limit);
            };
            hn::Store(hn::DemoteTo(h, moved(begin, 1.0 - 0x1p-22, -0x1p-140)), h, tmin_ + i);
            hn::Store(hn::DemoteTo(h, moved(end, 1.0 + 0x1p-22, 0x1p-140)), h, tmax_ + i);
        }
        if (!hn::AllTrue(d4, same)) return false;
        lines_.one_origin = hn::AllTrue(d4, one);
        lines_.kind = kind;
        std::fill_n(lines_.prim, packet_size, no_primitive);
        PacketRays rays;
        for (std::size_t i = 0; i < count; i += lanes16) {
            RayVectors& out = rays[i / lanes16];
            for (int a = 0; a < 3; ++a) {
                out.place[a] = hn::Load(f16, origin_[a] + i);
                out.way[a] = hn::Load(f16, direction_[a] + i);
            }
            out.place[3] = hn::Load(f16, tmin_ + i);
            out.way[3] = hn::Load(f16, tmax_ + i);
        }
        fill_packet(tree_.view, rays, static_cast<std::uint32_t>(count), code, packet_,
                    growth_of_doubles);
        return true;
    }

    void walk(const std::int64_t* index, std::size_t count) {
        Source source{tree_, lines_};
        SimdCounts counts;
        PacketWalk<wanted, false, false, Source> walk(tree_.view, packet_, nullptr, source,
                                                      job_.stack.packet_view(), counts);
        walk.trace();
        const std::uint64_t found = walk.found();
        for (std::size_t k = 0; k < count; ++k) {
            HitD hit;
            if constexpr (any) {
                if ((found >> k & 1) != 0) hit.prim = 0;
            } else if (lines_.prim[k] != no_primitive) {
                const double area = lines_.area[k];
                hit = HitD{TreeHitD{lines_.t[k] * scale_[k], lines_.prim[k], lines_.u[k] / area,
                                    lines_.v[k] / area},
                           no_primitive, 0};
                mesh_.name(hit);
            }
            job_.set(static_cast<std::size_t>(index[k]), hit);
        }
    }

    SceneJobD& job_;
    const MeshTreeD& mesh_;
    const WideTreeD& tree_;
    PacketLinesD lines_;
    Packet packet_;
    HWY_ALIGN double scale_[packet_size];  // t of the caller's ray is this times t here
    // The float rays of boxes.
    HWY_ALIGN float origin_[3][packet_size], direction_[3][packet_size];
    HWY_ALIGN float tmin_[packet_size], tmax_[packet_size];
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
