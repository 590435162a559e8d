// Body of a binary PLY file, either byte order -> vertices and triangles. Records of float x y z
// and faces of `uchar 3 + int32` take short loops over the buffered block, all else goes property
// by property.
#include <algorithm>
#include <bit>
#include <cstring>

#include "scene/ply.h"

namespace raydix {
namespace {

template <class T>
T load(const char* bytes, bool swapped) {
    std::array<char, sizeof(T)> raw;
    std::memcpy(raw.data(), bytes, sizeof(T));
    if (swapped) std::reverse(raw.begin(), raw.end());
    return std::bit_cast<T>(raw);
}

/// Calls use(value) with the value in its own type.
template <class Use>
auto with_value(const char* bytes, PlyType type, bool swapped, Use use) {
    switch (type) {
        case PlyType::i8:
            return use(load<std::int8_t>(bytes, swapped));
        case PlyType::u8:
            return use(load<std::uint8_t>(bytes, swapped));
        case PlyType::i16:
            return use(load<std::int16_t>(bytes, swapped));
        case PlyType::u16:
            return use(load<std::uint16_t>(bytes, swapped));
        case PlyType::i32:
            return use(load<std::int32_t>(bytes, swapped));
        case PlyType::u32:
            return use(load<std::uint32_t>(bytes, swapped));
        case PlyType::f32:
            return use(load<float>(bytes, swapped));
        case PlyType::f64:
            break;
    }
    return use(load<double>(bytes, swapped));
}

class BinaryRecords {
public:
    BinaryRecords(ByteSource& in, bool swapped, const PlyPart& part, std::uint64_t vertex_count,
                  Mesh& mesh)
        : in_(in),
          swapped_(swapped),
          part_(part),
          element_(*part.element),
          vertex_count_(vertex_count),
          mesh_(mesh) {}

    void read_all() {
        const std::size_t record = element_.record_bytes();
        if (element_.properties.empty()) return;
        if (part_.role == PlyRole::none && record != 0) return skip_fixed(record);
        if (part_.role == PlyRole::vertices && record != 0) return read_fixed_vertices(record);
        if (part_.role == PlyRole::vertices) reserve_for(in_, mesh_.vertices, element_.count, 12);
        if (part_.role == PlyRole::faces)
            reserve_for(in_, mesh_.triangles, element_.count, smallest_face());
        const bool plain = has_plain_triangles();
        while (done_ < element_.count) {
            if (plain) read_plain_triangles();
            if (done_ < element_.count) read_record();
        }
    }

private:
    static constexpr std::size_t plain_bytes = 13;  // uchar 3, three int32

    [[nodiscard]] const PlyProperty& index_property() const {
        return element_.properties[static_cast<std::size_t>(part_.index_list)];
    }
    [[nodiscard]] std::size_t smallest_face() const {
        return byte_size(index_property().count_type) + 3 * byte_size(index_property().type);
    }

    [[nodiscard]] bool has_plain_triangles() const {
        if (part_.role != PlyRole::faces || element_.properties.size() != 1 || swapped_)
            return false;
        const PlyProperty& list = index_property();
        return byte_size(list.count_type) == 1 &&
               (list.type == PlyType::i32 || list.type == PlyType::u32);
    }

    /// Takes triangles as long as they are in the buffer, have three corners and good indices.
    void read_plain_triangles() {
        if (!in_.fill(plain_bytes)) return;
        const std::uint64_t limit =
            index_property().type == PlyType::i32 ? std::uint64_t{1} << 31 : std::uint64_t{1} << 32;
        const std::uint64_t valid = std::min(vertex_count_, limit);
        const std::string_view block = in_.buffered();
        const auto most = static_cast<std::size_t>(
            std::min<std::uint64_t>(element_.count - done_, block.size() / plain_bytes));
        const std::size_t old = mesh_.triangles.size();
        check_mesh_size(in_, 0, old + most);
        mesh_.triangles.resize(old + most);
        std::size_t taken = 0;
        for (const char* record = block.data(); taken < most && *record == 3;
             ++taken, record += plain_bytes) {
            Triangle triangle;
            std::memcpy(triangle.data(), record + 1, sizeof(triangle));
            if (std::max({triangle[0], triangle[1], triangle[2]}) >= valid) break;
            mesh_.triangles[old + taken] = triangle;
        }
        mesh_.triangles.resize(old + taken);
        in_.consume(taken * plain_bytes);
        done_ += taken;
    }

