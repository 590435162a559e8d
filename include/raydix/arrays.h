// NumPy files of plain numbers: what queries take and give.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

namespace raydix {

/// Reads an array of shape (N, columns), float32 or float64 of either byte order, C or Fortran
/// order, the file packed (.gz, .xz, .zst) or not -> [N * columns] row by row, rounded to float32.
/// Throws InputError that names the file; also if columns is 0.
[[nodiscard]] std::vector<float> load_array(const std::filesystem::path& file, std::size_t columns);

/// Writes shape (N,), or (N, columns) if columns > 0, little-endian. Throws as write_file of
/// files.h, and InputError if the values do not fill whole rows.
void save_array(const std::filesystem::path& file, std::span<const float> values,
                std::size_t columns = 0);
void save_array(const std::filesystem::path& file, std::span<const std::uint32_t> values,
                std::size_t columns = 0);
void save_array(const std::filesystem::path& file, std::span<const std::uint64_t> values,
                std::size_t columns = 0);

}  // namespace raydix
