// NumPy's .npy files: (N, columns) arrays of float32 or float64 in, plain and structured arrays
// out.
#pragma once

#include <raydix/types.h>

#include <span>
#include <string>
#include <vector>

#include "scene/byte_source.h"

namespace raydix {

struct NpyHeader {
    std::string type;  // "<f4"; empty for structured arrays
    bool fortran_order = false;
    std::vector<std::uint64_t> shape;
};

/// Reads up to the first value. Versions 1 to 3. Throws InputError.
[[nodiscard]] NpyHeader read_npy_header(ByteSource& in);

/// The first `keep` columns of an array (N, columns >= keep) of float32 or float64, either byte
/// order, C or Fortran order -> [N * keep] row by row, rounded to float32. Values are not changed
/// otherwise (-0 and NaN stay). Bytes behind the array are not looked at.
[[nodiscard]] std::vector<float> read_npy_rows(ByteSource& in, std::size_t keep);

/// The same for a file whose array must have exactly `columns` columns, as the ray files (N, 8)
/// have. The file may be packed (.gz, .xz, .zst).
[[nodiscard]] std::vector<float> load_npy(const std::filesystem::path& file, std::size_t columns);

/// Writes `bytes`, which hold little-endian values of `type` ("<f4", or a list of fields in
/// Python's form). Throws InputError if the file cannot be written.
void save_npy_bytes(const std::filesystem::path& file, std::string_view type,
                    std::span<const std::uint64_t> shape, std::span<const std::byte> bytes);

/// Shape (N,), or (N, columns) if columns > 0.
void save_npy(const std::filesystem::path& file, std::span<const float> values,
              std::size_t columns = 0);
void save_npy(const std::filesystem::path& file, std::span<const std::uint32_t> values,
              std::size_t columns = 0);
void save_npy(const std::filesystem::path& file, std::span<const std::uint64_t> values,
              std::size_t columns = 0);

/// Shape (N,), dtype [('t','<f4'),('prim','<u4'),('u','<f4'),('v','<f4')]; of Hit
/// ('geometry','<u4'),
/// ('instance','<u4') behind them.
void save_npy(const std::filesystem::path& file, std::span<const TreeHit> hits);
void save_npy(const std::filesystem::path& file, std::span<const Hit> hits);

}  // namespace raydix
