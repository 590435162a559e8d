// Names for files and folders among the temporary ones.
#pragma once

#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <string>
#include <system_error>

namespace raydix::test {

/// A path of this process and this object alone. What comes to lie there is removed in the end.
class TempPath {
public:
    /// What its name begins and ends with.
    explicit TempPath(const std::string& start, const std::string& end = {}) {
        static std::atomic<int> count{0};
        path_ = std::filesystem::temp_directory_path() /
                (start + std::to_string(getpid()) + "-" + std::to_string(count++) + end);
    }
    ~TempPath() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    TempPath(const TempPath&) = delete;
    TempPath& operator=(const TempPath&) = delete;
    [[nodiscard]] const std::filesystem::path& path() const { return path_; }

private:
    std::filesystem::path path_;
};

}  // namespace raydix::test
