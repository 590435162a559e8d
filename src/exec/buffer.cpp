// Memory of the library's arrays: aligned and counted. Huge pages are not asked for: on a virtual
// machine their first touch cost more than they gave back (docs/performance/building.md).
#include <raydix/buffer.h>

#include <cstdlib>
#include <new>

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
    const std::size_t rounded = (bytes + cache_line - 1) / cache_line * cache_line;
    void* memory = std::aligned_alloc(cache_line, rounded);
    if (!memory) throw std::bad_alloc();
    try {
        std::shared_ptr<void> owner(memory, [bytes](void* p) {
            memory_count().give_back(bytes);
            std::free(p);
        });
        memory_count().take(bytes);
        return owner;
    } catch (...) {
        std::free(memory);
        throw;
    }
}

}  // namespace raydix
