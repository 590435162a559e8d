// Full denormals inside the library, whatever the caller's thread was set to.
#pragma once

#if defined(__x86_64__) || defined(_M_X64)
#include <xmmintrin.h>
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
#else
    FloatEnvironment() = default;
#endif
};

}  // namespace raydix
