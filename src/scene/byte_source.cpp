// Plain files by read(2), packed ones through the Boost.Iostreams filters; errors of either name
// the file.
#include "scene/byte_source.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <boost/iostreams/filter/gzip.hpp>
#include <boost/iostreams/filter/lzma.hpp>
#include <boost/iostreams/filter/zstd.hpp>
#include <boost/iostreams/read.hpp>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <ios>
#include <new>
#include <system_error>
#include <type_traits>

#include "base/path_check.h"
#include "scene/input_error.h"
#include "scene/zstd_frames.h"

namespace raydix {
namespace {

namespace io = boost::iostreams;

constexpr std::size_t block_bytes = std::size_t{1} << 18;
constexpr std::size_t packed_block_bytes = std::size_t{1} << 16;

class MemoryStream final : public ByteSource::Stream {
public:
    explicit MemoryStream(std::string_view bytes) : rest_(bytes), size_(bytes.size()) {}
    std::size_t read(char* out, std::size_t n) override {
        n = rest_.copy(out, n);
        rest_.remove_prefix(n);
        return n;
    }
    [[nodiscard]] std::uint64_t packed_bytes_read() const override { return size_ - rest_.size(); }

private:
    std::string_view rest_;
    std::size_t size_;
};

class FileStream final : public ByteSource::Stream {
public:
    FileStream(const std::filesystem::path& file, std::string name) : name_(std::move(name)) {
        descriptor_ = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
        if (descriptor_ < 0) fail("cannot be opened");
    }
    ~FileStream() override { ::close(descriptor_); }
    FileStream(const FileStream&) = delete;
    FileStream& operator=(const FileStream&) = delete;

    std::size_t read(char* out, std::size_t n) override {
        ssize_t got = 0;
        do got = ::read(descriptor_, out, n);
        while (got < 0 && errno == EINTR);
        if (got < 0) fail("cannot be read");
        bytes_ += static_cast<std::uint64_t>(got);
        return static_cast<std::size_t>(got);
    }
    [[nodiscard]] std::uint64_t packed_bytes_read() const override { return bytes_; }

private:
    [[noreturn]] void fail(std::string_view what) const {
        input_error(name_, what, std::generic_category().message(errno));
    }

    std::string name_;
    int descriptor_ = -1;
    std::uint64_t bytes_ = 0;
};

/// The form in which the filters want their input: -1 at the end.
struct FilterInput {
    using char_type = char;
    using category = io::source_tag;
    ByteSource::Stream* stream;
    std::shared_ptr<ZstdFrames> frames =
        nullptr;  // of zstd only; shared because filters copy their input

