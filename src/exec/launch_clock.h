// The two clocks that launches are timed with.
#pragma once

namespace raydix {

/// Processor time of the calling thread.
[[nodiscard]] double thread_time_ms();
/// Time on the wall, from some moment on.
[[nodiscard]] double wall_time_ms();

}  // namespace raydix
