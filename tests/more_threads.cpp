// Test programs may have more threads at work than the machine has cores: where threads meet, more
// of them meet in more ways. Without this, `threads` past the cores would count as the cores.
#if !defined(__SANITIZE_THREAD__) && !defined(RAYDIX_NO_TBB)  // else see parallel_std.cpp

#include <tbb/global_control.h>
#include <tbb/info.h>

#include <algorithm>

namespace {

const tbb::global_control at_least_eight(
    tbb::global_control::max_allowed_parallelism,
    static_cast<std::size_t>(std::max(8, tbb::info::default_concurrency())));

}  // namespace

#endif
