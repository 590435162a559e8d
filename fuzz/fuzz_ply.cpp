// Any bytes through the PLY reader.
#include "fuzz_support.h"
#include "scene/formats.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace raydix;
    fuzz::run(data, size, [](ByteSource& in) { fuzz::check_mesh(load_ply(in)); });
    return 0;
}
