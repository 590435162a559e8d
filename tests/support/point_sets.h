// Points that trees of points get wrong: clustered, equal, flat, huge, tiny, few.
#pragma once

#include <raydix/types.h>

#include <cstdint>
#include <string>
#include <vector>

namespace raydix::test {

struct PointSet {
    std::string name;
    std::vector<Vec3> points;
};

/// About `count` points each, and some of 0 to 5; the same for the same seed.
std::vector<PointSet> point_sets(std::size_t count, std::uint64_t seed);

/// Queries at points, between them, around and far from them, and some that are not finite.
std::vector<Vec3> queries_for(const std::vector<Vec3>& points, std::size_t count,
                              std::uint64_t seed);

}  // namespace raydix::test
