// A .gltf or .glb file: its JSON, its buffers and its accessors as arrays.
#pragma once

#include <raydix/types.h>

#include <map>
#include <nlohmann/json.hpp>
#include <vector>

#include "scene/formats.h"

namespace raydix {

class GltfDocument {
public:
    GltfDocument(ByteSource& in, const OpenExternal& open_external);

    /// Entry `index` of a top-level list, an object. Throws InputError "FILE: nodes 7: ..."
    /// (positions from 0, as in the document) if there is none.
    [[nodiscard]] const nlohmann::json& item(const char* list, std::uint64_t index) const;
    [[nodiscard]] std::uint64_t list_size(const char* list) const;

    /// VEC3 of float.
    [[nodiscard]] std::vector<Vec3> positions(std::uint64_t accessor);
    /// SCALAR of uint8, uint16 or uint32.
    [[nodiscard]] std::vector<std::uint32_t> indices(std::uint64_t accessor);

    /// Of its buffers, relative to it.
    [[nodiscard]] std::vector<std::filesystem::path> external_files() const;

    [[nodiscard]] const nlohmann::json& root() const { return root_; }
    [[nodiscard]] const ByteSource& source() const { return in_; }
    [[nodiscard]] std::uint64_t bytes() const {
        return bytes_;
    }  // of the file and all buffers loaded so far
    [[noreturn]] void fail(const char* list, std::uint64_t index, std::string_view reason) const;

private:
    /// The elements of an accessor: `count` times, `stride` bytes apart.
    struct Elements {
        const char* first = nullptr;
        std::uint64_t count = 0, stride = 0, component_type = 0;
    };

    std::string_view read_container();
    void read_root(std::string_view text);
    [[nodiscard]] Elements elements(std::uint64_t accessor, const char* type,
                                    std::uint64_t components);
    [[nodiscard]] std::string_view view_bytes(std::uint64_t view);
    [[nodiscard]] std::string_view buffer_bytes(std::uint64_t buffer);
    [[nodiscard]] std::string decode_base64(std::uint64_t buffer, std::string_view text) const;
    [[nodiscard]] std::string load_external(std::uint64_t buffer, std::string_view uri) const;
    [[nodiscard]] std::uint64_t whole(const char* list, std::uint64_t index, const char* key) const;
    [[nodiscard]] std::uint64_t whole(const char* list, std::uint64_t index, const char* key,
                                      std::uint64_t fallback) const;

    ByteSource& in_;
    OpenExternal open_external_;
    std::string text_, binary_chunk_;
    nlohmann::json root_;
    std::map<std::string, std::string, std::less<>> loaded_;  // by uri
    std::uint64_t bytes_ = 0;
};

}  // namespace raydix
