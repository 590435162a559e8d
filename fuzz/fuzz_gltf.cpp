// Any bytes through the glTF reader, then as one mesh; every external file holds the same 64 bytes.
#include "fuzz_support.h"
#include "scene/formats.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace raydix;
    static constexpr char external[65] =
        "0123456789ABCDEF0123456789ABCDEF0123456789ABCDEF0123456789ABCDEF";
    const auto open = [](const std::filesystem::path&) {
        return ByteSource::from_memory(std::string_view(external, 64), "external");
    };
    fuzz::run(data, size, [&](ByteSource& in) {
        Model model = load_gltf(in, open);
        for (const Mesh& mesh : model.meshes) fuzz::check_mesh(mesh);
        for (std::size_t k = 0; k < model.nodes.size(); ++k) {
            const ModelNode& node = model.nodes[k];
            if (node.parent != ModelNode::none && node.parent >= k) std::abort();
            if (node.first_mesh + std::uint64_t{node.mesh_count} > model.meshes.size())
                std::abort();
        }
        model.flatten();
        fuzz::check_mesh(model.mesh());
    });
    return 0;
}
