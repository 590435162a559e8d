// One ray through a wide tree: eight children at a time, eight triangles at a time. Included once
// per instruction set by simd_kernels.cpp.
#if defined(RAYDIX_SIMD_SINGLE_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_SINGLE_H
#undef RAYDIX_SIMD_SINGLE_H
#else
#define RAYDIX_SIMD_SINGLE_H
#endif

#include <hwy/highway.h>

#include "base/check.h"
#include "trace/all_hits.h"
#include "trace/simd/lanes.h"
#include "trace/simd/wide_ray.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

constexpr std::size_t parts8 = 8 / lanes8;

enum class Wanted { closest, any, all };

template <Wanted wanted, bool counting, bool compact>
class SingleRay {
public:
    SingleRay(const WideView& tree, const RayFrame& frame, const WideRay& ray,
              const WideStackView& stack, SimdCounts& counts)
        : tree_(tree), frame_(frame), ray_(ray), stack_(stack), counts_(counts) {
        origin_[0] = frame.origin.x, origin_[1] = frame.origin.y, origin_[2] = frame.origin.z;
        for (int axis = 0; axis < 3; ++axis) {
            const float pad = coordinate(ray.near_pad, axis),
                        start = coordinate(tree.middle, axis) - origin_[axis],
                        inverse = coordinate(ray.inverse, axis);
            limited_[axis] = inverse;
            near_start_[axis] = (start + pad) * inverse;
            far_start_[axis] = (start - pad) * inverse;
        }
        inverse_[0] = frame.inverse.x, inverse_[1] = frame.inverse.y, inverse_[2] = frame.inverse.z;
        for (std::size_t l = 0; l < 8; ++l)
            slot_[l] = static_cast<std::int32_t>(l ^ ray_.negative ^ 7u);
    }

    /// All hits, in no order, behind those in `hits`.
    void trace_all(std::vector<Hit>& hits) {
        all_ = &hits;
        trace(0, {frame_.tmax});
    }

    /// From a node or leaf on; `best` is what was found before.
    WideBest trace(std::uint32_t root, const WideBest& best) {
        best_ = best;
        stack_.words[0] = root;
        stack_.entries[0] = frame_.tmin;
        std::size_t top = 1;
        while (top > 0) {
            --top;
            if (!(stack_.entries[top] <= best_.t)) continue;
            const std::uint32_t word = stack_.words[top];
            if ((word & wide_leaf_bit) != 0) {
                if (test_leaf(word)) break;
            } else {
                top = visit(tree_.template node<compact>(word), top);
            }
        }
        return best_;
    }

private:
    using V = hn::Vec<F8>;

    /// How a ray's distances follow from the planes of a node: plane * rate + start.
    struct Rates {
        V rate[3], near[3], far[3];
    };
    HWY_INLINE Rates rates_of(const CompactNode& node) const {
        Rates out;
        for (int axis = 0; axis < 3; ++axis) {
            const std::uint32_t bits = std::uint32_t{node.exponent[axis]} << 23;
            float step;
            std::memcpy(&step, &bits, sizeof(step));
            const float from = node.origin[axis] - origin_[axis],
                        pad = coordinate(ray_.near_pad, axis), inverse = limited_[axis];
            out.rate[axis] = hn::Set(f8, step * inverse);
            out.near[axis] = hn::Set(f8, (from + pad) * inverse);
            out.far[axis] = hn::Set(f8, (from - pad) * inverse);
        }
        return out;
    }
    HWY_INLINE Rates rates_of(const WideNode&) const {
        Rates out;
        for (int axis = 0; axis < 3; ++axis) {
            out.rate[axis] = hn::Set(f8, limited_[axis]);
            out.near[axis] = hn::Set(f8, near_start_[axis]);
            out.far[axis] = hn::Set(f8, far_start_[axis]);
        }
        return out;
    }
    static HWY_INLINE V planes(const float* from) { return hn::Load(f8, from); }
    static HWY_INLINE V planes(const std::uint8_t* from) {
        return hn::ConvertTo(f8, hn::PromoteTo(I8(), hn::LoadU(B8(), from)));
    }

