// Pages for memory that is read all over the place.
#pragma once

#include <raydix/buffer.h>

#include <cstddef>

namespace raydix {

/// Of most processors, in bytes.
inline constexpr std::size_t large_page = std::size_t{2} << 20;

/// Asks the system to keep `bytes` at `memory` in large pages where it can: call it before they are
/// first written. Reads that go anywhere then find their pages faster. Does nothing for less than
/// half of a large page, and where there is no such thing.
void prefer_large_pages(void* memory, std::size_t bytes);

template <class T>
void prefer_large_pages(Buffer<T>& buffer) {
    prefer_large_pages(buffer.data(), buffer.capacity_bytes());
}

/// While one lives, arrays that its thread allocates, of half a large page to most_bytes, begin at
/// one and ask for all those that are at least half theirs: the first touch of memory then takes a
/// tenth of the page faults.
class LargePages {
public:
    /// A virtual machine may have no memory behind large pages that were not used lately: much at
    /// once can cost more than it saves.
    static constexpr std::size_t most_bytes = 8 * large_page;

    LargePages();
    ~LargePages();
    LargePages(const LargePages&) = delete;
    LargePages& operator=(const LargePages&) = delete;

    [[nodiscard]] static bool wanted();

private:
    const bool before_;
};

}  // namespace raydix
