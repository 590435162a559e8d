// The exact sign of a difference of two products of doubles.
#pragma once

#include <cmath>
#include <limits>

#include "base/hd.h"

namespace raydix {

/// x * y = product + error exactly, for x and y in (-1, 1) and not below 1/2 in magnitude: nothing
/// can overflow or underflow. FMA gives the error in one step (Ogita, Rump, Oishi, "Accurate sum
/// and dot product", 2005, algorithm 3.5).
struct TwoProduct {
    double product, error;
};
RAYDIX_HD inline TwoProduct two_product(double x, double y) {
    const double product = x * y;
    return {product, std::fma(x, y, -product)};
}

/// a * b - c * d where both products round to the same double. What rounding took from them
/// decides: rounding is monotone, so nothing else can. Mantissas and exponents apart, so that tiny
/// products keep their digits.
RAYDIX_HD inline double lost_difference(double a, double b, double c, double d) {
    int ea, eb, ec, ed;
    const TwoProduct ab = two_product(std::frexp(a, &ea), std::frexp(b, &eb));
    const TwoProduct cd = two_product(std::frexp(c, &ec), std::frexp(d, &ed));
    const int from = ec + ed, shift = ea + eb - from;
    double difference;
    if (ab.product == 0.0 || cd.product == 0.0 || shift < -2 || shift > 2) {
        // Only products that underflow can be so far apart, and still be equal once rounded.
        if (ab.product == 0.0 && cd.product == 0.0) return 0.0;
        const bool second = ab.product == 0.0 || (cd.product != 0.0 && shift < 0);
        difference = second ? -cd.product : ab.product;
        return std::copysign(std::numeric_limits<double>::denorm_min(), difference);
    }
    difference =
        (std::ldexp(ab.product, shift) - cd.product) + (std::ldexp(ab.error, shift) - cd.error);
    const double value = std::ldexp(difference, from);
    return value != 0.0 || difference == 0.0
               ? value
               : std::copysign(std::numeric_limits<double>::denorm_min(), difference);
}

/// a * b - c * d with an exact sign, for all finite doubles whose products do not overflow:
/// 0 only if the products are equal. product_difference(a, b, c, d) is
/// -product_difference(c, d, a, b) to the last bit.
RAYDIX_HD inline double product_difference(double a, double b, double c, double d) {
    const double difference = a * b - c * d;
    return difference != 0.0 ? difference : lost_difference(a, b, c, d) + 0.0;
}

/// a * b - c * d to a few roundings of its own value, however much cancels; its sign is that of
/// product_difference, or it is 0.
RAYDIX_HD inline double accurate_product_difference(double a, double b, double c, double d) {
    const double ab = a * b, cd = c * d;
    if (ab == cd) return lost_difference(a, b, c, d) + 0.0;
    return (ab - cd) + (std::fma(a, b, -ab) - std::fma(c, d, -cd));
}

}  // namespace raydix
