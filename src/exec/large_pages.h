// Pages for memory that is read all over the place.
#pragma once

#include <raydix/buffer.h>

#include <cstddef>

namespace raydix {

/// Asks the system to keep `bytes` at `memory` in large pages where it can: call it before they are
/// first written. Reads that go anywhere then find their pages faster. Does nothing below 4 MiB,
/// and where there is no such thing.
void prefer_large_pages(void* memory, std::size_t bytes);

template <class T>
void prefer_large_pages(Buffer<T>& buffer) {
    prefer_large_pages(buffer.data(), buffer.capacity_bytes());
}

}  // namespace raydix
