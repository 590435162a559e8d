#include "exec/large_pages.h"

#include <utility>

#if defined(__linux__)
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#endif

namespace raydix {
namespace {

thread_local bool large_pages_wanted = false;

}  // namespace

LargePages::LargePages() : before_(std::exchange(large_pages_wanted, true)) {}
LargePages::~LargePages() { large_pages_wanted = before_; }
bool LargePages::wanted() { return large_pages_wanted; }

void prefer_large_pages([[maybe_unused]] void* memory, [[maybe_unused]] std::size_t bytes) {
#if defined(__linux__) && defined(MADV_HUGEPAGE)
    if (bytes < large_page / 2) return;
    static const auto page = static_cast<std::uintptr_t>(::sysconf(_SC_PAGESIZE));
    const auto address = reinterpret_cast<std::uintptr_t>(memory);
    const std::uintptr_t begin = (address + page - 1) / page * page,
                         end = (address + bytes) / page * page;
    // A wish: what comes of it does not matter here.
    static_cast<void>(::madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE));
#endif
}

}  // namespace raydix
