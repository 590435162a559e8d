// One ray alone: calls of one ray, and rays of a batch one after the other. Included once per
// instruction set.
#if defined(RAYDIX_SIMD_SINGLE_CALLS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_SINGLE_CALLS_H
#undef RAYDIX_SIMD_SINGLE_CALLS_H
#else
#define RAYDIX_SIMD_SINGLE_CALLS_H
#endif

#include <hwy/highway.h>

#include <type_traits>

#include "trace/simd/call_history.h"
#include "trace/simd/simd_kernels.h"
#include "trace/simd/single.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Whether the ray is probably like the next one: so many of the last have been like each other.
HWY_INLINE bool follows(const WideView& tree, const SingleFrame& frame, CallHistory& history) {
    const V4 origin = hn::Load(f4, frame.origin);
    const V4 moved = hn::Abs(hn::Sub(origin, hn::Load(f4, history.origin)));
    const V4 size = hn::Sub(hn::Load(f4, tree.hi), hn::Load(f4, tree.lo));
    const V4 most = hn::Mul(size, hn::Set(f4, CallHistory::near));
    const std::uint32_t ray_class = frame.kind.negatives + 8 * frame.kind.kz;
    history.add(ray_class == history.ray_class && (bits_of(f4, hn::Le(moved, most)) & 7) == 7);
    history.ray_class = ray_class;
    hn::Store(origin, f4, history.origin);
    return history.is_coherent();
}

template <bool any, bool counting, bool compact, bool guessing>
HWY_INLINE WideBest search(const WideView& tree, const SingleFrame& frame,
                           const WideStackView& stack, SimdCounts& counts) {
    return SingleRay < any ? Wanted::any : Wanted::closest, counting, compact,
           guessing > (tree, frame, stack, counts).trace(0, {frame.tmax});
}

/// A miss if the ray is invalid; for any hit only `prim` has a meaning.
template <bool any, bool counting, bool compact>
HWY_INLINE TreeHit find_one(const WideView& tree, const Ray& ray, const WideStackView& stack,
                            SimdCounts& counts, CallHistory* history = nullptr) {
    SingleFrame frame;
    if (!fill_frame(tree, ray, frame)) {
        ++counts.invalid;
        return {};
    }
    const WideBest best = history != nullptr && follows(tree, frame, *history)
                              ? search<any, counting, compact, true>(tree, frame, stack, counts)
                              : search<any, counting, compact, false>(tree, frame, stack, counts);
    if (!best.found()) return {};
    ++counts.hits;
    return {best.t * frame.t_scale, best.prim, best.u, best.v};
}

/// Ray i of a job; all of its hits go behind job.all, for group_by_ray.
template <Wanted wanted, bool counting, bool compact>
void trace_one(const SimdJob& job, std::size_t i, SimdCounts& counts) {
    if constexpr (wanted == Wanted::all) {
        SingleFrame frame;
        if (!fill_frame(job.tree, job.rays[i], frame)) {
            ++counts.invalid;
            return;
        }
        SingleRay<wanted, counting, compact> ray(job.tree, frame, job.stack, counts, nullptr,
                                                 static_cast<std::uint32_t>(i));
        ray.collect(*job.all);
        ray.trace(0, {frame.tmax});
        return;
    }
    constexpr bool any = wants_any(wanted);
    TreeHit hit;
    if constexpr (wants_accepted(wanted)) {
        SingleFrame frame;
        if (fill_frame(job.tree, job.rays[i], frame)) {
            SingleRay<wanted, counting, compact> ray(job.tree, frame, job.stack, counts, nullptr,
                                                     static_cast<std::uint32_t>(i));
            ray.check_by(*job.check, job.rays + i);
            const WideBest best = ray.trace(0, {frame.tmax});
            if (best.found()) hit = {best.t * frame.t_scale, best.prim, best.u, best.v};
            counts.hits += hit.hit();
        } else {
            ++counts.invalid;
        }
    } else {
        hit = find_one<any, counting, compact>(job.tree, job.rays[i], job.stack, counts);
    }
    if constexpr (any)
        job.occluded[i] = hit.hit() ? 1 : 0;
    else
        job.hits.put(i, hit);
}

/// All hits, or accepted ones.
inline bool wants_more(const SimdJob& job) { return job.all != nullptr || job.check != nullptr; }

/// run(whether the tree is compact, as a constant).
template <class Run>
HWY_INLINE auto by_layout(const WideView& tree, const Run& run) {
    return tree.is_compact ? run(std::true_type()) : run(std::false_type());
}

/// Calls run(counting, compact) with what the job wants, as constants. Code for compact trees, for
/// all hits and for accepted ones always counts: there is enough of it as it is.
template <class Run>
void with_constants(const SimdJob& job, const Run& run) {
    using Yes = std::true_type;
    using No = std::false_type;
    if (job.tree.is_compact)
        run(Yes(), Yes());
    else
        job.counting || wants_more(job) ? run(Yes(), No()) : run(No(), No());
}

template <bool any>
HWY_NOINLINE TreeHit one_in_compact(const WideView& tree, const Ray& ray,
                                    const WideStackView& stack, CallHistory& history) {
    SimdCounts counts;
    TriangleBlock room{};
    WideView view = tree;
    view.room = &room;
    return find_one<any, true, true>(view, ray, stack, counts, &history);
}

template <bool any>
TreeHit one(const WideView& tree, const Ray& ray, const WideStackView& stack,
            CallHistory& history) {
    if (tree.is_compact) return one_in_compact<any>(tree, ray, stack, history);
    SimdCounts counts;
    return find_one<any, false, false>(tree, ray, stack, counts, &history);
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
