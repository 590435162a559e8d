// Leaves of triangles in double, for one ray: four triangles in a vector. The same bits as
// intersect_triangle, operation by operation; what needs more than that, or edges that are 0, goes
// to the function itself. Included once per instruction set.
#if defined(RAYDIX_ENGINE_TRIANGLE_LEAVES_DOUBLE_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_ENGINE_TRIANGLE_LEAVES_DOUBLE_H
#undef RAYDIX_ENGINE_TRIANGLE_LEAVES_DOUBLE_H
#else
#define RAYDIX_ENGINE_TRIANGLE_LEAVES_DOUBLE_H
#endif

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <limits>

#include "engine/triangle_lines_double.h"
#include "engine/wide_tree_double.h"
#include "trace/simd/block_hits.h"
#include "trace/simd/children.h"
#include "trace/simd/lanes_double.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Asks for the cache lines of a node or leaf that will be visited soon. Without branches: which of
/// both it is cannot be foreseen.
RAYDIX_PREFETCHING void ask_for(const WideTreeD& tree, std::uint32_t word) {
    constexpr std::size_t line = 64, node_lines = (sizeof(WideNode) + line - 1) / line,
                          block_lines = sizeof(TriangleBlockD) / line;
    static_assert(node_lines == 4 && block_lines == 5);
    const bool leaf = (word & wide_leaf_bit) != 0;
    const std::size_t block = ((word & ~wide_leaf_bit) >> 3) / block_lanes;
    const auto at_node = reinterpret_cast<std::uintptr_t>(tree.view.nodes) +
                         std::size_t{word} * sizeof(WideNode),
               at_block = reinterpret_cast<std::uintptr_t>(tree.blocks.data()) +
                          block * sizeof(TriangleBlockD);
    const auto* const place = reinterpret_cast<const char*>(by_kind_of(word, at_node, at_block));
    for (std::size_t k = 0; k < node_lines; ++k) hwy::Prefetch(place + k * line);
    hwy::Prefetch(place + (leaf ? node_lines * line : 0));
}

/// Where rays cross triangles, a pair a lane.
template <class D>
struct CrossingsD {
    hn::Vec<D> t, area;
    std::uint32_t hit;   // within [tmin, tmax]
    std::uint32_t open;  // intersect_triangle must be asked
};

/// Whether MulSub rounds once.
constexpr bool fuses = HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3;

/// accurate_product_difference of an edge, but for lanes where both products round to the same,
/// which `equal` has then.
template <class D>
HWY_INLINE hn::Vec<D> accurate_edge(const Sheared<D>& p, const Sheared<D>& q, hn::Mask<D>& equal) {
    const hn::Vec<D> left = hn::Mul(p.x, q.y), right = hn::Mul(p.y, q.x);
    equal = hn::Or(equal, hn::Eq(left, right));
    return hn::Add(hn::Sub(left, right),
                   hn::Sub(hn::MulSub(p.x, q.y, left), hn::MulSub(p.y, q.x, right)));
}

