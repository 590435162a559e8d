// A small indexed reader with a fault: RAYDIX_PLANTED_BUG leaves out the check of an index.
// A fuzzing run that does not find it is worth nothing; `scripts/fuzz --planted` proves that one
// does.
#include <vector>

#include "fuzz_support.h"
#include "scene/json_input.h"

namespace {

/// "MESH", a number of values, that many bytes, then positions of bytes to add up.
unsigned sum_of_chosen(raydix::ByteSource& in) {
    if (raydix::read_exactly(in, 4, "header") != "MESH") in.fail("header", "not a mesh");
    const auto count = static_cast<unsigned char>(raydix::read_exactly(in, 1, "count")[0]);
    const std::string text = raydix::read_exactly(in, count, "values");
    const std::vector<unsigned char> values(text.begin(), text.end());
    unsigned sum = 0;
    for (const char position : raydix::read_rest(in, 4096)) {
        const std::size_t i = static_cast<unsigned char>(position);
#ifndef RAYDIX_PLANTED_BUG
        if (i >= values.size()) in.fail("position", "past the end");
#endif
        sum += values[i];
    }
    return sum;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace raydix;
    fuzz::run(data, size, [](ByteSource& in) { fuzz::require(sum_of_chosen(in) < 1u << 24); });
    return 0;
}
