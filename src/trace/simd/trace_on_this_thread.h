// Rays of a caller that is a job of its own, such as a tile of a picture.
#pragma once

#include <raydix/wide.h>

#include <cstdint>
#include <span>

namespace raydix {

/// What trace and trace_any answer, on the calling thread, in jobs as large as pay. The caller's
/// floating-point environment must be plain, as in the loops of parallel.h.
void closest_on_this_thread(const WideBvh& tree, std::span<const Ray> rays, std::span<Hit> hits);
void occluded_on_this_thread(const WideBvh& tree, std::span<const Ray> rays,
                             std::span<std::uint8_t> occluded);

}  // namespace raydix