/// The second half of the test for lanes that pass inside. u, v and w: the edge functions, once
/// more and accurately where `EdgesD` has them so.
template <class D>
HWY_INLINE CrossingsD<D> find_crossings(D d, const Sheared<D>& a, const Sheared<D>& b,
                                        const Sheared<D>& c, hn::Vec<D> u, hn::Vec<D>& v,
                                        hn::Vec<D>& w, hn::Vec<D> per_depth, hn::Vec<D> tmin,
                                        hn::Vec<D> tmax, std::uint32_t candidates) {
    using V = hn::Vec<D>;
    const V za = hn::Mul(a.z, per_depth), zb = hn::Mul(b.z, per_depth),
            zc = hn::Mul(c.z, per_depth);
    V area = hn::Add(hn::Add(u, v), w);
    auto sure = without_zero(d, u, v, w);
    // EdgesD::may_stray
    const auto beside = [](const Sheared<D>& p) { return hn::Max(hn::Abs(p.x), hn::Abs(p.y)); };
    const V m = hn::Max(hn::Max(beside(a), beside(b)), beside(c));
    const V z = hn::Max(hn::Max(hn::Abs(za), hn::Abs(zb)), hn::Abs(zc));
    const V across = hn::Mul(m, hn::Abs(per_depth));
    const auto strays =
        hn::Gt(hn::Mul(hn::Mul(hn::Set(d, 3.0), hn::Mul(m, m)), across),
               hn::Mul(hn::Mul(hn::Set(d, 8.0), hn::Abs(area)), hn::Add(across, z)));
    if (!fuses) {
        sure = hn::AndNot(strays, sure);
    } else if ((bits_of(d, strays) & candidates) != 0) {
        auto equal = hn::Eq(u, hn::Zero(d));  // those are not sure anyway
        const V at_a = accurate_edge<D>(c, b, equal), at_b = accurate_edge<D>(a, c, equal),
                at_c = accurate_edge<D>(b, a, equal);
        const V sum = hn::Add(hn::Add(at_a, at_b), at_c);
        const auto unknown = hn::Or(equal, hn::Eq(sum, hn::Zero(d)));
        sure = hn::AndNot(hn::And(strays, unknown), sure);
        u = hn::IfThenElse(strays, at_a, u);
        v = hn::IfThenElse(strays, at_b, v);
        w = hn::IfThenElse(strays, at_c, w);
        area = hn::IfThenElse(strays, sum, area);
    }
    const V crossed =
        hn::Div(hn::Add(hn::Add(hn::Mul(u, za), hn::Mul(v, zb)), hn::Mul(w, zc)), area);
    const V most = hn::Set(d, std::numeric_limits<double>::max());
    sure = hn::And(sure, hn::And(hn::Le(hn::Abs(area), most), hn::Le(hn::Abs(crossed), most)));
    V t = hn::Max(crossed, hn::Min(hn::Min(za, zb), zc));
    t = hn::Min(t, hn::Max(hn::Max(za, zb), zc));
    const std::uint32_t within = bits_of(d, hn::And(hn::Ge(t, tmin), hn::Le(t, tmax)));
    // -0 becomes +0
    const std::uint32_t known = bits_of(d, sure);
    return {hn::Add(t, hn::Zero(d)), area, candidates & known & within, candidates & ~known};
}

/// The corners of four triangles as a ray sees them.
HWY_INLINE Sheared<D4> shear_four(const TriangleBlockD& block, std::size_t l, int vertex,
                                  const RayClass& kind, const TriangleLineD& line) {
    const auto at = [&](std::uint32_t axis) {
        return hn::Sub(hn::Load(d4, block.corner[3 * vertex + static_cast<int>(axis)] + l),
                       hn::Set(d4, line.origin[axis]));
    };
    const hn::Vec<D4> z = at(kind.kz);
    return {hn::Sub(at(kind.kx), hn::Mul(hn::Set(d4, line.shear[0]), z)),
            hn::Sub(at(kind.ky), hn::Mul(hn::Set(d4, line.shear[1]), z)), z};
}
/// Where a ray crosses lanes l on of a block, those in `tested`; v and w: their edge functions.
HWY_INLINE CrossingsD<D4> cross_four(const TriangleBlockD& block, std::size_t l,
                                     std::uint32_t tested, const RayClass& kind,
                                     const TriangleLineD& line, double reach, hn::Vec<D4>& v,
                                     hn::Vec<D4>& w) {
    const Sheared<D4> a = shear_four(block, l, 0, kind, line),
                      b = shear_four(block, l, 1, kind, line),
                      c = shear_four(block, l, 2, kind, line);
    const hn::Vec<D4> u = edge(c, b);
    v = edge(a, c), w = edge(b, a);
    const std::uint32_t candidates = tested & ~bits_of(d4, astride(d4, u, v, w));
    if (candidates == 0) return {u, u, 0, 0};
    return find_crossings(d4, a, b, c, u, v, w, hn::Set(d4, line.per_depth), hn::Set(d4, line.tmin),
                          hn::Set(d4, reach), candidates);
}

