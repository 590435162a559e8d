// Any bytes through the .npy readers: points, then rays.
#include "fuzz_support.h"
#include "scene/formats.h"
#include "scene/npy.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace raydix;
    fuzz::run(data, size, [](ByteSource& in) { fuzz::check_mesh(load_npy_points(in)); });
    fuzz::run(data, size,
              [](ByteSource& in) { fuzz::require(read_npy_rows(in, 8).size() % 8 == 0); });
    return 0;
}
