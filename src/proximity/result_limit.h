// Results whose length nobody knows before: they may grow up to a number of bytes, together, over
// all threads. More is an error, never a result that lacks something.
#pragma once

#include <raydix/error.h>

#include <atomic>
#include <cstdint>
#include <string>

#include "exec/result_memory.h"

namespace raydix {

/// A quarter of the memory there is: parts of a result and the whole lie side by side for a while.
inline std::uint64_t usual_result_bytes() { return available_memory() / 4; }

class ResultLimit {
public:
    ResultLimit(const char* what, std::uint64_t max_bytes, std::uint64_t bytes_each)
        : what_(what),
          max_bytes_(max_bytes != 0 ? max_bytes : usual_result_bytes()),
          bytes_each_(bytes_each) {}

    /// So many more; throws InputError if that is too much.
    void add(std::uint64_t count) {
        const std::uint64_t now = count_.fetch_add(count, std::memory_order_relaxed) + count;
        if (now > max_bytes_ / bytes_each_)
            throw InputError(
                std::string(what_) + ": more than " + std::to_string(max_bytes_ / bytes_each_) +
                " results; they do not fit into " + std::to_string(max_bytes_) + " bytes");
    }
    [[nodiscard]] std::uint64_t count() const { return count_.load(std::memory_order_relaxed); }

private:
    const char* what_;
    std::uint64_t max_bytes_, bytes_each_;
    std::atomic<std::uint64_t> count_{0};
};

}  // namespace raydix
