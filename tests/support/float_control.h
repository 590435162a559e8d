// What a caller may have told its thread to do with denormals.
#pragma once

#if defined(__SSE2__)
#include <xmmintrin.h>
#define RAYDIX_FLUSHES_DENORMALS 1
#elif defined(__aarch64__)
#define RAYDIX_FLUSHES_DENORMALS 1
#endif

#include <cstdint>

namespace raydix::test {

#if defined(RAYDIX_FLUSHES_DENORMALS)
/// While it lives, denormals count as zero on this thread.
class FlushedDenormals {
public:
    FlushedDenormals() { set(before_ | bits_); }
    ~FlushedDenormals() { set(before_); }
    FlushedDenormals(const FlushedDenormals&) = delete;
    FlushedDenormals& operator=(const FlushedDenormals&) = delete;
    /// Whether nobody has changed that.
    [[nodiscard]] static bool still() { return (control() & bits_) == bits_; }

private:
#if defined(__SSE2__)
    static constexpr std::uint64_t bits_ = 0x8040;
    static std::uint64_t control() { return _mm_getcsr(); }
    static void set(std::uint64_t bits) { _mm_setcsr(static_cast<unsigned>(bits)); }
#else
    static constexpr std::uint64_t bits_ = 1u << 24;
    static std::uint64_t control() {
        std::uint64_t bits;
        asm volatile("mrs %0, fpcr" : "=r"(bits));
        return bits;
    }
    static void set(std::uint64_t bits) { asm volatile("msr fpcr, %0" : : "r"(bits)); }
#endif
    const std::uint64_t before_ = control();
};
#endif

}  // namespace raydix::test
