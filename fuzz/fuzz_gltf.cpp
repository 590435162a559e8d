// Any bytes through the glTF reader; every external file holds the same 64 bytes.
#include "fuzz_support.h"
#include "scene/formats.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace raydix;
    static constexpr char external[65] =
        "0123456789ABCDEF0123456789ABCDEF0123456789ABCDEF0123456789ABCDEF";
    const auto open = [](const std::filesystem::path&) {
        return ByteSource::from_memory(std::string_view(external, 64), "external");
    };
    fuzz::run(data, size, [&](ByteSource& in) { fuzz::check_mesh(load_gltf(in, open)); });
    return 0;
}
