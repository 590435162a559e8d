// How much memory a call may take whose result can have any length: the option `max_result_bytes`
// of trace_all, overlapping_pairs, touch_all, radius_search, box_search, neighbour_lists, knn,
// kd_nearest and points_in_boxes. It bounds the peak of the call: the result, the parts that are
// joined to it, and the arrays that the call works with. Stacks and what is as small as they are
// (some ten kilobytes a thread) are not counted. A call that would take more throws ResultTooLarge.
#pragma once

#include <cstdint>

namespace raydix {

/// What `max_result_bytes` = 0 stands for at this moment: half of what is left to the process. On
/// Linux that is the less of two numbers: MemAvailable of the system, and the limit of the control
/// group minus its use without file caches. On other systems it is the physical memory. A call that
/// takes less than 4 MiB does not ask.
[[nodiscard]] std::uint64_t usual_result_bytes();

/// Throws ResultTooLarge if `bytes` are more than `max_result_bytes`, or than half of what is left
/// if that is 0. For callers that join results of several calls.
void require_result_bytes(const char* what, std::uint64_t bytes, std::uint64_t max_result_bytes);

}  // namespace raydix
