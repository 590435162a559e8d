// Points that octrees are tried on: everything from none at all to chains of twenty levels.
#pragma once

#include <raydix/types.h>

#include <cstdint>
#include <string>
#include <vector>

namespace raydix::test {

struct NamedPoints {
    std::string name;
    std::vector<Vec3> points;
};

/// `n`: about how many points in the larger inputs.
std::vector<NamedPoints> octree_inputs(std::size_t n, std::uint64_t seed);

}  // namespace raydix::test
