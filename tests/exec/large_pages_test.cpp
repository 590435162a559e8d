#include "exec/large_pages.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <thread>

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

TEST(LargePages, AreWantedByTheThreadThatSaysSo) {
    EXPECT_FALSE(LargePages::wanted());
    {
        const LargePages outer;
        { const LargePages inner; }
        EXPECT_TRUE(LargePages::wanted());
        std::thread([] { EXPECT_FALSE(LargePages::wanted()); }).join();
        for (const std::size_t bytes : {large_page / 2 - 1, large_page / 2, 3 * large_page + 5}) {
            Buffer<char> buffer(bytes);
            const auto place = reinterpret_cast<std::uintptr_t>(buffer.data());
            EXPECT_EQ(place % (bytes < large_page / 2 ? 64 : large_page), 0) << bytes;
            std::fill_n(buffer.data(), bytes, 'x');  // to the last byte
            EXPECT_EQ(std::count(buffer.data(), buffer.data() + bytes, 'x'), bytes);
        }
    }
    EXPECT_FALSE(LargePages::wanted());
}

}  // namespace
}  // namespace raydix
