// A file that appears under its name only when it is complete.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>

namespace raydix {

/// Writes to a temporary file in the target's folder; `commit` renames it over the target. Without
/// a commit the temporary file goes and the target stays as it was. All members throw
/// std::system_error.
class ReplacedFile {
public:
    explicit ReplacedFile(std::filesystem::path target);
    ~ReplacedFile();
    ReplacedFile(const ReplacedFile&) = delete;
    ReplacedFile& operator=(const ReplacedFile&) = delete;

    void write(std::span<const std::byte> bytes);
    void commit();

private:
    std::filesystem::path target_, temporary_;
    int descriptor_ = -1;
};

}  // namespace raydix
