// Seeded random numbers of tests: the same on every machine.
#pragma once

#include <raydix/types.h>

#include <cstddef>
#include <cstdint>
#include <random>

namespace raydix::test {

class Random {
public:
    explicit Random(std::uint64_t start) : engine_(start) {}
    float unit() { return static_cast<float>(engine_() >> 40) * 0x1p-24f; }
    float between(float lo, float hi) { return lo + (hi - lo) * unit(); }
    std::size_t below(std::size_t n) { return engine_() % n; }
    Vec3 in(float lo, float hi) { return {between(lo, hi), between(lo, hi), between(lo, hi)}; }
    Vec3 in(const Aabb& box) {
        return {between(box.lo.x, box.hi.x), between(box.lo.y, box.hi.y),
                between(box.lo.z, box.hi.z)};
    }

private:
    std::mt19937_64 engine_;
};

}  // namespace raydix::test
