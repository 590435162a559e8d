// The scalar reference: one ray at a time through the binary tree, on the CPU.
#pragma once

#include <raydix/bvh.h>
#include <raydix/trace.h>

#include <cstdint>
#include <span>

namespace raydix {

/// Work of one ray.
struct RaySteps {
    std::uint32_t node_visits = 0;  // nodes entered, root and leaves included
    std::uint32_t triangle_tests = 0;
};

/// Closest hits with the work of each ray. rays, hits, steps [n].
TraceCounts trace_steps(const Bvh& bvh, std::span<const Ray> rays, std::span<Hit> hits,
                        std::span<RaySteps> steps, int threads);

/// Closest hits that name the position in leaf order instead of the caller's primitive id.
TraceCounts trace_leaf_positions(const Bvh& bvh, std::span<const Ray> rays, std::span<Hit> hits,
                                 int threads);

}  // namespace raydix