/// One ray's line at the leaves of a tree (Parts of single.h). Take: called with t in units of the
/// line, prim, u and v; for all hits with each, for accepted ones to say whether it is.
template <Wanted wanted, class Take = std::nullptr_t>
class TriangleLeavesD {
public:
    static constexpr bool nearest_first = false, large = true;

    /// All must outlive it.
    TriangleLeavesD(const WideTreeD& tree, const TriangleLineD& line, const RayClass& kind,
                    const BoxDistances& distances, BestD& best, Take take = {})
        : tree_(tree), line_(line), kind_(kind), distances_(distances), best_(best), take_(take) {}

    RAYDIX_PREFETCHING void ask_for(std::uint32_t word) const {
        HWY_NAMESPACE::ask_for(tree_, word);
    }

    /// How far the ray goes then, as boxes have it; -1: any hit will do, and there is one.
    HWY_INLINE float visit_one(std::uint32_t place, std::uint32_t count, std::uint32_t) {
        const TriangleBlockD& block = tree_.blocks[place / block_lanes];
        const std::uint32_t lanes = ((1u << count) - 1) << place % block_lanes;
        for (std::size_t l = 0; l < block_lanes; l += lanes_d4) {
            const std::uint32_t tested = lanes >> l & ((1u << lanes_d4) - 1);
            if (lanes_d4 < block_lanes && tested == 0) continue;
            if (test(block, l, tested)) return -1.0f;
        }
        return distances_.above(best_.t);
    }

private:
    using V = hn::Vec<D4>;

    /// Lanes l on. True: any hit will do, and there is one.
    HWY_INLINE bool test(const TriangleBlockD& block, std::size_t l, std::uint32_t tested) {
        V v, w;
        const CrossingsD<D4> at = cross_four(block, l, tested, kind_, line_, best_.t, v, w);
        if (at.hit != 0) {
            if constexpr (wanted == Wanted::any) return true;
            alignas(32) double t[4], over_v[4], over_w[4], area[4];
            hn::Store(at.t, d4, t);
            hn::Store(v, d4, over_v);
            hn::Store(w, d4, over_w);
            hn::Store(at.area, d4, area);
            for (std::uint32_t left = at.hit; left != 0; left &= left - 1) {
                const auto k = static_cast<std::size_t>(std::countr_zero(left));
                if (add(block.prim[l + k], t[k], over_v[k], over_w[k], area[k])) return true;
            }
        }
        return at.open != 0 && test_closely(block, l, at.open);
    }
    HWY_NOINLINE bool test_closely(const TriangleBlockD& block, std::size_t l,
                                   std::uint32_t lanes) {
        for (; lanes != 0; lanes &= lanes - 1) {
            const auto lane =
                static_cast<std::uint32_t>(l) + static_cast<std::uint32_t>(std::countr_zero(lanes));
            BasicTriangleHit<double> hit;
            if (!intersect_triangle<edge_rule(wanted)>(line_.ray(kind_), block.triangle(lane),
                                                       best_.t, hit))
                continue;
            if constexpr (wanted == Wanted::any) return true;
            if (add(block.prim[lane], hit.t, hit.u, hit.v, 1.0)) return true;
        }
        return false;
    }
    /// True: any hit will do, and this one does.
    HWY_INLINE bool add(std::uint32_t prim, double t, double u, double v, double area) {
        if constexpr (wanted == Wanted::all) {
            take_(t, prim, u / area, v / area);
            return false;
        } else {
            if (!best_.is_behind(t, prim)) return false;
            if constexpr (wants_accepted(wanted))
                if (!take_(t, prim, u / area, v / area)) return false;
            best_ = {t, prim, u, v, area};
            return wants_any(wanted);
        }
    }

    const WideTreeD& tree_;
    const TriangleLineD& line_;
    const RayClass& kind_;
    const BoxDistances& distances_;
    BestD& best_;
    Take take_;
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
