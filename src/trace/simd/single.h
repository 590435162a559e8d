// One ray through a wide tree: eight children at a time, eight triangles at a time. Included once
// per instruction set by simd_kernels.cpp.
#if defined(RAYDIX_SIMD_SINGLE_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_SINGLE_H
#undef RAYDIX_SIMD_SINGLE_H
#else
#define RAYDIX_SIMD_SINGLE_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>

#include "base/check.h"
#include "trace/all_hits.h"
#include "trace/simd/block_hits.h"
#include "trace/simd/children.h"
#include "trace/simd/lanes.h"
#include "trace/simd/single_frame.h"
#include "trace/simd/wide_ray.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

constexpr std::size_t parts8 = 8 / lanes8;
/// Whether children are put in order without jumps.
constexpr bool sorts_in_lanes = HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3;

/// Leaves hold triangles. Else Parts is what takes the rays on at a leaf, which holds the parts
/// from `first` on:
///   float visit_one(std::uint32_t first, std::uint32_t parts, std::uint32_t ray)
///       ray `ray` of the job into them; how far it goes from now on
///   void visit(std::uint32_t first, std::uint32_t parts, const std::uint32_t* rays,
///              std::uint32_t count)
///   float reach(std::uint32_t ray)
///   void ask_for(std::uint32_t word), static constexpr bool large
///       if large: asks for the cache lines of a node or leaf that will be visited soon
///   bool is_at_hand()
///       if there is such a function: whether nobody need ask
///   bool nearest_first
///       for any hit: whether the nearest child is the next one, not the last. It ends rays soon
///       that begin close to something.
struct NoParts {};

/// `guessing`: rays that follow each other take much the same way.
template <Wanted wanted, bool counting, bool compact, bool guessing = false, class Parts = NoParts>
class SingleRay {
public:
    /// `parts`: unless leaves hold triangles. `place`: the ray's, in the job.
    SingleRay(const WideView& tree, const SingleFrame& frame, const WideStackView& stack,
              SimdCounts& counts, Parts* parts = nullptr, std::uint32_t place = 0)
        : tree_(tree),
          frame_(frame),
          stack_(stack),
          counts_(counts),
          parts_(parts),
          place_(place),
          at_(&plane_places[frame.kind.negatives]) {}

    /// Where all hits go, in no order; the ray's place in the job stands for their instance.
    void collect(BudgetVector<Hit>& hits) { all_ = &hits; }
    /// Says which hits count.
    void check_by(const HitCheck& check, const Ray* ray) { check_ = &check, given_ = ray; }

    /// From a node or leaf on; `best` is what was found before.
    WideBest trace(std::uint32_t root, const WideBest& best) {
        best_ = best;
        if (!(frame_.tmin <= best_.t)) return best_;
        best_.t += 0.0f;  // -0 becomes +0
        if constexpr (!always_careful)
            if (frame_.careful) [[unlikely]]
                return trace_carefully(root);
        const Rates rates = plain_rates(frame_.near, frame_.far);
        std::uint32_t word = root;
        std::size_t top = 0;
        while (step(rates, top, word)) {
        }
        return best_;
    }

    [[nodiscard]] const WideBest& best() const { return best_; }

protected:
    using V = hn::Vec<F8>;
    struct Rates;

    /// Visits the node or leaf `word`, which becomes the next one. False at the end.
    HWY_INLINE bool step(const Rates& rates, std::size_t& top, std::uint32_t& word) {
        if ((word & wide_leaf_bit) == 0) {
            if (visit<always_careful>(tree_.template node<compact>(word), rates, top, word))
                return true;
        } else if (test_leaf(word)) {
            return false;
        }
        return pop(top, word);
    }
    HWY_INLINE bool pop(std::size_t& top, std::uint32_t& word) const {
        do {
            if (top == 0) return false;
            --top;
        } while (wants_closest(wanted) && !(stack_.entries[top] <= best_.t));
        word = stack_.words[top];
        return true;
    }

    /// How a ray's distances follow from planes: plane * rate + start.
    struct Rates {
        V rate[3], near[3], far[3];
    };
    HWY_INLINE Rates plain_rates(const float* near, const float* far) const {
        Rates out;
        for (int axis = 0; axis < 3; ++axis) {
            out.rate[axis] = hn::Set(f8, frame_.inverse[axis]);
            out.near[axis] = hn::Set(f8, near[axis]);
            out.far[axis] = hn::Set(f8, far[axis]);
        }
        return out;
    }
    /// Compact nodes say where they are: their own rates see to it.
    static constexpr bool may_have_local_pads = !compact && std::is_same_v<Parts, NoParts>;
    /// Whether all visits are: those of compact nodes, whose pads may turn the boxes of missing
    /// children, and of parts of scenes, which are few.
    static constexpr bool always_careful = !may_have_local_pads;

