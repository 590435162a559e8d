// The bytes go to FILE.PID-N.part first; only a complete one takes the name FILE.
#include "base/replace_file.h"

#include <fmt/format.h>
#include <raydix/error.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <system_error>

namespace raydix {
namespace {

[[noreturn]] void fail(const std::filesystem::path& file, int error) {
    throw InputError(file.string() + ": cannot write: " +
                     std::error_code(error, std::generic_category()).message());
}

std::filesystem::path unused_name_beside(const std::filesystem::path& file) {
    static std::atomic<unsigned> count{0};
    std::filesystem::path beside = file;
    beside += fmt::format(".{}-{}.part", getpid(), count++);
    return beside;
}

/// 0, or the error number of the step that failed.
int write_all(const std::filesystem::path& file,
              std::span<const std::span<const std::byte>> pieces) {
    std::FILE* out = std::fopen(file.c_str(), "wbx");
    if (!out) return errno;
    int error = 0;
    errno = 0;
    const bool written = std::ranges::all_of(pieces, [&](std::span<const std::byte> bytes) {
        return bytes.empty() || std::fwrite(bytes.data(), 1, bytes.size(), out) == bytes.size();
    });
    if (!written || std::fflush(out) != 0) error = errno ? errno : EIO;
    if (std::fclose(out) != 0 && error == 0) error = errno ? errno : EIO;
    return error;
}

}  // namespace

void replace_file(const std::filesystem::path& file, std::span<const std::byte> bytes) {
    replace_file(file, std::span(&bytes, 1));
}

void replace_file(const std::filesystem::path& file,
                  std::span<const std::span<const std::byte>> pieces) {
    const std::filesystem::path part = unused_name_beside(file);
    int error = write_all(part, pieces);
    if (error == 0 && std::rename(part.c_str(), file.c_str()) != 0) error = errno;
    if (error == 0) return;
    if (error != EEXIST) std::remove(part.c_str());
    fail(file, error);
}

}  // namespace raydix
