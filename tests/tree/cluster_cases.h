// What the cluster builders' tests share: inputs that tree builders get wrong.
#pragma once

#include <raydix/bvh.h>

#include <limits>
#include <string>
#include <vector>

#include "support/support.h"

namespace raydix::test {

struct BoxInput {
    std::string name;
    std::vector<Aabb> boxes;
};

inline std::vector<BoxInput> cluster_inputs(std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    const auto boxes = [](std::size_t n, const auto& make) {
        std::vector<Aabb> all;
        for (std::size_t i = 0; i < n; ++i) all.push_back(make(i));
        return all;
    };
    const auto around = [&](Vec3 p, float size) {
        return Aabb{p, {p.x + size * unit(), p.y + size * unit(), p.z + size * unit()}};
    };
    const auto in_cube = [&](std::size_t) { return around({unit(), unit(), unit()}, 0.05f); };
    const float nan = std::numeric_limits<float>::quiet_NaN();
    std::vector<BoxInput> inputs{{"none", {}}};
    // Around the sizes of a warp's list and of a block of the search.
    for (const std::size_t n : {1, 2, 3, 4, 5, 16, 17, 31, 32, 33, 63, 100, 511, 512, 513, 1500})
        inputs.push_back({"random " + std::to_string(n), boxes(n, in_cube)});
    inputs.push_back({"equal points", boxes(2000, [](std::size_t) {
                          return Aabb{{1, 2, 3}, {1, 2, 3}};
                      })});
    inputs.push_back({"equal boxes", boxes(777, [](std::size_t) {
                          return Aabb{{1, 2, 3}, {2, 3, 4}};
                      })});
    inputs.push_back({"lattice", boxes(4096, [](std::size_t i) {
                          const auto x = static_cast<float>(i % 16),
                                     y = static_cast<float>(i / 16 % 16),
                                     z = static_cast<float>(i / 256);
                          return Aabb{{x, y, z}, {x + 1, y + 1, z + 1}};
                      })});
    inputs.push_back({"growing gaps", boxes(3000, [](std::size_t i) {
                          const auto k = static_cast<float>(i);
                          const float x = k + 1e-4f * k * k;
                          return Aabb{{x, x, x}, {x, x, x}};
                      })});
    inputs.push_back({"nested", boxes(3000, [](std::size_t i) {
                          const float size = 1 + 1e-3f * static_cast<float>(i);
                          return Aabb{{0, 0, 0}, {size, size, size}};
                      })});
    inputs.push_back({"collinear", boxes(1000, [&](std::size_t) {
                          const float x = unit();
                          return Aabb{{0, x, 0}, {0, x, 0}};
                      })});
    inputs.push_back({"huge", boxes(1000, [&](std::size_t) {
                          const Vec3 p{2e12f * unit() - 1e12f, 1e12f * unit(), -1e12f * unit()};
                          return Aabb{p, p};
                      })});
    inputs.push_back({"tiny", boxes(1000, [&](std::size_t) {
                          const Vec3 p{1e-30f * unit(), 1e-38f * unit(), -1e-44f * unit()};
                          return Aabb{p, p};
                      })});
    inputs.push_back({"some left out", boxes(1200, [&](std::size_t i) {
                          Aabb box = in_cube(i);
                          if (i % 5 == 0) box.lo.y = nan;
                          if (i % 7 == 0) box.hi.x = infinity;
                          if (i % 11 == 0) std::swap(box.lo, box.hi);
                          return box;
                      })});
    inputs.push_back({"all left out", boxes(20, [&](std::size_t) {
                          return Aabb{{nan, 0, 0}, {1, 1, 1}};
                      })});
    return inputs;
}

}  // namespace raydix::test
