// Full denormals inside the library, whatever the caller's thread was set to.
#pragma once

#if defined(__x86_64__) || defined(_M_X64)
#include <emmintrin.h>

#include <limits>
#elif defined(__aarch64__)
#include <cstdint>
#endif

namespace raydix {

/// Clears flush-to-zero and denormals-are-zero and sets rounding to nearest for its lifetime;
/// restores after.
class FloatEnvironment {
public:
    FloatEnvironment(const FloatEnvironment&) = delete;
    FloatEnvironment& operator=(const FloatEnvironment&) = delete;
#if defined(__x86_64__) || defined(_M_X64)
    FloatEnvironment() : saved_(_mm_getcsr()) {
        if (saved_ & special_bits) _mm_setcsr(saved_ & ~special_bits);
    }
    ~FloatEnvironment() {
        if (saved_ & special_bits) _mm_setcsr(saved_);
    }

private:
    static constexpr unsigned special_bits =
        0x8000u | 0x0040u | 0x6000u;  // FTZ, DAZ, rounding mode
    unsigned saved_;

public:
    /// Whether nothing is to be set. AMD's processors wait for all arithmetic before they read the
    /// control register, which keeps short calls from overlapping: there additions tell. On newer
    /// ones of Intel (Sapphire Rapids) these take 36 ns, as one result is denormal; to read
    /// takes 1.
    [[nodiscard]] static bool is_plain() { return adds_ ? adds_plainly() : reads_plain(); }
    [[nodiscard]] static bool reads_plain() { return (_mm_getcsr() & special_bits) == 0; }
    [[nodiscard]] static bool adds_plainly() {
        constexpr float least = std::numeric_limits<float>::min();
        // A result below `least`, an operand below it, and ties that go either way from 1.
        __m128 a = _mm_setr_ps(1.5f * least, 0.5f * least, 1.0f, 1.0f);
        const __m128 b = _mm_setr_ps(-least, 0.0f, 0x1p-24f, -0x1p-25f),
                     nearest = _mm_setr_ps(0.5f * least, 0.5f * least, 1.0f, 1.0f);
        asm volatile("" : "+x"(a));  // not at compile time
        const __m128i same =
            _mm_cmpeq_epi32(_mm_castps_si128(_mm_add_ps(a, b)), _mm_castps_si128(nearest));
        return _mm_movemask_epi8(same) == 0xFFFF;
    }

private:
    static inline const bool adds_ = [] {
        __builtin_cpu_init();
        return __builtin_cpu_is("amd") != 0;
    }();
#elif defined(__aarch64__)
    FloatEnvironment() {
        asm volatile("mrs %0, fpcr" : "=r"(saved_));
        if (saved_ & special_bits) set(saved_ & ~special_bits);
    }
    ~FloatEnvironment() {
        if (saved_ & special_bits) set(saved_);
    }

private:
    static void set(std::uint64_t bits) { asm volatile("msr fpcr, %0" : : "r"(bits)); }
    // FZ; rounding mode; and of newer processors FIZ and AH, which flush inputs and change results.
    static constexpr std::uint64_t special_bits = (1ull << 24) | (3ull << 22) | 3ull;
    std::uint64_t saved_ = 0;

public:
    [[nodiscard]] static bool is_plain() { return false; }
#else
    FloatEnvironment() = default;
    [[nodiscard]] static bool is_plain() { return true; }
#endif
};

}  // namespace raydix
