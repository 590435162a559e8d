#include "exec/large_pages.h"

#include <gtest/gtest.h>

#include <cstdint>

namespace raydix {
namespace {

TEST(LargePages, KeepWhatMemoryHolds) {
    for (const std::size_t count : {std::size_t{0}, std::size_t{5}, std::size_t{3} << 20}) {
        Buffer<std::uint32_t> buffer(count);
        prefer_large_pages(buffer);
        for (std::size_t i = 0; i < count; ++i) buffer[i] = static_cast<std::uint32_t>(7 * i);
        prefer_large_pages(buffer);  // no less once it is written
        for (std::size_t i = 0; i < count; ++i)
            ASSERT_EQ(buffer[i], static_cast<std::uint32_t>(7 * i));
        buffer = Buffer<std::uint32_t>(count / 2);  // the memory goes back as any other
    }
}

TEST(LargePages, TakeRangesThatBeginAnywhere) {
    Buffer<char> buffer(std::size_t{9} << 20);
    prefer_large_pages(buffer.data() + 1, buffer.size() - 3);
    for (std::size_t i = 0; i < buffer.size(); i += 4093) buffer[i] = static_cast<char>(i % 101);
    for (std::size_t i = 0; i < buffer.size(); i += 4093)
        ASSERT_EQ(buffer[i], static_cast<char>(i % 101));
    prefer_large_pages(nullptr, 0);
}

}  // namespace
}  // namespace raydix