    /// Planes may overflow, or nodes have pads of their own.
    HWY_NOINLINE WideBest trace_carefully(std::uint32_t word) {
        std::size_t top = 0;
        for (;;) {
            if ((word & wide_leaf_bit) == 0) {
                const auto& node = tree_.template node<false>(word);
                float near[3], far[3];
                std::copy_n(frame_.near, 3, near);
                std::copy_n(frame_.far, 3, far);
                if (tree_.local_pads) set_local_starts(tree_, node, frame_, near, far);
                if (visit<true>(node, plain_rates(near, far), top, word)) continue;
            } else if (test_leaf(word)) {
                return best_;
            }
            if (!pop(top, word)) return best_;
        }
    }
    HWY_INLINE Rates rates_of(const CompactNode& node, const Rates&) const {
        Rates out;
        float step[3], from[3], local[3];
        for (int axis = 0; axis < 3; ++axis) {
            const std::uint32_t bits = std::uint32_t{node.exponent[axis]} << 23;
            std::memcpy(step + axis, &bits, sizeof(float));
            from[axis] = node.origin[axis] - frame_.origin[axis];
        }
        const float* pads = frame_.near_pad;
        if (tree_.local_pads) [[unlikely]] {
            set_local_pads(from, step, local);
            pads = local;
        }
        for (int axis = 0; axis < 3; ++axis) {
            const float inverse = frame_.inverse[axis];
            out.rate[axis] = hn::Set(f8, step[axis] * inverse);
            out.near[axis] = hn::Set(f8, (from[axis] + pads[axis]) * inverse);
            out.far[axis] = hn::Set(f8, (from[axis] - pads[axis]) * inverse);
        }
        return out;
    }
    /// As set_local_starts, of a compact node that begins `from` away from the ray's start.
    HWY_NOINLINE void set_local_pads(const float* from, const float* step, float* pads) const {
        constexpr float rate = wide_pad_factor * slab_pad;
        float share[3];
        for (int axis = 0; axis < 3; ++axis)
            share[axis] = rate * std::fabs(from[axis]) + rate * (256.0f * step[axis]);
        const float along = share[frame_.kind.kz] + least_slab_pad;
        for (int axis = 0; axis < 3; ++axis)
            pads[axis] = std::copysign(share[axis] + along, frame_.near_pad[axis]);
    }
    HWY_INLINE const Rates& rates_of(const WideNode&, const Rates& rates) const { return rates; }
    static HWY_INLINE V planes(const float* from) { return hn::Load(f8, from); }
    static HWY_INLINE V planes(const std::uint8_t* from) {
        return hn::ConvertTo(f8, hn::PromoteTo(I8(), hn::LoadU(B8(), from)));
    }

    /// The larger and the smaller of a and b, as integers, which takes fewer clocks. Of negative
    /// floats, or -0, it may be the other one. Not for NaN.
    static HWY_INLINE V larger_of(V a, V b) {
        return hn::BitCast(f8, hn::Max(hn::BitCast(I8(), a), hn::BitCast(I8(), b)));
    }
    static HWY_INLINE V smaller_of(V a, V b) {
        return hn::BitCast(f8, hn::Min(hn::BitCast(I8(), a), hn::BitCast(I8(), b)));
    }

    /// Where the ray enters children l to l + lanes8 - 1, and where it leaves or need not look.
    /// Unless `careful` a negative exit may be another one.
    template <bool careful, class Node>
    HWY_INLINE void test_boxes(const Node& node, const Rates& rates, std::size_t l, V& entry,
                               V& exit) const {
        const auto* const boxes = &node.lo[0][0] + l;
        V near[3], far[3];
        for (int axis = 0; axis < 3; ++axis) {
            near[axis] =
                hn::MulAdd(planes(boxes + at_->near[axis]), rates.rate[axis], rates.near[axis]);
            far[axis] =
                hn::MulAdd(planes(boxes + at_->far[axis]), rates.rate[axis], rates.far[axis]);
        }
        const V tmin = hn::Set(f8, frame_.tmin), tmax = hn::Set(f8, best_.t);
        if constexpr (careful) {
            // What is NaN does not count.
            entry = hn::Max(near[2], hn::Max(near[1], hn::Max(near[0], tmin)));
            exit = hn::Min(far[2], hn::Min(far[1], hn::Min(far[0], tmax)));
        } else {
            entry = larger_of(larger_of(near[0], near[1]), larger_of(near[2], tmin));
            exit = smaller_of(smaller_of(far[0], far[1]), smaller_of(far[2], tmax));
        }
    }

