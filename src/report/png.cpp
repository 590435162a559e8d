// PNG through libpng's simplified interface, which reports errors by return value (no longjmp over
// our objects).
#include <png.h>

#include <array>
#include <stdexcept>
#include <string>

#include "base/float_env.h"
#include "exec/parallel.h"
#include "report/picture_codec.h"
#include "report/srgb.h"

namespace raydix {
namespace {

/// Deflate cannot pack tighter than this, so a file of n bytes holds at most n times as many bytes
/// of pixels.
constexpr std::uint64_t most_bytes_per_byte = 1032;

/// A png_image that frees what libpng hangs on it.
struct PngImage {
    png_image image{};
    PngImage() { image.version = PNG_IMAGE_VERSION; }
    PngImage(const PngImage&) = delete;
    PngImage& operator=(const PngImage&) = delete;
    ~PngImage() { png_image_free(&image); }

    [[noreturn]] void fail() const {
        throw std::runtime_error(std::string("PNG: ") + image.message);
    }
};

std::vector<std::uint8_t> screen_bytes(const Picture& picture, bool tone_map) {
    std::vector<std::uint8_t> bytes(3 * picture.pixels.size());
    for_each_index(picture.pixels.size(), [&](std::size_t i) {
        const Vec3& pixel = picture.pixels[i];
        const float values[3] = {pixel.x, pixel.y, pixel.z};
        for (std::size_t k = 0; k < 3; ++k)
            bytes[3 * i + k] = srgb_byte(tone_map ? film_curve(values[k]) : values[k]);
    });
    return bytes;
}

}  // namespace

std::vector<std::byte> encode_png(const Picture& picture, bool tone_map) {
    const FloatEnvironment plain;
    const std::vector<std::uint8_t> pixels = screen_bytes(picture, tone_map);
    PngImage png;
    png.image.width = picture.width;
    png.image.height = picture.height;
    png.image.format = PNG_FORMAT_RGB;
    // No filters and a lighter search: a third of the time, and pictures with grain get smaller.
    png.image.flags = PNG_IMAGE_FLAG_FAST;
    png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png.image);
    std::vector<std::byte> file(size);
    if (!png_image_write_to_memory(&png.image, file.data(), &size, 0, pixels.data(), 0, nullptr))
        png.fail();
    file.resize(size);
    return file;
}

Picture decode_png(std::span<const std::byte> bytes) {
    const FloatEnvironment plain;
    PngImage png;
    if (!png_image_begin_read_from_memory(&png.image, bytes.data(), bytes.size())) png.fail();
    const std::uint64_t width = png.image.width, height = png.image.height;
    const std::string size = std::to_string(width) + " x " + std::to_string(height);
    if (width > max_picture_side || height > max_picture_side)
        throw std::runtime_error("PNG of " + size + " pixels; each side may be at most " +
                                 std::to_string(max_picture_side));
    // One bit a pixel is the least that PNG has.
    if (width * height / 8 > bytes.size() * most_bytes_per_byte)
        throw std::runtime_error("PNG claims " + size + " pixels, more than its " +
                                 std::to_string(bytes.size()) + " bytes can hold");
    png.image.format = PNG_FORMAT_RGB;
    std::vector<std::uint8_t> pixels(3 * width * height);
    const png_color black{};
    if (!png_image_finish_read(&png.image, &black, pixels.data(), 0, nullptr)) png.fail();

    std::array<float, 256> linear{};
    for (int i = 0; i < 256; ++i) linear[i] = linear_from_srgb(static_cast<float>(i) / 255.0f);
    Picture picture{png.image.width, png.image.height, {}};
    picture.pixels.reserve(width * height);
    for (std::size_t i = 0; i < pixels.size(); i += 3)
        picture.pixels.push_back({linear[pixels[i]], linear[pixels[i + 1]], linear[pixels[i + 2]]});
    return picture;
}

}  // namespace raydix
