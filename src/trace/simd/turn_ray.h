// A ray through a wide tree that takes turns with others: visits in halves, so that no visit waits
// for memory or for the arithmetic of its own first half. Included once per instruction set.
#if defined(RAYDIX_SIMD_TURN_RAY_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_TURN_RAY_H
#undef RAYDIX_SIMD_TURN_RAY_H
#else
#define RAYDIX_SIMD_TURN_RAY_H
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstdint>
#include <type_traits>

#include "trace/simd/single.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// What a ray does in its next turn.
enum class TurnKind { node, leaf, part };

/// What a visit reads lies together, and is read once: such rays are limited by how much they read.
/// After begin(): look(), if it says so try_hit() and keep_hit(), and step_node() or step_leaf(),
/// until a step says that nothing is left.
template <Wanted wanted, bool counting, bool compact, class Parts = NoParts>
class TurnRay : SingleRay<wanted, counting, compact, false, Parts> {
    using Base = SingleRay<wanted, counting, compact, false, Parts>;
    using Node = std::conditional_t<compact, CompactNode, WideNode>;
    using V = typename Base::V;
    static constexpr bool closest = wants_closest(wanted);
    static constexpr bool has_parts = !std::is_same_v<Parts, NoParts>;
    /// Whether hits are found for several rays before one of them is looked at.
    static constexpr bool tries =
        (wanted == Wanted::closest || wanted == Wanted::any) && !has_parts;

public:
    /// As SingleRay's; children go to `stack.pairs`, for any hit to `stack.words`. The frame may
    /// change until begin().
    TurnRay(const WideView& tree, SingleFrame& frame, const WideStackView& stack,
            SimdCounts& counts, Parts* parts = nullptr)
        : Base(tree, frame, stack, counts, parts), starts_(frame) {
        if constexpr (compact)
            nodes_ = address(tree.compact_nodes), blocks_ = address(tree.compact_blocks);
        else
            nodes_ = address(tree.nodes), blocks_ = address(tree.blocks);
    }

    using Base::best;
    using Base::check_by;
    using Base::collect;

    /// The frame holds another ray, which has this place in the job.
    void stand_for(std::uint32_t place) { Base::place_ = place; }
    /// From the root on; false if there is nothing to do.
    HWY_INLINE bool begin(float tmax) {
        const SingleFrame& frame = this->frame_;
        this->at_ = &plane_places[frame.kind.negatives];
        planes_ = packed_plane_places[frame.kind.negatives] |
                  static_cast<std::uint64_t>(frame.careful) << careful_bit |
                  static_cast<std::uint64_t>(this->tree_.local_pads) << local_bit;
        tmin_ = frame.tmin;
        best_ = {tmax};
        top_ = bottom();
        *top_++ = the_end;
        word_ = 0, next_address_ = nodes_;
        return tmin_ <= tmax;
    }
    /// The next one: what a step visits.
    [[nodiscard]] std::uint32_t next() const { return word_; }
    HWY_INLINE void ask_for_next() const { ask_at<compact>(next_address_, word_); }
    /// Leaves the leaf that is next behind; the ray goes as far as `reach` from now on.
    HWY_INLINE bool skip(float reach) {
        best_.t = reach;
        return pop();
    }

    /// The first half of a visit of what is next; whether there is a hit that try_hit and keep_hit
    /// shall look at. Nothing for parts of a scene.
    template <TurnKind kind>
    HWY_INLINE bool look(std::integral_constant<TurnKind, kind>) {
        if constexpr (kind == TurnKind::node) look_at_node();
        if constexpr (kind == TurnKind::leaf) return look_at_leaf();
        return false;
    }
    /// The second half for a node; whether there is another node or leaf. Few branches: those of
    /// rays in turn cannot be foreseen.
    HWY_INLINE bool step_node() {
        if constexpr (closest)
            for (std::size_t k = parts8 == 1 ? 4 : 1; k < pushed_; ++k) insert(k);
        top_ += pushed_;
        return pop();
    }
    /// Where the ray meets the first of them; any hit: whether it meets one.
    HWY_INLINE void try_hit() {
        if constexpr (wanted == Wanted::any) {
            const auto [place, count] = this->leaf_of(word_);
            open_ = this->template candidates_of<false>(block(), this->lanes_of(place, count));
            return;
        }
        const SingleFrame& frame = this->frame_;
        const auto lane = static_cast<std::uint32_t>(std::countr_zero(open_.open));
        const TriangleBlock& here = block();
        is_sure_ =
            hit_lane<false>(here, lane, frame.origin, frame.direction, frame.kind, tmin_, hit_);
        prim_ = here.prim[lane];
    }
    HWY_INLINE void keep_hit() {
        if constexpr (wanted == Wanted::any) {
            this->finish(block(), open_);
            return;
        }
        const std::uint32_t others = open_.open & (open_.open - 1);
        if (!is_sure_ || others != 0 || (open_.open & open_.clear) == 0) {
            this->finish(block(), open_);
            return;
        }
        best_.take_if(hit_.t >= tmin_, hit_.t, prim_, hit_.u, hit_.v);
    }
    /// The second half for a leaf; whether there is another node or leaf.
    HWY_INLINE bool step_leaf() {
        if constexpr (has_parts) {
            if (this->test_leaf(word_)) return false;
        } else if constexpr (tries) {
            if (wanted == Wanted::any && best_.found()) return false;
        } else if (this->finish(block(), open_)) {
            return false;
        }
        return pop();
    }

private:
    using Base::best_;
    using Base::frame_;
    using Base::stack_;

