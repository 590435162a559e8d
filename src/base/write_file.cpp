// The bytes for a regular file go to FILE.PID-N.part first; only a complete one takes the name
// FILE. What is no regular file takes the bytes as it stands.
#include "base/write_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <raydix/error.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <initializer_list>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "base/path_check.h"
#include "base/printable.h"

namespace raydix {
namespace {

using Pieces = std::span<const std::span<const std::byte>>;

constexpr int max_links = 40;  // as many as the kernel follows

/// Keeps the signals of a closed pipe and of a file past its limit from the calling thread: both
/// end the process by default. The call that would raise one fails with an error number as well.
class WriteSignals {
public:
    WriteSignals() {
        sigset_t held, pending;
        sigemptyset(&held);
        sigemptyset(&raised_here_);
        sigpending(&pending);
        for (const int signal : {SIGPIPE, SIGXFSZ}) {
            sigaddset(&held, signal);
            if (sigismember(&pending, signal) == 0) sigaddset(&raised_here_, signal);
        }
        pthread_sigmask(SIG_BLOCK, &held, &before_);
    }
    ~WriteSignals() {
        const int error = errno;
        const timespec at_once{};
        while (sigtimedwait(&raised_here_, nullptr, &at_once) > 0) {
        }
        pthread_sigmask(SIG_SETMASK, &before_, nullptr);
        errno = error;
    }
    WriteSignals(const WriteSignals&) = delete;
    WriteSignals& operator=(const WriteSignals&) = delete;

private:
    sigset_t before_, raised_here_;  // the latter: not pending before, so ours
};

/// An open file that is closed once, with the error that closing reports.
class Output {
public:
    explicit Output(int descriptor) : descriptor_(descriptor) {}
    ~Output() { (void)close(); }
    Output(const Output&) = delete;
    Output& operator=(const Output&) = delete;

    [[nodiscard]] int descriptor() const { return descriptor_; }

    /// 0, or the error number of the step that failed.
    [[nodiscard]] int write(Pieces pieces) const {
        for (std::span<const std::byte> bytes : pieces) {
            while (!bytes.empty()) {
                const ssize_t done = ::write(descriptor_, bytes.data(), bytes.size());
                if (done < 0 && (errno == EINTR || (errno == EAGAIN && wait()))) continue;
                if (done <= 0) return done < 0 ? errno : EIO;
                bytes = bytes.subspan(static_cast<std::size_t>(done));
            }
        }
        return 0;
    }
    /// Late errors of full disks and of servers show here. A file system that cannot do it says so
    /// and has no such errors.
    [[nodiscard]] int sync() const {
        if (::fsync(descriptor_) == 0 || errno == EINVAL || errno == ENOTSUP) return 0;
        return errno;
    }
    int close() {
        const int descriptor = std::exchange(descriptor_, -1);
        // After EINTR the descriptor is closed all the same.
        return descriptor < 0 || ::close(descriptor) == 0 || errno == EINTR ? 0 : errno;
    }

private:
    /// For a pipe that somebody set not to block.
    [[nodiscard]] bool wait() const {
        pollfd room{descriptor_, POLLOUT, 0};
        return ::poll(&room, 1, -1) >= 0 || errno == EINTR;
    }

