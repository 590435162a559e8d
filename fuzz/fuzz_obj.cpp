// Any bytes through the OBJ reader.
#include "fuzz_support.h"
#include "scene/formats.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace raydix;
    fuzz::run(data, size, [](ByteSource& in) { fuzz::check_mesh(load_obj(in)); });
    return 0;
}
