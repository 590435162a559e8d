// What a kernel is given where it has one argument: a functor, and how often it is called. Written
// on the host, read on the device, which must agree on every byte.
#pragma once

#include <cstdint>

namespace raydix {

/// work(i) for i in [0, n); or, for a kernel of tiles, work(warp, t) for t in [0, n).
template <class Work>
struct EachArguments {
    Work work;
    std::uint32_t n;
};

/// work(i) for i in [0, min(*count, limit)); or, for a kernel of warps, a warp for 32 of them.
template <class Work>
struct CountedArguments {
    Work work;
    const std::uint32_t* count;
    std::uint32_t limit;
};

}  // namespace raydix
