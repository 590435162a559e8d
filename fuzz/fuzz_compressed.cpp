// The first byte picks a packing, the rest is unpacked to its end or to 4 MiB.
#include <vector>

#include "fuzz_support.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace raydix;
    if (size == 0) return 0;
    const auto packing = static_cast<Packing>(data[0] % 4);
    const auto drain = [](ByteSource& in) {
        static std::vector<char> block(std::size_t{1} << 16);
        for (int i = 0; i < 64; ++i)
            if (in.read(block.data(), block.size()) < block.size()) break;
    };
    fuzz::run(data + 1, size - 1, drain, packing);
    return 0;
}
