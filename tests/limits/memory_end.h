// Memory that ends at a chosen allocation of this program (result_limit_test.cpp).
#pragma once

#include <atomic>

namespace raydix {

/// Lets one allocation fail, on whichever thread: the one that `before` others come before.
class MemoryEnd {
public:
    explicit MemoryEnd(long before) { left_ = before; }
    ~MemoryEnd() { left_ = -1; }
    MemoryEnd(const MemoryEnd&) = delete;
    MemoryEnd& operator=(const MemoryEnd&) = delete;

    static bool is_here() { return left_ >= 0 && left_-- == 0; }

private:
    static inline std::atomic<long> left_ = -1;
};

}  // namespace raydix