    static constexpr bool may_take_nearest = wants_any(wanted) && !std::is_same_v<Parts, NoParts>;

    /// The children of a node that a ray meets.
    struct Met {
        V entry[parts8];  // where it enters each child
        V lanes[parts8];  // all bits, if it meets the child
        std::uint32_t slots = 0;
        HWY_INLINE void store_entries(float* to) const {
            for (std::size_t part = 0; part < parts8; ++part)
                hn::Store(entry[part], f8, to + part * lanes8);
        }
        /// At least one.
        [[nodiscard]] HWY_INLINE std::uint32_t nearest() const {
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
            return nearest_slot(entry[0], lanes[0]);
#else
            HWY_ALIGN float entries[8];
            store_entries(entries);
            auto s = static_cast<std::uint32_t>(std::countr_zero(slots));
            for (std::uint32_t left = slots & (slots - 1); left != 0; left &= left - 1) {
                const auto other = static_cast<std::uint32_t>(std::countr_zero(left));
                s = entries[other] < entries[s] ? other : s;
            }
            return s;
#endif
        }
    };
    template <bool careful, class Node>
    HWY_INLINE Met meet(const Node& node, const Rates& about) {
        if constexpr (counting) ++counts_.visits;
        const auto& rates = rates_of(node, about);
        Met met;
        for (std::size_t part = 0; part < parts8; ++part) {
            V exit;
            test_boxes<careful>(node, rates, part * lanes8, met.entry[part], exit);
            met.lanes[part] = lanes_of_le(met.entry[part], exit);
            met.slots |= bits_of_lanes(met.lanes[part]) << part * lanes8;
        }
        // Missing children of plain nodes have boxes that are inside out, so that no ray meets them
        // unless something overflows; in compact ones pads may turn them.
        if (careful && (compact || frame_.careful)) {
            met.slots &= used_slots(node);
            if constexpr (sorts_in_lanes)
                met.lanes[0] = hn::VecFromMask(f8, mask_of(f8, met.slots));
        }
        return met;
    }

    template <std::size_t k>
    static HWY_INLINE std::uint32_t load_child(const std::uint32_t* child) {
        std::uint32_t word = child[k];
#if defined(__GNUC__)
        asm volatile("" : "+r"(word));  // else all cases become one load again
#endif
        return word;
    }
    /// child[k], 0 <= k < 8. Guessing, by a jump for every k: where the processor foresees the jump
    /// it reads the child while it still finds out which one is next.
    static HWY_INLINE std::uint32_t choose(const std::uint32_t* child, std::uint32_t k) {
        if constexpr (!guessing) return child[k];
        switch (k) {
            case 0:
                return load_child<0>(child);
            case 1:
                return load_child<1>(child);
            case 2:
                return load_child<2>(child);
            case 3:
                return load_child<3>(child);
            case 4:
                return load_child<4>(child);
            case 5:
                return load_child<5>(child);
            case 6:
                return load_child<6>(child);
            default:
                return load_child<7>(child);
        }
    }

    /// `word` becomes the nearest child that the ray meets, or for any hit that of the last slot;
    /// the others go onto the stack, the farthest or those of lower slots first. False if it meets
    /// none. How many there are decides no jump where it could not be foreseen.
    template <bool careful, class Node>
    HWY_INLINE bool visit(const Node& node, const Rates& about, std::size_t& top,
                          std::uint32_t& word) {
        constexpr bool jumps = guessing || (wants_closest(wanted) && !sorts_in_lanes);
        const Met met = meet<careful>(node, about);
        const std::uint32_t slots = met.slots;
        if (slots == 0) return false;
        if (jumps && (slots & (slots - 1)) == 0) {
            word = choose(node.child, static_cast<std::uint32_t>(std::countr_zero(slots)));
            return true;
        }
        if constexpr (wants_closest(wanted)) {
            push_sorted(node.child, met, top, word);
        } else if (nearest_first()) {
            const std::uint32_t nearest = met.nearest();
            push(node.child, slots & ~(1u << nearest), top);
            word = node.child[nearest];
        } else {
            const auto last = static_cast<std::uint32_t>(std::bit_width(slots)) - 1;
            push(node.child, slots, top);
            --top;
            word = choose(node.child, last);
        }
        if constexpr (std::is_same_v<Parts, NoParts>)
            ask_for<compact>(tree_, stack_.words[top - (top != 0)]);
        else if constexpr (Parts::large)
            ask_for_parts(node.child, slots);
        return true;
    }
    [[nodiscard]] HWY_INLINE bool nearest_first() const {
        if constexpr (may_take_nearest) return parts_->nearest_first;
        return false;
    }

