#include "exec/mapped_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "base/path_check.h"

namespace raydix {
namespace {

[[noreturn]] void fail(int error, const char* what) {
    throw std::system_error(error, std::generic_category(), what);
}

/// Closes the descriptor: a mapping outlives it.
struct Descriptor {
    int number;
    ~Descriptor() { ::close(number); }
};

}  // namespace

MappedFile map_file(const std::filesystem::path& file) {
    require_no_nul(file);
    // Without O_NONBLOCK the open would wait for a writer if the name is a pipe's.
    const Descriptor in{::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
    if (in.number < 0) fail(errno, "cannot be opened");
    struct stat status {};
    if (::fstat(in.number, &status) != 0) fail(errno, "cannot be examined");
    if (S_ISDIR(status.st_mode)) fail(EISDIR, "cannot be read");
    if (!S_ISREG(status.st_mode)) fail(EINVAL, "cannot be read: not a regular file");
    const auto size = static_cast<std::size_t>(status.st_size);
    if (size == 0) return {};
    void* memory = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, in.number, 0);
    if (memory == MAP_FAILED) fail(errno, "cannot be mapped");
    ::madvise(memory, size, MADV_WILLNEED);  // a hint: all of it is read at once for the checksums
    return {{memory, [size](void* p) { ::munmap(p, size); }},
            {static_cast<const std::byte*>(memory), size}};
}

}  // namespace raydix
