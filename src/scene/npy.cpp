// .npy files <-> float32 rows, hits and index arrays; (N, >= 3) as a point cloud.
#include "scene/npy.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "base/write_file.h"
#include "scene/formats.h"
#include "scene/input_error.h"
#include "scene/mesh_builder.h"

namespace raydix {
namespace {

static_assert(std::endian::native == std::endian::little,
              "arrays are written as they lie in memory");

/// How one number of the file becomes a float.
struct NumberType {
    std::size_t bytes;
    bool swapped;

    [[nodiscard]] float load(const char* at) const {
        std::array<char, 8> raw{};
        std::memcpy(raw.data(), at, bytes);
        if (swapped) std::reverse(raw.begin(), raw.begin() + static_cast<std::ptrdiff_t>(bytes));
        if (bytes == 8) return static_cast<float>(std::bit_cast<double>(raw));
        float value = 0;
        std::memcpy(&value, raw.data(), sizeof(value));
        return value;
    }
};

NumberType number_type(const ByteSource& in, const std::string& type) {
    const bool is_known = type.size() == 3 &&
                          std::string_view("<>=").find(type[0]) != std::string_view::npos &&
                          type[1] == 'f' && (type[2] == '4' || type[2] == '8');
    if (!is_known)
        in.fail("header", type.empty() ? "a structured array; float32 or float64 is needed"
                                       : fmt::format("type {}; float32 or float64 is needed",
                                                     in_quotes(type)));
    return {type[2] == '4' ? std::size_t{4} : std::size_t{8}, type[0] == '>'};
}

/// Reads the body of an (N, columns) array into rows of `keep` values.
class RowReader {
public:
    RowReader(ByteSource& in, const NpyHeader& header, std::size_t keep)
        : in_(in),
          type_(number_type(in, header.type)),
          rows_(header.shape[0]),
          columns_(header.shape[1]),
          keep_(keep) {
        const std::uint64_t expected = in.expected_rest() / (type_.bytes * keep_);
        values_.reserve(static_cast<std::size_t>(std::min(rows_, expected)) * keep_);
    }

    /// Row by row; the columns that are not kept are skipped.
    std::vector<float> read_rows() {
        for (std::uint64_t row = 0; row < rows_; ++row) {
            const char* at = need(type_.bytes * keep_, row);
            for (std::size_t k = 0; k < keep_; ++k)
                values_.push_back(type_.load(at + k * type_.bytes));
            in_.consume(type_.bytes * keep_);
            if (columns_ > keep_ && !in_.skip((columns_ - keep_) * type_.bytes)) fail_at(row);
        }
        return std::move(values_);
    }

    /// Column by column; the array grows with the first one, so a false N costs nothing.
    std::vector<float> read_columns() {
        for (std::size_t k = 0; k < keep_; ++k) {
            for (std::uint64_t row = 0; row < rows_; ++row) {
                const float value = type_.load(need(type_.bytes, row));
                in_.consume(type_.bytes);
                if (k == 0) values_.resize(values_.size() + keep_);
                values_[static_cast<std::size_t>(row) * keep_ + k] = value;
            }
        }
        return std::move(values_);
    }

private:
    const char* need(std::size_t bytes, std::uint64_t row) {
        if (!in_.fill(bytes)) fail_at(row);
        return in_.buffered().data();
    }

    [[noreturn]] void fail_at(std::uint64_t row) const {
        in_.fail(fmt::format("row {}", row + 1),
                 fmt::format("file ends before all {} rows", rows_));
    }

