// Whether a device computes as the host does: division and square root of floats, both rounded
// correctly, products and sums that are not fused, denormals kept. Trees and hits would differ
// otherwise, so a device is asked before it is used.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>

#include "base/hd.h"

namespace raydix {

inline constexpr std::uint32_t arithmetic_cases = 16384;

/// Operands of case i: floats of all sizes and signs, a quarter of them denormal.
struct ArithmeticCase {
    float a, b, c;

    RAYDIX_HD explicit ArithmeticCase(std::uint32_t i)
        : a(number(3 * i)), b(number(3 * i + 1)), c(number(3 * i + 2)) {}

private:
    RAYDIX_HD static float number(std::uint32_t k) {
        std::uint32_t bits = k * 2654435761u + 0x9E3779B9u;
        bits = (bits ^ bits >> 15) * 2246822519u;
        bits = (bits ^ bits >> 13) * 3266489917u;
        bits ^= bits >> 16;
        if ((bits & 3u) == 0)
            bits &= 0x807FFFFFu;  // denormal
        else if ((bits & 3u) == 1)
            bits = (bits & 0x83FFFFFFu) | 0x3C000000u;                 // near 1
        if ((bits & 0x7F800000u) == 0x7F800000u) bits &= 0xBFFFFFFFu;  // finite
        float value;
        std::memcpy(&value, &bits, sizeof(value));
        return value;
    }
};

struct ArithmeticResults {
    float quotient, root, product_and_sum, sum;
    double quotient_of_doubles, root_of_double;
};

RAYDIX_HD inline ArithmeticResults compute_case(std::uint32_t i) {
    const ArithmeticCase c(i);
    const float size = c.a < 0 ? -c.a : c.a;
    const double wide = static_cast<double>(size) + 1e-3 * static_cast<double>(c.b);
    ArithmeticResults r;
    r.quotient = c.b != 0 ? c.a / c.b : 0.0f;
    r.root = std::sqrt(size);
    const float product = c.a * c.b;
    r.product_and_sum = product + c.c;
    r.sum = c.a + c.c;
    r.quotient_of_doubles = c.b != 0 ? wide / static_cast<double>(c.b) : 0.0;
    r.root_of_double = std::sqrt(wide < 0 ? -wide : wide);
    return r;
}

struct ComputeCases {
    ArithmeticResults* results;  // [arithmetic_cases], out
    RAYDIX_HD void operator()(std::uint32_t i) const { results[i] = compute_case(i); }
};

/// "" if the results have the host's bits; else what is wrong, and how often.
[[nodiscard]] std::string first_wrong_case(std::span<const ArithmeticResults> results);

}  // namespace raydix
