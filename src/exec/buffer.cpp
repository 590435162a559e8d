// Memory of the library's arrays: aligned and counted. Large pages are asked for where somebody
// wants them (docs/performance/building.md).
#include <raydix/buffer.h>

#include <cstdlib>
#include <new>

#include "exec/large_pages.h"
#include "exec/memory.h"

namespace raydix {
namespace {

constexpr std::size_t cache_line = 64;

}  // namespace

MemoryCount& memory_count() {
    static MemoryCount count;
    return count;
}

std::shared_ptr<void> allocate_bytes(std::size_t bytes) {
    if (bytes == 0) return nullptr;
    if (bytes > SIZE_MAX - cache_line) throw std::bad_alloc();
    const bool large =
        bytes >= large_page / 2 && bytes <= LargePages::most_bytes && LargePages::wanted();
    const std::size_t unit = large ? large_page : cache_line;
    void* memory = std::aligned_alloc(unit, (bytes + unit - 1) / unit * unit);
    if (!memory) throw std::bad_alloc();
    if (large) prefer_large_pages(memory, (bytes + large_page / 2) / large_page * large_page);
    memory_count().take(bytes);
    // Also called where the pointer itself finds no memory.
    return {memory, [bytes](void* p) {
                memory_count().give_back(bytes);
                std::free(p);
            }};
}

}  // namespace raydix