    ByteSource& in_;
    NumberType type_;
    std::uint64_t rows_, columns_;
    std::size_t keep_;
    std::vector<float> values_;
};

std::vector<float> read_body(ByteSource& in, const NpyHeader& header, std::size_t keep) {
    RowReader reader(in, header, keep);
    return header.fortran_order ? reader.read_columns() : reader.read_rows();
}

std::string shape_text(std::span<const std::uint64_t> shape) {
    return fmt::format("({}{})", fmt::join(shape, ", "), shape.size() == 1 ? "," : "");
}

void check_shape(const ByteSource& in, const NpyHeader& header, std::size_t least,
                 std::uint64_t most) {
    if (header.shape.size() == 2 && header.shape[1] >= least && header.shape[1] <= most) return;
    in.fail("header", fmt::format("shape {}; (N, {}) is needed", shape_text(header.shape), least));
}

template <class T>
void save_values(const std::filesystem::path& file, std::string_view type,
                 std::span<const T> values, std::size_t columns) {
    if (columns > 0 && values.size() % columns != 0)
        input_error(
            printable(file), "values",
            fmt::format("{} given, which fill no whole rows of {}", values.size(), columns));
    std::vector<std::uint64_t> shape{values.size()};
    if (columns > 0) shape = {values.size() / columns, columns};
    save_npy_bytes(file, type, shape, std::as_bytes(values));
}

}  // namespace

std::vector<float> read_npy_rows(ByteSource& in, std::size_t keep) {
    const NpyHeader header = read_npy_header(in);
    constexpr std::uint64_t most_columns = std::uint64_t{1} << 32;
    check_shape(in, header, keep, most_columns);
    return read_body(in, header, keep);
}

std::vector<float> load_npy(const std::filesystem::path& file, std::size_t columns) {
    if (columns == 0) input_error(printable(file), "columns", "0 given, 1 or more are needed");
    ByteSource in = ByteSource::from_file(file, packing_of(file));
    const NpyHeader header = read_npy_header(in);
    check_shape(in, header, columns, columns);
    std::vector<float> values = read_body(in, header, columns);
    in.finish();
    return values;
}

Mesh load_npy_points(ByteSource& in) {
    const std::vector<float> rows = read_npy_rows(in, 3);
    check_mesh_size(in, rows.size() / 3, 0);
    Mesh mesh;
    mesh.vertices.reserve(rows.size() / 3);
    for (std::size_t i = 0; i < rows.size(); i += 3)
        add_vertex(in, mesh, {rows[i], rows[i + 1], rows[i + 2]});
    return mesh;
}

void save_npy_bytes(const std::filesystem::path& file, std::string_view type,
                    std::span<const std::uint64_t> shape, std::span<const std::byte> bytes) {
    const std::string descr = type.starts_with('[') ? std::string(type) : fmt::format("'{}'", type);
    std::string dictionary = fmt::format("{{'descr': {}, 'fortran_order': False, 'shape': {}, }}",
                                         descr, shape_text(shape));
    constexpr std::size_t prefix = 10, alignment = 64;  // the values start at a multiple of 64
    while ((prefix + dictionary.size() + 1) % alignment != 0) dictionary += ' ';
    dictionary += '\n';
    std::string head("\x93NUMPY\x01\x00", 8);
    head += static_cast<char>(dictionary.size() & 0xFF);
    head += static_cast<char>(dictionary.size() >> 8);
    head += dictionary;

    const std::array pieces{std::as_bytes(std::span(head)), bytes};
    write_pieces(file, pieces);
}

void save_npy(const std::filesystem::path& file, std::span<const float> values,
              std::size_t columns) {
    save_values(file, "<f4", values, columns);
}
void save_npy(const std::filesystem::path& file, std::span<const std::uint32_t> values,
              std::size_t columns) {
    save_values(file, "<u4", values, columns);
}
void save_npy(const std::filesystem::path& file, std::span<const std::uint64_t> values,
              std::size_t columns) {
    save_values(file, "<u8", values, columns);
}
void save_npy(const std::filesystem::path& file, std::span<const TreeHit> hits) {
    save_values(file, "[('t', '<f4'), ('prim', '<u4'), ('u', '<f4'), ('v', '<f4')]", hits, 0);
}
void save_npy(const std::filesystem::path& file, std::span<const Hit> hits) {
    save_values(file,
                "[('t', '<f4'), ('prim', '<u4'), ('u', '<f4'), ('v', '<f4'), "
                "('geometry', '<u4'), ('instance', '<u4')]",
                hits, 0);
}

}  // namespace raydix
