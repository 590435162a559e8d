// Memory of the library's arrays: aligned, on huge pages where there are any, counted.
#include <raydix/buffer.h>

#include <sys/mman.h>

#include <cstdlib>
#include <new>

#include "exec/memory.h"

namespace raydix {
namespace {

constexpr std::size_t cache_line = 64;
constexpr std::size_t huge_page = std::size_t{2} << 20;

}  // namespace

MemoryCount& memory_count() {
    static MemoryCount count;
    return count;
}

std::shared_ptr<void> allocate_bytes(std::size_t bytes) {
    if (bytes == 0) return nullptr;
    const bool huge = bytes >= huge_page;
    const std::size_t alignment = huge ? huge_page : cache_line;
    if (bytes > SIZE_MAX - alignment) throw std::bad_alloc();
    const std::size_t rounded = (bytes + alignment - 1) / alignment * alignment;
    void* memory = std::aligned_alloc(alignment, rounded);
    if (!memory) throw std::bad_alloc();
#ifdef MADV_HUGEPAGE
    if (huge)
        madvise(memory, rounded, MADV_HUGEPAGE);  // a hint: if it fails, small pages serve as well
#endif
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