    /// Where the ray enters children l to l + lanes8 - 1, and where it leaves or need not look.
    template <class Node>
    HWY_INLINE void test_boxes(const Node& node, const Rates& rates, std::size_t l, V& entry,
                               V& exit) const {
        entry = hn::Set(f8, frame_.tmin);
        exit = hn::Set(f8, best_.t);
        for (int axis = 0; axis < 3; ++axis) {
            const bool negative = (ray_.negative >> axis & 1) != 0;
            const auto near = planes((negative ? node.hi[axis] : node.lo[axis]) + l),
                       far = planes((negative ? node.lo[axis] : node.hi[axis]) + l);
            entry = hn::Max(hn::MulAdd(near, rates.rate[axis], rates.near[axis]), entry);
            exit = hn::Min(hn::MulAdd(far, rates.rate[axis], rates.far[axis]), exit);
        }
    }

    /// Children that the ray meets go onto the stack, the nearest last.
    template <class Node>
    HWY_INLINE std::size_t visit(const Node& node, std::size_t top) {
        if constexpr (counting) ++counts_.visits;
        const Rates rates = rates_of(node);
        V entry, exit;
        if constexpr (parts8 == 1) {
            test_boxes(node, rates, 0, entry, exit);
            const auto slot = hn::IndicesFromVec(f8, hn::Load(I8(), slot_));
            const auto words =
                hn::TableLookupLanes(hn::BitCast(f8, hn::Load(U8(), node.child)), slot);
            const auto entry_in_order = hn::TableLookupLanes(entry, slot);
            const auto exit_in_order = hn::TableLookupLanes(exit, slot);
            // A missing child is a word of all ones: NaN, and nothing equals NaN.
            const auto met = hn::And(hn::Le(entry_in_order, exit_in_order), hn::Eq(words, words));
            hn::StoreU(hn::Compress(entry_in_order, met), f8, stack_.entries + top);
            hn::StoreU(hn::Compress(words, met), f8, reinterpret_cast<float*>(stack_.words + top));
            return top + hn::CountTrue(f8, met);
        } else {
            HWY_ALIGN float entries[8];
            std::uint32_t met = 0;
            for (std::size_t l = 0; l < 8; l += lanes8) {
                test_boxes(node, rates, l, entry, exit);
                hn::Store(entry, f8, entries + l);
                met |= bits_of(f8, hn::Le(entry, exit)) << l;
            }
            for (std::size_t k = 0; met != 0 && k < 8; ++k) {
                const auto s = static_cast<std::size_t>(slot_[k]);
                if ((met >> s & 1) == 0 || node.child[s] == wide_no_child) continue;
                stack_.words[top] = node.child[s];
                stack_.entries[top++] = entries[s];
            }
            return top;
        }
    }

    HWY_INLINE bool test_leaf(std::uint32_t word) {
        const std::uint32_t place = (word & ~wide_leaf_bit) >> 3, count = (word & 7) + 1;
        const TriangleBlock& block = tree_.template block<compact>(place, count);
        if constexpr (counting) counts_.tests += count;
        if constexpr (wanted == Wanted::all) {
            for (std::uint32_t lane = place % 8; lane < place % 8 + count; ++lane) {
                TriangleHit hit;
                if (intersect_triangle<EdgeRule::half_open>(frame_, triangle_of(block, lane),
                                                            best_.t, hit))
                    all_->push_back({hit.t * frame_.t_scale, block.prim[lane], hit.u, hit.v});
            }
            return false;
        }
        const std::uint32_t lanes = ((1u << count) - 1) << place % 8;
        for (std::size_t part = 0; part < parts8; ++part) {
            const std::uint32_t tested = lanes >> (part * lanes8) & ((1u << lanes8) - 1);
            if (tested != 0 && test_lanes(block, part * lanes8, tested)) return true;
        }
        return false;
    }

