// RAYDIX_CHECK(a, <, b): throws with both values in debug and sanitizer builds, nothing in release.
#pragma once

#ifdef RAYDIX_CHECKS
#include <sstream>
#include <stdexcept>

namespace raydix {
template <class A, class B>
[[noreturn]] void check_failed(const char* what, const A& a, const B& b, const char* file,
                               int line) {
    std::ostringstream out;
    out << file << ':' << line << ": check failed: " << what << " with " << a << " and " << b;
    throw std::logic_error(out.str());
}
}  // namespace raydix

#define RAYDIX_CHECK(a, op, b)                                                                 \
    do {                                                                                       \
        const auto& raydix_a = (a);                                                            \
        const auto& raydix_b = (b);                                                            \
        if (!(raydix_a op raydix_b))                                                           \
            ::raydix::check_failed(#a " " #op " " #b, raydix_a, raydix_b, __FILE__, __LINE__); \
    } while (false)
#else
#define RAYDIX_CHECK(a, op, b) static_cast<void>(0)
#endif
