// Scratch of launches lies between pages that end the program if they are touched. The kernel says
// so without that: a write from such a page to a pipe fails.
#include "support/guarded_memory.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <string>

namespace raydix::test {
namespace {

class Pipe {
public:
    Pipe() {
        if (pipe(ends_) != 0) throw std::bad_alloc();
    }
    Pipe(const Pipe&) = delete;
    Pipe& operator=(const Pipe&) = delete;
    ~Pipe() {
        close(ends_[0]);
        close(ends_[1]);
    }
    [[nodiscard]] bool can_read(const std::byte* at) const {
        if (write(ends_[1], at, 1) == 1) return true;
        EXPECT_EQ(errno, EFAULT);
        return false;
    }

private:
    int ends_[2] = {};
};

TEST(GuardedMemory, NothingAroundItCanBeRead) {
    const Pipe pipe;
    for (const std::size_t bytes : {0u, 1u, 256u, 4096u, 4352u, 100'000u})
        for (const auto side : {GuardedMemory::Exact::begin, GuardedMemory::Exact::end}) {
            SCOPED_TRACE(std::to_string(bytes) + " bytes");
            const GuardedMemory memory(bytes, std::byte{0xA5}, side);
            std::byte* const begin = memory.data();
            const bool at_end = side == GuardedMemory::Exact::end;
            EXPECT_FALSE(pipe.can_read(at_end ? begin + bytes : begin - 1));
            if (bytes == 0) continue;
            EXPECT_TRUE(pipe.can_read(begin));
            EXPECT_TRUE(pipe.can_read(begin + bytes - 1));
            EXPECT_TRUE(memory.slack_untouched());
            if (bytes % static_cast<std::size_t>(sysconf(_SC_PAGESIZE)) == 0) continue;  // no slack
            (at_end ? begin[-1] : begin[bytes]) = std::byte{0};
            EXPECT_FALSE(memory.slack_untouched());
        }
}

}  // namespace
}  // namespace raydix::test