    struct Sheared {
        V x, y, z;  // z before shear_z
    };
    HWY_INLINE Sheared shear(const TriangleBlock& block, int vertex, std::size_t l) const {
        const auto at = [&](int axis) {
            return hn::Sub(hn::Load(f8, block.corner[3 * vertex + axis] + l),
                           hn::Set(f8, origin_[axis]));
        };
        const V z = at(frame_.kz);
        return {hn::Sub(at(frame_.kx), hn::Mul(hn::Set(f8, frame_.shear_x), z)),
                hn::Sub(at(frame_.ky), hn::Mul(hn::Set(f8, frame_.shear_y), z)), z};
    }
    static HWY_INLINE V edge(const Sheared& a, const Sheared& b) {
        return hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x));
    }

    /// intersect_triangle for the lanes l + (bits of `tested`): the same bits. True: stop.
    HWY_INLINE bool test_lanes(const TriangleBlock& block, std::size_t l, std::uint32_t tested) {
        const Sheared a = shear(block, 0, l), b = shear(block, 1, l), c = shear(block, 2, l);
        const V u = edge(c, b), v = edge(a, c), w = edge(b, a);
        const V zero = hn::Zero(f8);
        const V least = hn::Min(hn::Min(u, v), w), largest = hn::Max(hn::Max(u, v), w);
        const auto outside = hn::And(hn::Lt(least, zero), hn::Gt(largest, zero));
        std::uint32_t candidates = tested & ~bits_of(f8, outside);
        if (candidates == 0) return false;
        const auto on_edge = hn::Or(hn::Or(hn::Eq(u, zero), hn::Eq(v, zero)), hn::Eq(w, zero));
        const std::uint32_t near_edge = candidates & bits_of(f8, on_edge);
        if (near_edge != 0 && test_exactly(block, l, near_edge)) return true;
        candidates &= ~near_edge;
        if (candidates == 0) return false;
        return accept(block, l, candidates, a, b, c, u, v, w);
    }

    HWY_NOINLINE bool test_exactly(const TriangleBlock& block, std::size_t l, std::uint32_t lanes) {
        for (; lanes != 0; lanes &= lanes - 1) {
            const auto lane =
                static_cast<std::uint32_t>(l) + static_cast<std::uint32_t>(std::countr_zero(lanes));
            TriangleHit hit;
            if (!intersect_triangle<EdgeRule::closed>(frame_, triangle_of(block, lane), best_.t,
                                                      hit))
                continue;
            best_.take(hit.t, block.prim[lane], hit.u, hit.v);
            if constexpr (wanted == Wanted::any) return true;
        }
        return false;
    }

    HWY_INLINE bool accept(const TriangleBlock& block, std::size_t l, std::uint32_t candidates,
                           const Sheared& a, const Sheared& b, const Sheared& c, V u, V v, V w) {
        const V determinant = hn::Add(hn::Add(u, v), w);
        const V shear_z = hn::Set(f8, frame_.shear_z);
        const V depth =
            hn::Add(hn::Add(hn::Mul(u, hn::Mul(shear_z, a.z)), hn::Mul(v, hn::Mul(shear_z, b.z))),
                    hn::Mul(w, hn::Mul(shear_z, c.z)));
        V t = hn::Div(depth, determinant);
        V entry = hn::Set(f8, -infinity), exit = hn::Set(f8, infinity);
        for (int axis = 0; axis < 3; ++axis) {
            const V p = hn::Load(f8, block.corner[axis] + l),
                    q = hn::Load(f8, block.corner[3 + axis] + l),
                    r = hn::Load(f8, block.corner[6 + axis] + l);
            const V lo = hn::Min(hn::Min(p, q), r), hi = hn::Max(hn::Max(p, q), r);
            const bool negative = (ray_.negative >> axis & 1) != 0;
            const V origin = hn::Set(f8, origin_[axis]), inverse = hn::Set(f8, inverse_[axis]);
            const V near = hn::Mul(hn::Sub(negative ? hi : lo, origin), inverse);
            const V far = hn::Mul(hn::Sub(negative ? lo : hi, origin), inverse);
            // A NaN plane is dropped.
            entry = hn::IfThenElse(hn::Gt(near, entry), near, entry);
            exit = hn::IfThenElse(hn::Lt(far, exit), far, exit);
        }
        V held = hn::IfThenElse(hn::Gt(t, entry), t, entry);
        held = hn::IfThenElse(hn::Lt(held, exit), held, exit);
        t = hn::IfThenElse(hn::Le(entry, exit), held, t);
        const auto sound = hn::And(hn::Ne(determinant, hn::Zero(f8)),
                                   hn::Lt(hn::Abs(determinant), hn::Set(f8, infinity)));
        const auto in_reach =
            hn::And(hn::Ge(t, hn::Set(f8, frame_.tmin)), hn::Le(t, hn::Set(f8, best_.t)));
        candidates &= bits_of(f8, hn::And(sound, in_reach));
        if (candidates == 0) return false;
        if constexpr (wanted == Wanted::any) {
            best_.prim = 0;
            return true;
        }
        HWY_ALIGN float ts[lanes8], us[lanes8], vs[lanes8];
        hn::Store(t, f8, ts);
        hn::Store(hn::Div(v, determinant), f8, us);
        hn::Store(hn::Div(w, determinant), f8, vs);
        for (; candidates != 0; candidates &= candidates - 1) {
            const auto k = static_cast<std::size_t>(std::countr_zero(candidates));
            best_.take(ts[k], block.prim[l + k], us[k], vs[k]);
        }
        return false;
    }

    const WideView& tree_;
    const RayFrame& frame_;
    const WideRay ray_;
    const WideStackView stack_;
    SimdCounts& counts_;
    WideBest best_{};
    std::vector<Hit>* all_ = nullptr;
    float origin_[3], inverse_[3];
    float limited_[3], near_start_[3], far_start_[3];  // of boxes about the tree's middle
    HWY_ALIGN std::int32_t slot_[8];
};

