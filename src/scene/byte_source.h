// A file or a piece of memory, packed or not -> its bytes, block by block. All readers stand on
// this. At most one block is held, so a reader's memory is what it keeps itself. Unpacking stops
// with an error once it has yielded 64 MiB more than 1000 times the packed bytes read: no scene
// packs that well, but bombs do.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace raydix {

enum class Packing { none, gzip, xz, zstd };

/// By the last extension: .gz, .xz, .zst in any case.
[[nodiscard]] Packing packing_of(const std::filesystem::path& file);

/// What `packed_bytes` of input may grow to, unpacked or as a mesh.
[[nodiscard]] constexpr std::uint64_t expansion_limit(std::uint64_t packed_bytes) {
    return (std::uint64_t{64} << 20) + 1000 * packed_bytes;
}

class ByteSource {
public:
    /// Where the bytes come from; `read` gives 0 only at the end.
    class Stream {
    public:
        virtual ~Stream() = default;
        virtual std::size_t read(char* out, std::size_t n) = 0;
        [[nodiscard]] virtual std::uint64_t packed_bytes_read() const = 0;
    };

    /// Throws InputError if the file cannot be opened.
    [[nodiscard]] static ByteSource from_file(const std::filesystem::path& file, Packing packing);
    /// `bytes` stay the caller's; `name` stands in messages.
    [[nodiscard]] static ByteSource from_memory(std::string_view bytes, std::string name,
                                                Packing packing = Packing::none);

    /// The bytes at hand, without reading more.
    [[nodiscard]] std::string_view buffered() const {
        return {buffer_.data() + begin_, end_ - begin_};
    }
    /// Makes buffered() at least `n` bytes long; false if the source ends before. Views of the
    /// buffer become invalid.
    bool fill(std::size_t n) { return end_ - begin_ >= n || refill(n); }
    /// Drops the first `n` of the buffered bytes.
    void consume(std::size_t n) { begin_ += n; }
    /// Copies up to `n` bytes; fewer only at the end.
    std::size_t read(char* out, std::size_t n);
    /// Drops `n` bytes that need not be buffered; false if the source ends before.
    bool skip(std::uint64_t n);
    /// To be called after the last byte was used: lets a packed stream that ends here check its
    /// sums.
    void finish() { fill(1); }

    [[nodiscard]] const std::string& name() const { return name_; }
    /// How many more bytes may be expected: exact for plain files and memory, a guess for packed
    /// ones. Good for reserving memory, which costs nothing until it is written.
    [[nodiscard]] std::uint64_t expected_rest() const;
    [[noreturn]] void fail(std::string_view element, std::string_view reason) const;

private:
    ByteSource(std::unique_ptr<Stream> stream, std::string name, std::uint64_t packed_size,
               Packing packing);
    bool refill(std::size_t n);
    std::size_t pull(char* out, std::size_t n);

    std::unique_ptr<Stream> stream_;
    std::string name_;
    std::uint64_t packed_size_;  // 0 if unknown
    Packing packing_;
    std::uint64_t pulled_ = 0;  // bytes out of stream_
    std::vector<char> buffer_;
    std::size_t begin_ = 0, end_ = 0;
    bool ended_ = false;
};

}  // namespace raydix
