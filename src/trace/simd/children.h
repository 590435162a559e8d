// Which children a node has, and in which order rays take them. Included once per instruction set.
#if defined(RAYDIX_SIMD_CHILDREN_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_CHILDREN_H
#undef RAYDIX_SIMD_CHILDREN_H
#else
#define RAYDIX_SIMD_CHILDREN_H
#endif

#include <hwy/cache_control.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <type_traits>

#include "base/prefetch.h"
#include "trace/simd/lanes.h"
#include "trace/simd/wide_ray.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Of any object: a prefetch for each of its cache lines.
template <class Object>
RAYDIX_PREFETCHING void ask_for_all(const Object& object) {
    constexpr std::size_t line = 64;
    const auto* const bytes = reinterpret_cast<const char*>(&object);
    for (std::size_t k = 0; k < sizeof(Object); k += line) hwy::Prefetch(bytes + k);
}

/// Bit s: there is a child in slot s.
HWY_INLINE std::uint32_t used_slots(const CompactNode& node) { return node.used; }
HWY_INLINE std::uint32_t used_slots(const WideNode& node) {
    std::uint32_t used = 0;
    for (std::size_t l = 0; l < 8; l += lanes8) {
        const auto words = hn::Load(U8(), node.child + l);
        const auto missing = hn::Eq(words, hn::Set(U8(), wide_no_child));
        used |= bits_of(f8, hn::RebindMask(f8, hn::Not(missing))) << l;
    }
    return used;
}

/// `leaf` if `word` is one, else `node`; without a jump, which could not be foreseen.
HWY_INLINE std::uintptr_t by_kind_of(std::uint32_t word, std::uintptr_t node, std::uintptr_t leaf) {
    static_assert(wide_leaf_bit == 1u << 31);
#if defined(__GNUC__) && defined(__x86_64__)
    asm("test %1, %1\n\tcmovs %2, %0" : "+r"(node) : "r"(word), "r"(leaf) : "cc");
    return node;
#else
    const auto is_leaf = std::uintptr_t{0} - (word >> 31);
    return node ^ ((node ^ leaf) & is_leaf);
#endif
}

template <bool compact>
using NodeOf = std::conditional_t<compact, CompactNode, WideNode>;
template <bool compact>
using BlockOf = std::conditional_t<compact, CompactBlock, TriangleBlock>;

/// Where a child, node or leaf, lies. Without branches: which of both it is cannot be foreseen.
template <bool compact>
HWY_INLINE std::uintptr_t place_of(std::uintptr_t nodes, std::uintptr_t blocks,
                                   std::uint32_t word) {
    const std::size_t block = ((word & ~wide_leaf_bit) >> 3) / block_lanes;
    return by_kind_of(word, nodes + std::size_t{word} * sizeof(NodeOf<compact>),
                      blocks + block * sizeof(BlockOf<compact>));
}

/// Asks for the cache lines of the child `word` at `at`, which will be visited soon.
template <bool compact>
RAYDIX_PREFETCHING void ask_at(std::uintptr_t at, std::uint32_t word) {
    constexpr std::size_t line = 64, node_lines = (sizeof(NodeOf<compact>) + line - 1) / line,
                          block_lines = (sizeof(BlockOf<compact>) + line - 1) / line;
    const bool leaf = (word & wide_leaf_bit) != 0;
    const auto* const place = reinterpret_cast<const char*>(at);
    constexpr std::size_t least = std::min(node_lines, block_lines);
    for (std::size_t k = 0; k < least; ++k) hwy::Prefetch(place + k * line);
    // The rest of the larger kind; the first line once more for the other.
    for (std::size_t k = least; k < std::max(node_lines, block_lines); ++k)
        hwy::Prefetch(place + (leaf == (block_lines > least) ? k * line : 0));
}

template <bool compact>
RAYDIX_PREFETCHING void ask_for(const WideView& tree, std::uint32_t word) {
    const auto address = [](const void* p) { return reinterpret_cast<std::uintptr_t>(p); };
    if constexpr (compact)
        ask_at<compact>(
            place_of<compact>(address(tree.compact_nodes), address(tree.compact_blocks), word),
            word);
    else
        ask_at<compact>(place_of<compact>(address(tree.nodes), address(tree.blocks), word), word);
}