    int descriptor_;
};

/// N, if `path` names the open descriptor N of this process, as /proc/self/fd/N and /dev/fd/N do.
std::optional<int> descriptor_named(const std::filesystem::path& path) {
    const std::string name = path.filename();
    int number = 0;
    const auto [end, wrong] = std::from_chars(name.data(), name.data() + name.size(), number);
    if (wrong != std::errc() || end != name.data() + name.size()) return std::nullopt;
    std::error_code none;
    const std::filesystem::path folder = std::filesystem::canonical(path.parent_path(), none);
    const std::string own = fmt::format("/proc/{}/", getpid());
    if (none || !folder.native().starts_with(own) || folder.filename() != "fd") return std::nullopt;
    return number;
}

/// Where the bytes go once all symbolic links are followed.
struct Target {
    std::filesystem::path path;
    std::optional<int> descriptor;  // an open one: the path says no more
    std::optional<struct stat> is;  // empty if there is nothing yet
    int error = 0;
};

Target follow(const std::filesystem::path& file) {
    Target target{file, {}, {}, 0};
    for (int links = 0; links < max_links; ++links) {
        struct stat status;
        if (::lstat(target.path.c_str(), &status) != 0) {
            if (errno != ENOENT) target.error = errno;
            return target;
        }
        if (!S_ISLNK(status.st_mode)) {
            target.is = status;
            return target;
        }
        if ((target.descriptor = descriptor_named(target.path))) return target;
        std::error_code unreadable;
        const auto next = std::filesystem::read_symlink(target.path, unreadable);
        if (unreadable) {
            target.error = unreadable.value();
            return target;
        }
        target.path = target.path.parent_path() / next;  // an absolute `next` stands alone
    }
    target.error = ELOOP;
    return target;
}

int write_through(int descriptor, Pieces pieces) {
    if (descriptor < 0) return errno;
    Output out(descriptor);
    const int error = out.write(pieces);
    const int closed = out.close();
    return error != 0 ? error : closed;
}

/// A new file beside `file`, empty and open for writing: its name, and -1 with errno set if there
/// is none.
std::pair<std::filesystem::path, int> create_beside(const std::filesystem::path& file) {
    static std::atomic<std::uint32_t> count{0};
    constexpr std::size_t longest = 200;  // names have at most 255 bytes
    constexpr int most_tries = 10'000;
    const std::string name = file.filename().native().substr(0, longest);
    for (int tries = 1;; ++tries) {
        auto part = file.parent_path() / fmt::format("{}.{}-{}.part", name, getpid(), count++);
        const int out = ::open(part.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        // Another machine's process may have the same number, and a dead one may have left a file.
        if (out >= 0 || errno != EEXIST || tries == most_tries) return {std::move(part), out};
    }
}

/// What may be done with the file stays as it was; the owner too where this user may say so.
int keep_permissions(int descriptor, const struct stat& before) {
    if (::fchown(descriptor, before.st_uid, before.st_gid) != 0 && errno != EPERM) return errno;
    return ::fchmod(descriptor, before.st_mode & 07777) == 0 ? 0 : errno;
}

int replace(const Target& target, Pieces pieces) {
    if (target.path.filename().empty()) return target.path.empty() ? ENOENT : EISDIR;
    if (target.is && ::access(target.path.c_str(), W_OK) != 0) return errno;
    const auto [part, descriptor] = create_beside(target.path);
    if (descriptor < 0) return errno;
    Output out(descriptor);
    int error = target.is ? keep_permissions(descriptor, *target.is) : 0;
    if (error == 0) error = out.write(pieces);
    if (error == 0) error = out.sync();
    const int closed = out.close();
    if (error == 0) error = closed;
    if (error == 0 && std::rename(part.c_str(), target.path.c_str()) != 0) error = errno;
    if (error != 0) ::unlink(part.c_str());
    return error;
}

int write_to(const Target& target, Pieces pieces) {
    if (target.error != 0) return target.error;
    if (target.descriptor)
        return write_through(::fcntl(*target.descriptor, F_DUPFD_CLOEXEC, 0), pieces);
    if (!target.is || S_ISREG(target.is->st_mode)) return replace(target, pieces);
    if (S_ISDIR(target.is->st_mode)) return EISDIR;
    return write_through(::open(target.path.c_str(), O_WRONLY | O_CLOEXEC | O_NOCTTY), pieces);
}

}  // namespace

void write_pieces(const std::filesystem::path& file, Pieces pieces) {
    require_no_nul(file);
    const WriteSignals quiet;
    const int error = write_to(follow(file), pieces);
    if (error == 0) return;
    throw InputError(printable(file) + ": cannot write: " +
                     std::error_code(error, std::generic_category()).message());
}

}  // namespace raydix