    /// A child; for closest hits where the ray enters it, too, in the upper half.
    using Waiting = std::conditional_t<closest, std::uint64_t, std::uint32_t>;
    [[nodiscard]] Waiting* bottom() const {
        if constexpr (closest)
            return stack_.pairs;
        else
            return stack_.words;
    }
    /// Below all children: no node or leaf.
    static constexpr Waiting the_end = wide_no_child;
    static_assert(std::endian::native == std::endian::little);  // pairs are written as two floats
    static constexpr int careful_bit = 56, local_bit = 57;

    static std::uintptr_t address(const void* p) { return reinterpret_cast<std::uintptr_t>(p); }

    /// Of the node that is next: its children that the ray meets go behind the stack's top. Without
    /// branches but for what is rare.
    HWY_INLINE void look_at_node() {
        if constexpr (counting) ++this->counts_.visits;
        const Node& node = *reinterpret_cast<const Node*>(next_address_);
        if constexpr (Base::may_have_local_pads)
            if (planes_ >> local_bit != 0) [[unlikely]]
                set_local_starts(this->tree_, node, starts_, starts_.near, starts_.far);
        pushed_ = 0;
        for (std::size_t l = 0; l < 8; l += lanes8) push_met(node, l);
    }
    /// Of the leaf that is next: which triangles may be hit.
    HWY_INLINE bool look_at_leaf() {
        if constexpr (has_parts) return false;
        const auto [place, count] = this->leaf_of(word_);
        if constexpr (counting) this->counts_.tests += count;
        const std::uint32_t lanes = this->lanes_of(place, count);
        if constexpr (tries) {
            open_ =
                this->see(block(), [&](const auto&, const auto&, const auto&, V4 u, V4 v, V4 w) {
                    const std::uint32_t clear =
                        closest ? bits_of(f4, without_zero(f4, u, v, w)) : 0;
                    return typename Base::Candidates{Base::crossed(lanes, u, v, w), clear, 0};
                });
            return open_.open != 0;
        }
        open_ = this->candidates_of(block(), lanes);
        return false;
    }

    [[nodiscard]] HWY_INLINE const TriangleBlock& block() const {
        if constexpr (compact)
            return this->tree_.template block<compact>(this->leaf_of(word_).place);
        else
            return *reinterpret_cast<const TriangleBlock*>(next_address_);
    }

    HWY_INLINE bool pop() {
        Waiting* top = top_;
        Waiting next;
        do next = *--top;
        while (closest && next > farthest());
        top_ = top;
        word_ = static_cast<std::uint32_t>(next);
        next_address_ = place_of<compact>(nodes_, blocks_, word_);
        return word_ != wide_no_child;
    }
    /// No pair is larger whose entry is at most best_.t: floats that are not negative are in the
    /// order of their bits. Upper halves are those and 1: 0 is no child.
    [[nodiscard]] HWY_INLINE std::uint64_t farthest() const {
        return (std::uint64_t{std::bit_cast<std::uint32_t>(best_.t)} + 1) << 32 | 0xFFFFFFFFu;
    }

    /// Where a ray enters children l to l + lanes8 - 1, and where it leaves or need not look.
    HWY_INLINE void test_boxes(const Node& node, std::size_t l, V& entry, V& exit) const {
        if constexpr (compact) {
            const auto about = this->plain_rates(frame_.near, frame_.far);
            Base::template test_boxes<true>(node, this->rates_of(node, about), l, entry, exit);
            return;
        }
        const auto* const boxes = reinterpret_cast<const float*>(next_address_) + l;
        const std::uint64_t planes = planes_;
        const SingleFrame& frame = this->frame_;
        entry = hn::Set(f8, tmin_);
        exit = hn::Set(f8, best_.t);
        for (int axis = 0; axis < 3; ++axis) {
            const V rate = hn::Set(f8, frame.inverse[axis]);
            const V near = hn::Load(f8, boxes + (planes >> 16 * axis & 0xFF)),
                    far = hn::Load(f8, boxes + (planes >> (16 * axis + 8) & 0xFF));
            entry = hn::Max(hn::MulAdd(near, rate, hn::Set(f8, frame.near[axis])), entry);
            exit = hn::Min(hn::MulAdd(far, rate, hn::Set(f8, frame.far[axis])), exit);
        }
    }