/// For each of eight children a set of up to 64 rays.
class RaySets {
public:
#if HWY_TARGET == HWY_AVX3
    HWY_INLINE RaySets() : sets_(_mm512_setzero_si512()) {}
    /// `ray` into the sets of the children in `met`.
    HWY_INLINE void add(std::uint32_t met, std::uint64_t ray) {
        const __m512i one = _mm512_set1_epi64(static_cast<long long>(ray));
        sets_ = _mm512_mask_or_epi64(sets_, static_cast<__mmask8>(met), sets_, one);
    }
    HWY_INLINE void store(std::uint64_t* to) const { _mm512_store_si512(to, sets_); }

private:
    __m512i sets_;
#else
    HWY_INLINE void add(std::uint32_t met, std::uint64_t ray) {
        for (std::uint32_t c = 0; c < 8; ++c) sets_[c] |= (met >> c & 1) != 0 ? ray : 0;
    }
    HWY_INLINE void store(std::uint64_t* to) const { std::memcpy(to, sets_, sizeof(sets_)); }

private:
    std::uint64_t sets_[8] = {};
#endif
};

/// `slots` into `order`, as they lie; how many.
HWY_INLINE std::uint32_t order_by_slot(std::uint32_t slots, std::uint32_t* order) {
    if constexpr (lanes8 == 8) {
        const auto all = hn::BitCast(f8, hn::Iota(U8(), 0));
        hn::StoreU(hn::BitCast(U8(), compress(f8, all, slots)), U8(), order);
        return static_cast<std::uint32_t>(std::popcount(slots));
    }
    std::uint32_t count = 0;
    for (; slots != 0; slots &= slots - 1)
        order[count++] = static_cast<std::uint32_t>(std::countr_zero(slots));
    return count;
}

#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
/// The larger of each key and its partner in the lanes of `larger`, else the smaller.
template <int larger>
HWY_INLINE __m256i compare_exchange(__m256i key, __m256i partner) {
    return _mm256_blend_epi32(_mm256_min_epi32(key, partner), _mm256_max_epi32(key, partner),
                              larger);
}
template <int larger>
HWY_INLINE __m128i compare_exchange(__m128i key, __m128i partner) {
    return _mm_blend_epi32(_mm_min_epi32(key, partner), _mm_max_epi32(key, partner), larger);
}

/// Eight keys in order. Bitonic (Batcher 1968).
template <bool largest_first>
HWY_INLINE __m256i sorted_eight(__m256i key) {
    constexpr int other = largest_first ? 0 : 0xFF;
    key = compare_exchange<0b10011001 ^ other>(key, _mm256_shuffle_epi32(key, 0b10110001));
    key = compare_exchange<0b11000011 ^ other>(key, _mm256_shuffle_epi32(key, 0b01001110));
    key = compare_exchange<0b10100101 ^ other>(key, _mm256_shuffle_epi32(key, 0b10110001));
    key = compare_exchange<0b00001111 ^ other>(key, _mm256_permute4x64_epi64(key, 0b01001110));
    key = compare_exchange<0b00110011 ^ other>(key, _mm256_shuffle_epi32(key, 0b01001110));
    return compare_exchange<0b01010101 ^ other>(key, _mm256_shuffle_epi32(key, 0b10110001));
}

/// Where rays enter children, as keys that end with 7 - slot. No entry is negative.
HWY_INLINE __m256i entry_keys(hn::Vec<F8> entries) {
    const __m256i own = _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0);
    return _mm256_or_si256(
        _mm256_andnot_si256(_mm256_set1_epi32(7), _mm256_castps_si256(entries.raw)), own);
}