    std::streamsize read(char* out, std::streamsize n) {
        const std::size_t got = stream->read(out, static_cast<std::size_t>(n));
        if (frames) frames->feed({out, got});
        if (frames && got == 0 && !frames->is_whole()) throw std::ios_base::failure("cut off");
        return got == 0 ? -1 : static_cast<std::streamsize>(got);
    }
};

template <class Filter>
class UnpackedStream final : public ByteSource::Stream {
public:
    UnpackedStream(std::unique_ptr<ByteSource::Stream> packed, Filter filter)
        : packed_(std::move(packed)), filter_(std::move(filter)), input_{packed_.get()} {
        if constexpr (std::is_same_v<Filter, io::zstd_decompressor>)
            input_.frames = std::make_shared<ZstdFrames>();
    }
    std::size_t read(char* out, std::size_t n) override {
        const std::streamsize got = io::read(filter_, input_, out, static_cast<std::streamsize>(n));
        return got < 0 ? 0 : static_cast<std::size_t>(got);
    }
    [[nodiscard]] std::uint64_t packed_bytes_read() const override {
        return packed_->packed_bytes_read();
    }

private:
    std::unique_ptr<ByteSource::Stream> packed_;
    Filter filter_;
    FilterInput input_;
};

template <class Filter>
std::unique_ptr<ByteSource::Stream> unpack(std::unique_ptr<ByteSource::Stream> packed,
                                           Filter filter) {
    return std::make_unique<UnpackedStream<Filter>>(std::move(packed), std::move(filter));
}

std::unique_ptr<ByteSource::Stream> unpacked(std::unique_ptr<ByteSource::Stream> stream,
                                             Packing packing) {
    constexpr auto block = static_cast<std::streamsize>(packed_block_bytes);
    switch (packing) {
        case Packing::gzip:
            return unpack(std::move(stream),
                          io::gzip_decompressor(io::zlib::default_window_bits, block));
        case Packing::xz:
            return unpack(std::move(stream), io::lzma_decompressor(block));
        case Packing::zstd:
            return unpack(std::move(stream), io::zstd_decompressor(block));
        case Packing::none:
            break;
    }
    return stream;
}

}  // namespace

Packing packing_of(const std::filesystem::path& file) {
    std::string extension = file.extension().string();
    for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    if (extension == ".gz") return Packing::gzip;
    if (extension == ".xz") return Packing::xz;
    if (extension == ".zst") return Packing::zstd;
    return Packing::none;
}

ByteSource::ByteSource(std::unique_ptr<Stream> stream, std::string name, std::uint64_t packed_size,
                       Packing packing)
    : stream_(unpacked(std::move(stream), packing)),
      name_(std::move(name)),
      packed_size_(packed_size),
      packing_(packing) {}

ByteSource ByteSource::from_file(const std::filesystem::path& file, Packing packing) {
    require_no_nul(file);
    std::string name = printable(file);
    std::error_code ignored;
    if (std::filesystem::is_directory(file, ignored))
        input_error(name, "cannot be read", "it is a directory");
    auto stream = std::make_unique<FileStream>(file, name);
    const auto size = std::filesystem::file_size(file, ignored);
    return {std::move(stream), std::move(name), ignored ? 0 : size, packing};
}

ByteSource ByteSource::from_memory(std::string_view bytes, std::string name, Packing packing) {
    return {std::make_unique<MemoryStream>(bytes), std::move(name), bytes.size(), packing};
}

std::size_t ByteSource::pull(char* out, std::size_t n) {
    std::size_t got = 0;
    try {
        got = stream_->read(out, n);
    } catch (const std::ios_base::failure&) {
        fail("packed data", "damaged or cut off");
    } catch (const std::bad_alloc&) {
        fail("packed data", "unpacking needs more memory than there is");
    }
    pulled_ += got;
    if (packing_ != Packing::none && pulled_ > expansion_limit(stream_->packed_bytes_read()))
        fail("packed data", "unpacks to more than 1000 times its size");
    return got;
}

bool ByteSource::refill(std::size_t n) {
    std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(begin_),
              buffer_.begin() + static_cast<std::ptrdiff_t>(end_), buffer_.begin());
    end_ -= begin_;
    begin_ = 0;
    if (buffer_.size() < std::max(n, block_bytes))
        buffer_.resize(std::max({n, 2 * buffer_.size(), block_bytes}));
    while (end_ < n && !ended_) {
        const std::size_t got = pull(buffer_.data() + end_, buffer_.size() - end_);
        ended_ = got == 0;
        end_ += got;
    }
    return end_ >= n;
}

std::size_t ByteSource::read(char* out, std::size_t n) {
    std::size_t done = buffered().copy(out, n);
    consume(done);
    while (done < n && !ended_) {
        const std::size_t got = pull(out + done, n - done);
        ended_ = got == 0;
        done += got;
    }
    return done;
}

bool ByteSource::skip(std::uint64_t n) {
    while (n > 0) {
        if (!fill(1)) return false;
        const auto step = static_cast<std::size_t>(std::min<std::uint64_t>(n, buffered().size()));
        consume(step);
        n -= step;
    }
    return true;
}

std::uint64_t ByteSource::expected_rest() const {
    constexpr std::uint64_t usual_ratio = 8;
    const std::uint64_t expected =
        packing_ == Packing::none ? packed_size_ : usual_ratio * packed_size_;
    const std::uint64_t used = pulled_ - (end_ - begin_);
    return expected > used ? expected - used : 0;
}

void ByteSource::fail(std::string_view element, std::string_view reason) const {
    input_error(name_, element, reason);
}

}  // namespace raydix
