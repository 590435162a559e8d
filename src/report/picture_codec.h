// Pictures <-> the bytes of a file. Reasons are thrown as std::runtime_error; picture.cpp adds the
// file's name.
#pragma once

#include <raydix/picture.h>

#include <cstddef>
#include <span>
#include <vector>

namespace raydix {

/// Longest side of a picture that is read or written.
inline constexpr std::uint32_t max_picture_side = 16384;

/// 8-bit RGB, sRGB, after the film curve if `tone_map`.
[[nodiscard]] std::vector<std::byte> encode_png(const Picture& picture, bool tone_map);
/// Any PNG that libpng can turn into 8-bit RGB; transparent parts become black.
[[nodiscard]] Picture decode_png(std::span<const std::byte> bytes);
/// Channels R, G, B as linear float32, exact, ZIP-compressed.
[[nodiscard]] std::vector<std::byte> encode_exr(const Picture& picture);

}  // namespace raydix