    /// Children onto the stack, in the order of their slots.
    HWY_INLINE void push(const std::uint32_t* child, std::uint32_t slots, std::size_t& top) const {
        if constexpr (parts8 == 1) {
            const auto words = hn::BitCast(f8, hn::Load(U8(), child));
            hn::StoreU(compress(f8, words, slots), f8,
                       reinterpret_cast<float*>(stack_.words + top));
            top += static_cast<std::size_t>(std::popcount(slots));
        } else {
            for (; slots != 0; slots &= slots - 1)
                stack_.words[top++] = child[std::countr_zero(slots)];
        }
    }

    RAYDIX_PREFETCHING void ask_for_parts(const std::uint32_t* child, std::uint32_t slots) const {
        if constexpr (requires { parts_->is_at_hand(); })
            if (parts_->is_at_hand()) return;
        for (; slots != 0; slots &= slots - 1) parts_->ask_for(child[std::countr_zero(slots)]);
    }

    /// By where the ray enters them. Finds the nearest one by itself, which takes fewer clocks than
    /// all in their order.
    HWY_INLINE void push_sorted(const std::uint32_t* child, const Met& met, std::size_t& top,
                                std::uint32_t& word) {
        const auto others = static_cast<std::uint32_t>(std::popcount(met.slots)) - 1;
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
        word = choose(child, met.nearest());
        const __m256i slots = slots_by_entry(met.entry[0], met.slots);
        const __m256i farthest_first =
            _mm256_sub_epi32(_mm256_set1_epi32(static_cast<int>(others)), hn::Iota(I8(), 0).raw);
        const __m256i pushed = _mm256_permutevar8x32_epi32(slots, farthest_first);
        const auto* const words = reinterpret_cast<const __m256i*>(child);
        _mm256_storeu_si256(reinterpret_cast<__m256i*>(stack_.words + top),
                            _mm256_permutevar8x32_epi32(_mm256_load_si256(words), pushed));
        _mm256_storeu_ps(stack_.entries + top, _mm256_permutevar8x32_ps(met.entry[0].raw, pushed));
        top += others;
#else
        HWY_ALIGN float entries[8];
        met.store_entries(entries);
        std::uint32_t order[8];
        order_by_entry(met.slots, entries, order);
        for (std::size_t k = 0; k < others; ++k) {
            stack_.words[top] = child[order[k]];
            stack_.entries[top++] = entries[order[k]];
        }
        word = choose(child, order[others]);
#endif
    }

    struct Leaf {
        std::uint32_t place, count;
    };
    static HWY_INLINE Leaf leaf_of(std::uint32_t word) {
        return {(word & ~wide_leaf_bit) >> 3, (word & 7) + 1};
    }

    HWY_INLINE bool test_leaf(std::uint32_t word) {
        const auto [place, count] = leaf_of(word);
        if constexpr (!std::is_same_v<Parts, NoParts>) {
            best_.t = parts_->visit_one(place, count, place_);
            return wants_any(wanted) && best_.t < 0;
        } else {
            return test_triangles(place, count);
        }
    }

    HWY_INLINE bool test_triangles(std::uint32_t place, std::uint32_t count) {
        if constexpr (counting) counts_.tests += count;
        const TriangleBlock& block = tree_.template block<compact>(place);
        return finish(block, candidates_of(block, lanes_of(place, count)));
    }
    static HWY_INLINE std::uint32_t lanes_of(std::uint32_t place, std::uint32_t count) {
        return ((1u << count) - 1) << place % block_lanes;
    }

    HWY_INLINE Sheared<F4> shear(const TriangleBlock& block, int vertex) const {
        const auto at = [&](std::uint32_t axis) {
            return hn::Sub(hn::Load(f4, block.corner[3 * vertex + static_cast<int>(axis)]),
                           hn::Set(f4, frame_.origin[axis]));
        };
        const V4 z = at(frame_.kind.kz);
        return {hn::Sub(at(frame_.kind.kx), hn::Mul(hn::Set(f4, frame_.shear[0]), z)),
                hn::Sub(at(frame_.kind.ky), hn::Mul(hn::Set(f4, frame_.shear[1]), z)), z};
    }

