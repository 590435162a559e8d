// glTF 2.0 container, buffers and accessors, every offset checked before it is used.
#include "scene/gltf_document.h"

#include <fmt/format.h>

#include <array>
#include <cstring>

#include "base/math.h"
#include "scene/input_error.h"
#include "scene/json_input.h"

namespace raydix {

using nlohmann::json;

namespace {

constexpr std::uint64_t type_u8 = 5121, type_u16 = 5123, type_u32 = 5125, type_f32 = 5126;

std::uint32_t load_u32(const char* bytes) {
    std::uint32_t value = 0;
    for (unsigned i = 0; i < 4; ++i)
        value |= std::uint32_t{static_cast<unsigned char>(bytes[i])} << (8 * i);
    return value;
}

std::uint64_t component_bytes(std::uint64_t component_type) {
    switch (component_type) {
        case type_u8:
            return 1;
        case type_u16:
            return 2;
        case type_u32:
        case type_f32:
            return 4;
        default:
            return 0;
    }
}

/// Value of a base64 digit, -1 for any other character.
int base64_digit(char c) {
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    return c == '+' ? 62 : c == '/' ? 63 : -1;
}

int hex_digit(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

/// %20 -> blank. What is no escape stays.
std::string percent_decoded(std::string_view uri) {
    std::string text;
    for (std::size_t i = 0; i < uri.size(); ++i) {
        const bool escape = uri[i] == '%' && i + 2 < uri.size() && hex_digit(uri[i + 1]) >= 0 &&
                            hex_digit(uri[i + 2]) >= 0;
        text +=
            escape ? static_cast<char>(hex_digit(uri[i + 1]) * 16 + hex_digit(uri[i + 2])) : uri[i];
        if (escape) i += 2;
    }
    return text;
}

/// Files beside the document or below it.
bool stays_below(const std::filesystem::path& path) {
    if (path.empty() || path.is_absolute() || path.native().find(':') != std::string::npos)
        return false;
    if (path.native().find('\0') != std::string::npos) return false;
    return std::find(path.begin(), path.end(), "..") == path.end();
}

}  // namespace

GltfDocument::GltfDocument(ByteSource& in, const OpenExternal& open_external)
    : in_(in), open_external_(open_external) {
    read_root(read_container());
    bytes_ = text_.size() + binary_chunk_.size();
}

/// The JSON text: the whole file, or the first chunk of a .glb whose second is the binary one.
std::string_view GltfDocument::read_container() {
    constexpr std::uint32_t json_chunk = 0x4E4F534A, binary_chunk = 0x004E4942;
    in_.fill(12);
    if (!in_.buffered().starts_with("glTF")) return text_ = read_rest(in_, UINT64_MAX);
    const std::string head = read_exactly(in_, 12, "header");
    if (load_u32(head.data() + 4) != 2)
        in_.fail("header", fmt::format("glTF version {}; 2 is needed", load_u32(head.data() + 4)));
    const std::uint64_t total = load_u32(head.data() + 8);
    std::uint64_t used = head.size();
    for (bool first = true; used < total; first = false) {
        const std::string chunk_head = read_exactly(in_, 8, "chunk header");
        const std::uint64_t length = load_u32(chunk_head.data());
        const std::uint32_t type = load_u32(chunk_head.data() + 4);
        used += chunk_head.size() + length;
        if (used > total) in_.fail("chunk", "longer than the file claims to be");
        if (first != (type == json_chunk))
            in_.fail("chunk", "the first one and only that must be JSON");
        if (first)
            text_ = read_exactly(in_, length, "JSON chunk");
        else if (type == binary_chunk && binary_chunk_.empty())
            binary_chunk_ = read_exactly(in_, length, "binary chunk");
        else if (!in_.skip(length))
            in_.fail("chunk", "file ends inside it");
    }
    return text_;
}

void GltfDocument::read_root(std::string_view text) {
    if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
    root_ = parse_json(in_, text);
    if (!root_.is_object()) in_.fail("JSON", "not an object");
    const auto required = root_.find("extensionsRequired");
    if (required == root_.end() || !required->is_array()) return;
    for (const char* packed :
         {"KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_mesh_quantization"})
        for (const json& extension : *required)
            if (extension == packed)
                in_.fail("extensionsRequired", fmt::format("{} is not read", packed));
}

const json& GltfDocument::item(const char* list, std::uint64_t index) const {
    if (index >= list_size(list))
        fail(list, index, fmt::format("there are only {}", list_size(list)));
    const json& entry = root_[list][static_cast<std::size_t>(index)];
    if (!entry.is_object()) fail(list, index, "not an object");
    return entry;
}

std::uint64_t GltfDocument::list_size(const char* list) const {
    const auto found = root_.find(list);
    return found != root_.end() && found->is_array() ? found->size() : 0;
}

void GltfDocument::fail(const char* list, std::uint64_t index, std::string_view reason) const {
    in_.fail(fmt::format("{} {}", list, index), reason);
}

std::uint64_t GltfDocument::whole(const char* list, std::uint64_t index, const char* key) const {
    const auto value = find_whole(in_, item(list, index), key, fmt::format("{} {}", list, index));
    if (!value) fail(list, index, fmt::format("{} is missing", key));
    return *value;
}

std::uint64_t GltfDocument::whole(const char* list, std::uint64_t index, const char* key,
                                  std::uint64_t fallback) const {
    return find_whole(in_, item(list, index), key, fmt::format("{} {}", list, index))
        .value_or(fallback);
}

std::vector<Vec3> GltfDocument::positions(std::uint64_t accessor) {
    const Elements all = elements(accessor, "VEC3", 3);
    if (all.component_type != type_f32) fail("accessors", accessor, "positions must be float");
    std::vector<Vec3> points(static_cast<std::size_t>(all.count));
    const char* at = all.first;
    for (Vec3& point : points) {
        point = {std::bit_cast<float>(load_u32(at)), std::bit_cast<float>(load_u32(at + 4)),
                 std::bit_cast<float>(load_u32(at + 8))};
        at += all.stride;
    }
    return points;
}

std::vector<std::uint32_t> GltfDocument::indices(std::uint64_t accessor) {
    const Elements all = elements(accessor, "SCALAR", 1);
    if (all.component_type == type_f32) fail("accessors", accessor, "indices must be integers");
    const std::uint64_t size = component_bytes(all.component_type);
    std::vector<std::uint32_t> values(static_cast<std::size_t>(all.count));
    const char* at = all.first;
    for (std::uint32_t& value : values) {
        for (unsigned i = 0; i < size; ++i)
            value |= std::uint32_t{static_cast<unsigned char>(at[i])} << (8 * i);
        at += all.stride;
    }
    return values;
}

GltfDocument::Elements GltfDocument::elements(std::uint64_t accessor, const char* type,
                                              std::uint64_t components) {
    const json& entry = item("accessors", accessor);
    if (entry.contains("sparse")) fail("accessors", accessor, "sparse accessors are not read");
    if (!entry.contains("bufferView")) fail("accessors", accessor, "has no bufferView");
    const auto named = entry.find("type");
    if (named == entry.end() || *named != type)
        fail("accessors", accessor, fmt::format("its type is not {}", type));
    Elements all;
    all.count = whole("accessors", accessor, "count");
    all.component_type = whole("accessors", accessor, "componentType");
    const std::uint64_t size = components * component_bytes(all.component_type);
    if (size == 0)
        fail("accessors", accessor,
             fmt::format("componentType {} is not read", all.component_type));
    const std::uint64_t view = whole("accessors", accessor, "bufferView");
    const std::string_view bytes = view_bytes(view);
    const std::uint64_t offset = whole("accessors", accessor, "byteOffset", 0);
    all.stride = whole("bufferViews", view, "byteStride", size);
    if (all.stride < size)
        fail("bufferViews", view,
             fmt::format("byteStride is less than the {} bytes of an element", size));
    const std::uint64_t room = offset <= bytes.size() ? bytes.size() - offset : 0;
    if (all.count > 0 && (room < size || all.count - 1 > (room - size) / all.stride))
        fail("accessors", accessor,
             fmt::format("{} elements do not fit into its bufferView", all.count));
    if (all.count > 0) all.first = bytes.data() + offset;
    return all;
}

std::string_view GltfDocument::view_bytes(std::uint64_t view) {
    const std::string_view buffer = buffer_bytes(whole("bufferViews", view, "buffer"));
    const std::uint64_t offset = whole("bufferViews", view, "byteOffset", 0);
    const std::uint64_t length = whole("bufferViews", view, "byteLength");
    if (offset > buffer.size() || length > buffer.size() - offset)
        fail("bufferViews", view, "reaches beyond the end of its buffer");
    return buffer.substr(static_cast<std::size_t>(offset), static_cast<std::size_t>(length));
}

std::string_view GltfDocument::buffer_bytes(std::uint64_t buffer) {
    const std::uint64_t length = whole("buffers", buffer, "byteLength");
    const json& entry = item("buffers", buffer);
    const auto uri = entry.find("uri");
    const std::string* bytes = &binary_chunk_;
    if (uri != entry.end()) {
        if (!uri->is_string()) fail("buffers", buffer, "uri is not a string");
        const auto& text = uri->get_ref<const std::string&>();
        auto found = loaded_.find(text);
        if (found == loaded_.end()) {
            const std::size_t comma = text.find(";base64,");
            const bool embedded = text.starts_with("data:");
            if (embedded && comma == std::string::npos)
                fail("buffers", buffer, "its data is not base64");
            std::string loaded =
                embedded ? decode_base64(buffer, std::string_view(text).substr(comma + 8))
                         : load_external(buffer, text);
            bytes_ += loaded.size();
            found = loaded_.emplace(text, std::move(loaded)).first;
        }
        bytes = &found->second;
    } else if (buffer != 0) {
        fail("buffers", buffer, "has no uri");
    }
    if (bytes->size() < length)
        fail("buffers", buffer, fmt::format("holds {} of {} bytes", bytes->size(), length));
    return std::string_view(*bytes).substr(0, static_cast<std::size_t>(length));
}

std::vector<std::filesystem::path> GltfDocument::external_files() const {
    std::vector<std::filesystem::path> files;
    for (std::uint64_t i = 0; i < list_size("buffers"); ++i) {
        const json& entry = item("buffers", i);
        const auto uri = entry.find("uri");
        if (uri == entry.end() || !uri->is_string()) continue;
        const auto& text = uri->get_ref<const std::string&>();
        if (!text.starts_with("data:")) files.emplace_back(percent_decoded(text));
    }
    return files;
}

std::string GltfDocument::decode_base64(std::uint64_t buffer, std::string_view text) const {
    while (text.ends_with('=')) text.remove_suffix(1);
    std::string bytes;
    bytes.reserve(text.size() / 4 * 3 + 3);
    std::uint32_t bits = 0;
    unsigned held = 0;  // bits not yet written
    for (const char c : text) {
        const int digit = base64_digit(c);
        if (digit < 0) fail("buffers", buffer, "its data is not base64");
        bits = (bits << 6 | static_cast<std::uint32_t>(digit)) & 0xFFFFu;
        held += 6;
        if (held < 8) continue;
        held -= 8;
        bytes += static_cast<char>(bits >> held & 0xFFu);
    }
    return bytes;
}

std::string GltfDocument::load_external(std::uint64_t buffer, std::string_view uri) const {
    const std::filesystem::path path = percent_decoded(uri);
    if (!stays_below(path))
        fail("buffers", buffer,
             fmt::format("{} is not a file beside this one or below", in_quotes(uri)));
    ByteSource file = open_external_(path);
    return read_rest(file, UINT64_MAX);
}

}  // namespace raydix