    void read_fixed_vertices(std::size_t record) {
        reserve_for(in_, mesh_.vertices, element_.count, record);
        while (done_ < element_.count) {
            if (!in_.fill(record)) fail_at_end(in_, element_, done_ + 1);
            const std::string_view block = in_.buffered();
            const auto n = static_cast<std::size_t>(
                std::min<std::uint64_t>(element_.count - done_, block.size() / record));
            const std::size_t old = mesh_.vertices.size();
            check_mesh_size(in_, old + n, 0);
            mesh_.vertices.resize(old + n);
            convert_vertices(block.data(), record, {mesh_.vertices.data() + old, n});
            in_.consume(n * record);
            done_ += n;
        }
    }

    void convert_vertices(const char* records, std::size_t record, std::span<Vec3> out) const {
        std::array<std::size_t, 3> offset{};
        std::array<PlyType, 3> type{};
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const auto property = static_cast<std::size_t>(part_.position[axis]);
            for (std::size_t i = 0; i < property; ++i)
                offset[axis] += byte_size(element_.properties[i].type);
            type[axis] = element_.properties[property].type;
        }
        const bool plain =
            !swapped_ && type == std::array{PlyType::f32, PlyType::f32, PlyType::f32};
        for (std::size_t i = 0; i < out.size(); ++i, records += record) {
            std::array<float, 3> xyz;
            for (std::size_t axis = 0; axis < 3; ++axis) {
                const char* at = records + offset[axis];
                xyz[axis] = plain ? load<float>(at, false) : scalar(at, type[axis]);
            }
            out[i] = without_negative_zero(Vec3{xyz[0], xyz[1], xyz[2]});
        }
    }

    void skip_fixed(std::size_t record) {
        const bool overflows = element_.count > UINT64_MAX / record;
        if (overflows || !in_.skip(element_.count * record))
            in_.fail(element_.name, fmt::format("file ends before all {} of them", element_.count));
    }

    void read_record() {
        std::array<float, 3> xyz{};
        PlyIndexSink sink(in_, mesh_, part_, done_ + 1, vertex_count_);
        for (std::size_t i = 0; i < element_.properties.size(); ++i) {
            const PlyProperty& property = element_.properties[i];
            if (property.is_list) {
                read_list(property, static_cast<int>(i) == part_.index_list ? &sink : nullptr);
                continue;
            }
            const float value = scalar(need(byte_size(property.type)), property.type);
            in_.consume(byte_size(property.type));
            for (std::size_t axis = 0; axis < 3; ++axis)
                if (part_.position[axis] == static_cast<int>(i)) xyz[axis] = value;
        }
        if (part_.role == PlyRole::vertices) add_vertex(in_, mesh_, {xyz[0], xyz[1], xyz[2]});
        ++done_;
    }

    void read_list(const PlyProperty& property, PlyIndexSink* sink) {
        const std::int64_t length =
            integer(need(byte_size(property.count_type)), property.count_type);
        in_.consume(byte_size(property.count_type));
        if (length < 0)
            in_.fail(fmt::format("{} {}", element_.name, done_ + 1),
                     fmt::format("a list of {} items", length));
        const std::size_t size = byte_size(property.type);
        if (!sink) {
            if (!in_.skip(static_cast<std::uint64_t>(length) * size))
                fail_at_end(in_, element_, done_ + 1);
            return;
        }
        for (std::int64_t k = 0; k < length; ++k) {
            sink->add(integer(need(size), property.type));
            in_.consume(size);
        }
    }

    const char* need(std::size_t bytes) {
        if (!in_.fill(bytes)) fail_at_end(in_, element_, done_ + 1);
        return in_.buffered().data();
    }

    [[nodiscard]] float scalar(const char* bytes, PlyType type) const {
        return with_value(bytes, type, swapped_,
                          [](auto value) { return static_cast<float>(value); });
    }

    /// Indices stored as floating point count if they are whole numbers; otherwise no index is -2.
    [[nodiscard]] std::int64_t integer(const char* bytes, PlyType type) const {
        return with_value(bytes, type, swapped_, [](auto value) {
            if constexpr (std::is_floating_point_v<decltype(value)>) {
                const auto real = static_cast<double>(value);
                const bool whole = real >= -1.0 && real <= 4294967296.0 &&
                                   real == static_cast<double>(static_cast<std::int64_t>(real));
                return whole ? static_cast<std::int64_t>(real) : std::int64_t{-2};
            } else {
                return static_cast<std::int64_t>(value);
            }
        });
    }

    ByteSource& in_;
    bool swapped_;
    const PlyPart& part_;
    const PlyElement& element_;
    std::uint64_t vertex_count_;
    Mesh& mesh_;
    std::uint64_t done_ = 0;
};

}  // namespace

void read_binary_part(ByteSource& in, PlyFormat format, const PlyPart& part,
                      std::uint64_t vertex_count, Mesh& mesh) {
    const bool swapped =
        (format == PlyFormat::little_endian) != (std::endian::native == std::endian::little);
    BinaryRecords(in, swapped, part, vertex_count, mesh).read_all();
}

}  // namespace raydix
