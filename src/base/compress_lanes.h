// Lanes of a vector whose bits are set, moved to the front: hn::Compress, but with tables that stay
// where they are. Highway 1.0's are local to the function, and GCC copies them to the stack for
// each call. Included once per instruction set.
#if defined(RAYDIX_COMPRESS_LANES_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_COMPRESS_LANES_H
#undef RAYDIX_COMPRESS_LANES_H
#else
#define RAYDIX_COMPRESS_LANES_H
#endif

#include <hwy/highway.h>

#include <cstdint>

#include "base/compress_tables.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Vectors of 4 to 64 bytes, lanes of 4 or 8. What lies behind the lanes kept has no meaning.
template <class D>
HWY_INLINE hwy::HWY_NAMESPACE::Vec<D> compress([[maybe_unused]] D d, hwy::HWY_NAMESPACE::Vec<D> v,
                                               std::uint32_t bits) {
    namespace hn = hwy::HWY_NAMESPACE;
#if HWY_TARGET != HWY_AVX3
    constexpr std::size_t lanes = hn::MaxLanes(D()), bytes = lanes * sizeof(hn::TFromD<D>);
    const std::uint32_t words = sizeof(hn::TFromD<D>) == 8 ? twice_each_bit[bits] : bits;
    if constexpr (bytes == 32) {
        const hn::Repartition<std::uint32_t, D> u32;
        const hn::Rebind<std::uint8_t, decltype(u32)> u8;
        const auto from = hn::PromoteTo(u32, hn::LoadU(u8, words_of_8[words].data()));
        return hn::BitCast(
            d, hn::TableLookupLanes(hn::BitCast(u32, v), hn::IndicesFromVec(u32, from)));
    } else if constexpr (bytes == 16) {
        const hn::Repartition<std::uint8_t, D> u8;
        const auto from = hn::Load(u8, bytes_of_4[words].data());
        return hn::BitCast(d, hn::TableLookupBytes(hn::BitCast(u8, v), from));
    }
#endif
    const std::uint8_t few[8] = {static_cast<std::uint8_t>(bits),
                                 static_cast<std::uint8_t>(bits >> 8)};
    return hn::CompressBits(v, few);
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
