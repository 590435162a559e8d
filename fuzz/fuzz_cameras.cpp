// Any bytes through the reader of cameras.json.
#include "fuzz_support.h"
#include "scene/formats.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace raydix;
    fuzz::run(data, size, [](ByteSource& in) {
        for (const Camera& camera : read_cameras(in).cameras)
            fuzz::require(camera.vfov > 0 && camera.vfov < 180);
    });
    return 0;
}