    /// Of children l to l + lanes8 - 1 those that the ray meets go behind the stack's top. For
    /// closest hits the nearer one of the first two is second, for any hit they keep their order.
    HWY_INLINE void push_met(const Node& node, std::size_t l) {
        V entry, exit;
        test_boxes(node, l, entry, exit);
        auto mask = hn::Le(entry, exit);
        std::uint32_t met = bits_of(f8, mask);
        if (compact || planes_ >> careful_bit != 0) {
            met &= used_slots(node) >> l;
            mask = mask_of(f8, met);
        }
        const V word = compress(f8, hn::BitCast(f8, hn::Load(U8(), node.child + l)), mask, met);
        const auto count = static_cast<std::uint32_t>(std::popcount(met));
        auto* const to = reinterpret_cast<float*>(top_ + pushed_);
        pushed_ += count;
        if constexpr (!closest) {
            hn::StoreU(word, f8, to);
            return;
        }
        // Not -0, whose bits are large.
        const auto bits = hn::Add(hn::BitCast(I8(), hn::Abs(entry)), hn::Set(I8(), 1));
        entry = compress(f8, hn::BitCast(f8, bits), mask, met);
        if constexpr (parts8 == 1) {
            // Only AVX-512 leaves zeros behind them.
            if constexpr (HWY_TARGET != HWY_AVX3)
                entry = hn::IfThenElseZero(hn::FirstN(f8, count), entry);
        }
        const V first = hn::InterleaveLower(f8, word, entry),
                second = hn::InterleaveUpper(f8, word, entry);
        if constexpr (parts8 == 1) {
            // Blocks of four floats: pairs 0, 1 and 4, 5; then 2, 3 and 6, 7.
            store_four(hn::LowerHalf(first), hn::LowerHalf(second), to);
            if (count > 4) {
                hn::StoreU(hn::UpperHalf(f4, first), f4, to + 8);
                hn::StoreU(hn::UpperHalf(f4, second), f4, to + 12);
            }
        } else {
            hn::StoreU(first, f8, to);
            hn::StoreU(second, f8, to + 4);
        }
    }
    /// Four pairs, the larger ones first. Of fewer the others are 0.
    static HWY_INLINE void store_four(hn::Vec<F4> first, hn::Vec<F4> second, float* to) {
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
        __m256i pairs = _mm256_castps_si256(_mm256_set_m128(second.raw, first.raw));
        // Bitonic, in three steps (Batcher 1968). Upper halves are not negative.
        pairs = compare_exchange_pairs<0b1001>(pairs, _mm256_permute4x64_epi64(pairs, 0b10110001));
        pairs = compare_exchange_pairs<0b0011>(pairs, _mm256_permute4x64_epi64(pairs, 0b01001110));
        pairs = compare_exchange_pairs<0b0101>(pairs, _mm256_permute4x64_epi64(pairs, 0b10110001));
        _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), pairs);
#else
        hn::StoreU(first, f4, to);
        hn::StoreU(second, f4, to + 4);
#endif
    }
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
    /// The larger of each pair and its partner in the lanes of `larger`, else the smaller.
    template <int larger>
    static HWY_INLINE __m256i compare_exchange_pairs(__m256i pair, __m256i partner) {
#if HWY_TARGET == HWY_AVX3
        return _mm256_mask_max_epi64(_mm256_min_epi64(pair, partner), larger, pair, partner);
#else
        const __m256i smaller = _mm256_setr_epi64x(larger & 1 ? 0 : -1, larger & 2 ? 0 : -1,
                                                   larger & 4 ? 0 : -1, larger & 8 ? 0 : -1);
        const __m256i taken = _mm256_xor_si256(_mm256_cmpgt_epi64(partner, pair), smaller);
        return _mm256_blendv_epi8(pair, partner, taken);
#endif
    }
#endif
    static HWY_INLINE std::uint32_t entry_of(std::uint64_t pair) {
        return static_cast<std::uint32_t>(pair >> 32);
    }
    /// Pair k behind the stack's top to its place among those before it, which are in their order.
    HWY_INLINE void insert(std::size_t k) {
        std::uint64_t* const pairs = top_;
        const std::uint64_t pair = pairs[k];
        const std::uint32_t entry = entry_of(pair);
        if (entry < entry_of(pairs[k - 1])) return;
        pairs[k] = pairs[k - 1];
        for (--k; k > 0 && entry_of(pairs[k - 1]) < entry; --k) pairs[k] = pairs[k - 1];
        pairs[k] = pair;
    }

    SingleFrame& starts_;  // the frame, for trees whose nodes have pads of their own
    float tmin_ = 0;
    std::uint64_t planes_ = 0;  // packed_plane_places, and whether visits are special
    std::uintptr_t nodes_, blocks_;
    std::uintptr_t next_address_ = 0;
    Waiting* top_ = nullptr;
    std::uint32_t word_ = 0;
    // Between the halves of a visit: how many children lie behind the stack's top, or what of the
    // leaf may be hit.
    std::uint32_t pushed_ = 0;
    typename Base::Candidates open_;
    TriangleHit hit_;
    std::uint32_t prim_ = 0;
    bool is_sure_ = false;
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
