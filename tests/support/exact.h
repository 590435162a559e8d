// Exact arithmetic to judge scenes in double with. Apart, because its headers take seconds to
// compile.
#pragma once

#include <raydix/types.h>

#include <boost/multiprecision/cpp_int.hpp>

namespace raydix::test {

using Exact = boost::multiprecision::cpp_rational;

struct ExactPoint {
    Exact x, y, z;
};
ExactPoint exact(Vec3d p);
ExactPoint operator-(const ExactPoint& a, const ExactPoint& b);
Exact dot(const ExactPoint& a, const ExactPoint& b);
ExactPoint cross(const ExactPoint& a, const ExactPoint& b);

}  // namespace raydix::test