template <bool any, bool counting, bool compact>
void trace_one(const SimdJob& job, std::size_t i, SimdCounts& counts) {
    Hit hit;
    if (!is_valid(job.rays[i])) {
        ++counts.invalid;
    } else {
        const RayFrame frame = make_frame(job.rays[i]);
        const WideRay ray = make_wide_ray(frame, job.tree.bounds);
        SingleRay<any ? Wanted::any : Wanted::closest, counting, compact> single(
            job.tree, frame, ray, job.stack, counts);
        const WideBest best = single.trace(0, {frame.tmax});
        if (best.found()) hit = {best.t * frame.t_scale, best.prim, best.u, best.v};
    }
    counts.hits += hit.hit();
    if constexpr (any)
        job.occluded[i] = hit.hit() ? 1 : 0;
    else
        job.hits[i] = hit;
}

template <bool any, bool counting, bool compact>
void trace_single(const SimdJob& job, SimdCounts& counts) {
    for (std::size_t k = 0; k < job.n; ++k)
        trace_one<any, counting, compact>(job, job.order == nullptr ? k : job.order[k], counts);
}

/// All hits of each ray behind those of the one before; counts.hits of each in hit_counts.
template <bool counting, bool compact>
void trace_all_of(const SimdJob& job, std::vector<Hit>& found, std::uint64_t* hit_counts,
                  SimdCounts& counts) {
    for (std::size_t i = 0; i < job.n; ++i) {
        const std::size_t before = found.size();
        if (!is_valid(job.rays[i])) {
            ++counts.invalid;
        } else {
            const RayFrame frame = make_frame(job.rays[i]);
            const WideRay ray = make_wide_ray(frame, job.tree.bounds);
            SingleRay<Wanted::all, counting, compact>(job.tree, frame, ray, job.stack, counts)
                .trace_all(found);
            finish_ray(found, before);
        }
        hit_counts[i] = found.size() - before;
        counts.hits += hit_counts[i];
    }
}

/// Calls run(counting, compact) with what the job wants, as constants. Code for compact trees
/// always counts: there is enough of it as it is.
template <class Run>
void with_constants(const SimdJob& job, const Run& run) {
    using Yes = std::true_type;
    using No = std::false_type;
    if (job.tree.is_compact)
        run(Yes(), Yes());
    else
        job.counting ? run(Yes(), No()) : run(No(), No());
}

inline void all_hits(const SimdJob& job, std::vector<Hit>& found, std::uint64_t* hit_counts,
                     SimdCounts& counts) {
    with_constants(job, [&](auto counting, auto compact) {
        trace_all_of<counting, compact>(job, found, hit_counts, counts);
    });
}

inline void single(const SimdJob& job, SimdCounts& counts) {
    with_constants(job, [&](auto counting, auto compact) {
        job.hits == nullptr ? trace_single<true, counting, compact>(job, counts)
                            : trace_single<false, counting, compact>(job, counts);
    });
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
