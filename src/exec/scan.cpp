#include "exec/scan.h"

#include "base/probe.h"
#include "exec/parallel.h"

namespace raydix {
namespace {

template <class T>
T scan(std::span<T> values) {
    return detail::scan_blocks<NoProbe>(
        values, [](const char*, std::size_t n, std::size_t block, const auto& body) {
            for_each_block(n, block, body);
        });
}

}  // namespace

std::uint32_t exclusive_scan(std::span<std::uint32_t> values) { return scan(values); }
std::uint64_t exclusive_scan(std::span<std::uint64_t> values) { return scan(values); }

}  // namespace raydix