    /// Triangles of a block that may be hit; those that surely are, where any hit will do. `clear`:
    /// lanes none of whose edge functions is 0 or NaN.
    struct Candidates {
        std::uint32_t open = 0, clear = 0, certain = 0;
    };

    /// Calls with(a, b, c, u, v, w): the corners of a block as the ray sees them, and the three
    /// edge functions of each triangle.
    template <class With>
    HWY_INLINE auto see(const TriangleBlock& block, const With& with) const {
        const Sheared<F4> a = shear(block, 0), b = shear(block, 1), c = shear(block, 2);
        return with(a, b, c, edge(c, b), edge(a, c), edge(b, a));
    }
    /// Of the lanes in `tested` those that the ray may go through.
    static HWY_INLINE std::uint32_t crossed(std::uint32_t tested, V4 u, V4 v, V4 w) {
        return tested & ~bits_astride(hn::Min(hn::Min(u, v), w), hn::Max(hn::Max(u, v), w));
    }

    /// What floats leave open of intersect_triangle for the lanes in `tested`. `early`: with jumps
    /// where none is left.
    template <bool early = true>
    HWY_INLINE Candidates candidates_of(const TriangleBlock& block, std::uint32_t tested) const {
        return see(
            block,
            [&](const auto& a, const auto& b, const auto& c, V4 u, V4 v, V4 w) -> Candidates {
                const std::uint32_t open = crossed(tested, u, v, w);
                if (early && open == 0) return {};
                const std::uint32_t clear = bits_of(f4, without_zero(f4, u, v, w));
                if constexpr (wanted == Wanted::any) {
                    const auto kz = static_cast<int>(frame_.kind.kz);
                    const Limits<F4> limits{hn::Set(f4, frame_.tmin), hn::Set(f4, best_.t),
                                            hn::Set(f4, frame_.direction[kz]),
                                            std::fabs(frame_.near_pad[kz]),
                                            frame_.kind.negative(kz)};
                    const AnyHit hit = any_hit<early>(f4, limits, a, b, c, u, v, w, open, clear);
                    return {hit.open, clear, hit.certain};
                }
                return {open, clear, 0};
            });
    }

    /// The rest of intersect_triangle: the same bits. True: stop.
    HWY_INLINE bool finish(const TriangleBlock& block, const Candidates& here) {
        if (wanted == Wanted::any && here.certain != 0) {
            best_.prim = 0;
            return true;
        }
        return here.open != 0 && finish_open(block, here.open, here.clear);
    }
    HWY_NOINLINE bool finish_open(const TriangleBlock& block, std::uint32_t candidates,
                                  std::uint32_t clear) {
        for (; candidates != 0; candidates &= candidates - 1) {
            const auto lane = static_cast<std::uint32_t>(std::countr_zero(candidates));
            TriangleHit hit;
            if ((clear >> lane & 1) != 0 &&
                        hit_lane<true>(block, lane, frame_.origin, frame_.direction, frame_.kind,
                                       frame_.tmin, hit)
                    ? !(hit.t >= frame_.tmin && hit.t <= best_.t)
                    : !test_exactly<edge_rule(wanted)>(frame_.triangle_ray(), block, lane, best_.t,
                                                       hit))
                continue;
            if constexpr (wants_accepted(wanted))
                if (!(*check_)(given_, {hit.t * frame_.t_scale, block.prim[lane], hit.u, hit.v}))
                    continue;
            if constexpr (wanted == Wanted::all)
                all_->push_back(
                    found_by(place_, {hit.t * frame_.t_scale, block.prim[lane], hit.u, hit.v}));
            else
                best_.take(hit.t, block.prim[lane], hit.u, hit.v);
            if constexpr (wants_any(wanted)) return true;
        }
        return false;
    }

    const WideView& tree_;
    const SingleFrame& frame_;
    const WideStackView stack_;
    SimdCounts& counts_;
    Parts* const parts_;
    std::uint32_t place_;
    const PlanePlaces* at_;
    WideBest best_{};
    BudgetVector<Hit>* all_ = nullptr;
    const HitCheck* check_ = nullptr;
    const Ray* given_ = nullptr;  // to the check
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
