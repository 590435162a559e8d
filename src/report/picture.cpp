// Pictures to and from files: PNG for looking at, EXR for linear values.
#include <raydix/error.h>
#include <raydix/files.h>
#include <raydix/picture.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <string>

#include "base/path_check.h"
#include "base/printable.h"
#include "report/picture_codec.h"

namespace raydix {
namespace {

std::string lower_extension(const std::filesystem::path& file) {
    std::string extension = file.extension().string();
    for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return extension;
}

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& reason) {
    throw InputError(printable(file) + ": " + reason);
}

void check_size(const std::filesystem::path& file, const Picture& picture) {
    const auto [width, height] = std::pair(picture.width, picture.height);
    const std::string size = std::to_string(width) + " x " + std::to_string(height);
    if (width < 1 || height < 1 || width > max_picture_side || height > max_picture_side)
        fail(file, "cannot write a picture of " + size + " pixels; each side must be 1.." +
                       std::to_string(max_picture_side));
    if (picture.pixels.size() != std::size_t{width} * height)
        fail(file, "cannot write a picture of " + size + " that holds " +
                       std::to_string(picture.pixels.size()) + " pixels");
}

std::vector<std::byte> read_all(const std::filesystem::path& file) {
    require_no_nul(file);
    std::error_code error;
    if (!std::filesystem::exists(file, error)) fail(file, "no such file");
    if (!std::filesystem::is_regular_file(file, error)) fail(file, "is not a regular file");
    std::ifstream in(file, std::ios::binary | std::ios::ate);
    if (!in) fail(file, "cannot open");
    const std::streamoff size = in.tellg();
    if (size < 0) fail(file, "cannot read");
    std::vector<std::byte> bytes(static_cast<std::size_t>(size));
    in.seekg(0);
    if (!in.read(reinterpret_cast<char*>(bytes.data()), size)) fail(file, "cannot read");
    return bytes;
}

}  // namespace

void save_picture(const std::filesystem::path& file, const Picture& picture, bool tone_map) {
    require_no_nul(file);
    const std::string extension = lower_extension(file);
    if (extension != ".png" && extension != ".exr")
        fail(file, "unknown picture type '" + printable(std::string_view(extension)) +
                       "'; known: .png .exr");
    check_size(file, picture);
    std::vector<std::byte> bytes;
    try {
        bytes = extension == ".png" ? encode_png(picture, tone_map) : encode_exr(picture);
    } catch (const std::runtime_error& error) {
        fail(file, error.what());
    }
    write_file(file, bytes);
}

Picture load_picture(const std::filesystem::path& file) {
    const std::vector<std::byte> bytes = read_all(file);
    try {
        return decode_png(bytes);
    } catch (const std::runtime_error& error) {
        fail(file, error.what());
    }
}

}  // namespace raydix
