// Memory that ends, or begins, where a page begins that nobody may touch: a single byte read or
// written outside ends the program.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <new>

namespace raydix::test {

class GuardedMemory {
public:
    /// All of it is filled with `garbage`. The guarded side is exact where `bytes` is a multiple of
    /// the alignment that the user needs; `slack` lies on the other side, to the end of its page.
    enum class Exact { begin, end };

    GuardedMemory(std::size_t bytes, std::byte garbage, Exact side)
        : bytes_(bytes),
          page_(static_cast<std::size_t>(sysconf(_SC_PAGESIZE))),
          used_((bytes + page_ - 1) / page_ * page_),
          begin_(mapped(used_ + 2 * page_) + page_),
          start_(side == Exact::begin ? begin_ : begin_ + used_ - bytes),
          garbage_(garbage) {
        if (used_ != 0 && mprotect(begin_, used_, PROT_READ | PROT_WRITE) != 0)
            throw std::bad_alloc();
        std::fill_n(begin_, used_, garbage);
    }
    GuardedMemory(const GuardedMemory&) = delete;
    GuardedMemory& operator=(const GuardedMemory&) = delete;
    ~GuardedMemory() { munmap(begin_ - page_, used_ + 2 * page_); }

    [[nodiscard]] std::byte* data() const { return start_; }
    [[nodiscard]] std::size_t size() const { return bytes_; }
    /// Whether nobody wrote between the memory and its page's other end.
    [[nodiscard]] bool slack_untouched() const {
        const auto untouched = [this](std::byte b) { return b == garbage_; };
        return std::all_of(begin_, start_, untouched) &&
               std::all_of(start_ + bytes_, begin_ + used_, untouched);
    }

private:
    static std::byte* mapped(std::size_t bytes) {
        void* at = mmap(nullptr, bytes, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (at == MAP_FAILED) throw std::bad_alloc();
        return static_cast<std::byte*>(at);
    }

    std::size_t bytes_, page_, used_;
    std::byte* begin_;  // of the pages that may be touched
    std::byte* start_;
    std::byte garbage_;
};

}  // namespace raydix::test
