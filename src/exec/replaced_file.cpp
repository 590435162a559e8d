#include "exec/replaced_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <string>
#include <system_error>
#include <utility>

namespace raydix {
namespace {

[[noreturn]] void fail(const char* what) {
    throw std::system_error(errno, std::generic_category(), what);
}

/// Short, so that it fits where the target's own name fits; unlike any other of this process.
std::string temporary_name() {
    static std::atomic<unsigned> count{0};
    return fmt::format(".{}-{}.tmp", ::getpid(), count++);
}

}  // namespace

ReplacedFile::ReplacedFile(std::filesystem::path target)
    : target_(std::move(target)), temporary_(target_.parent_path() / temporary_name()) {
    descriptor_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor_ < 0) fail("cannot be written");
}

ReplacedFile::~ReplacedFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
    if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

void ReplacedFile::write(std::span<const std::byte> bytes) {
    constexpr std::size_t most_at_once = std::size_t{1} << 30;  // systems cut larger writes short
    while (!bytes.empty()) {
        const ::ssize_t written =
            ::write(descriptor_, bytes.data(), std::min(bytes.size(), most_at_once));
        if (written < 0 && errno == EINTR) continue;
        if (written < 0) fail("cannot be written");
        bytes = bytes.subspan(static_cast<std::size_t>(written));
    }
}

void ReplacedFile::commit() {
    const int closed = ::close(std::exchange(descriptor_, -1));
    if (closed != 0) fail("cannot be written");
    if (::rename(temporary_.c_str(), target_.c_str()) != 0) fail("cannot be put in place");
    temporary_.clear();
}

}  // namespace raydix