/// The first of slots_by_entry, in fewer clocks. `met`: all bits are set in the lanes of slots that
/// count, at least one.
HWY_INLINE std::uint32_t nearest_slot(hn::Vec<F8> entries, hn::Vec<F8> met) {
    const __m256i none = _mm256_xor_si256(_mm256_castps_si256(met.raw), _mm256_set1_epi32(-1));
    const __m256i keys = _mm256_or_si256(entry_keys(entries), none);
    __m128i least = _mm_min_epu32(_mm256_castsi256_si128(keys), _mm256_extracti128_si256(keys, 1));
    least = _mm_min_epu32(least, _mm_shuffle_epi32(least, 0b01001110));
    least = _mm_min_epu32(least, _mm_shuffle_epi32(least, 0b10110001));
    return ~static_cast<std::uint32_t>(_mm_cvtsi128_si32(least)) & 7;
}

/// `slots`, at least one, the smallest of `entries` first, which is not quite the smallest where
/// they differ in the last digits alone; of equal ones the higher slot. Lanes behind them mean
/// nothing.
HWY_INLINE __m256i slots_by_entry(hn::Vec<F8> entries, std::uint32_t slots) {
    const __m256i digits = _mm256_set1_epi32(7);
    const __m256i all = entry_keys(entries);
    const auto count = static_cast<std::uint32_t>(std::popcount(slots));
    const __m256i none = _mm256_set1_epi32(INT32_MAX);
#if HWY_TARGET == HWY_AVX3
    const __m256i keys = _mm256_mask_compress_epi32(none, static_cast<__mmask8>(slots), all);
#else
    const auto packed = compress(f8, hn::BitCast(f8, hn::Vec<I8>{all}), slots);
    const __m256i behind =
        _mm256_cmpgt_epi32(hn::Iota(I8(), 0).raw, _mm256_set1_epi32(static_cast<int>(count) - 1));
    const __m256i keys = _mm256_blendv_epi8(_mm256_castps_si256(packed.raw), none, behind);
#endif
    // Four in three steps of the same network.
    __m128i four = _mm256_castsi256_si128(keys);
    if (count <= 4) [[likely]] {
        four = compare_exchange<0b0110>(four, _mm_shuffle_epi32(four, 0b10110001));
        four = compare_exchange<0b1100>(four, _mm_shuffle_epi32(four, 0b01001110));
        four = compare_exchange<0b1010>(four, _mm_shuffle_epi32(four, 0b10110001));
        return _mm256_andnot_si256(_mm256_castsi128_si256(four), digits);
    }
    return _mm256_andnot_si256(sorted_eight<false>(keys), digits);
}
#endif

/// `slots` into `order` [8], the largest of `entries` [8] first, which is not quite the largest
/// where they differ in the last digits alone; how many.
HWY_INLINE std::uint32_t order_by_entry(std::uint32_t slots, const float* entries,
                                        std::uint32_t* order) {
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
    const auto number = static_cast<std::uint32_t>(std::popcount(slots));
    if (number < 2) {
        order[0] = static_cast<std::uint32_t>(std::countr_zero(slots));
        return number;
    }
    // A sorting network, since no comparison could be foreseen. Its keys end with the slot.
    const __m256i own = _mm256_set_epi32(0, 1, 2, 3, 4, 5, 6, 7), digits = _mm256_set1_epi32(7);
    const __m256i bit = _mm256_set_epi32(128, 64, 32, 16, 8, 4, 2, 1);
    const __m256i there =
        _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(static_cast<int>(slots)), bit), bit);
    // As integers the larger of two negative floats is the smaller one.
    const __m256i entry = _mm256_castps_si256(_mm256_load_ps(entries));
    const __m256i sign = _mm256_srai_epi32(entry, 31);
    const __m256i by_size = _mm256_xor_si256(entry, _mm256_srli_epi32(sign, 1));
    __m256i key = _mm256_or_si256(_mm256_andnot_si256(digits, by_size), own);
    key = _mm256_blendv_epi8(_mm256_set1_epi32(INT32_MIN), key, there);
    key = sorted_eight<true>(key);
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(order), _mm256_andnot_si256(key, digits));
    return number;
#else
    std::uint32_t count = 0;
    for (; slots != 0; slots &= slots - 1) {
        const auto s = static_cast<std::uint32_t>(std::countr_zero(slots));
        std::uint32_t k = count++;
        for (; k > 0 && entries[order[k - 1]] < entries[s]; --k) order[k] = order[k - 1];
        order[k] = s;
    }
    return count;
#endif
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
