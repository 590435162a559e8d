// Follows the frames of a zstd stream (RFC 8878, section 3.1) without unpacking them, to tell
// whether its last frame is whole: the unpacking filter takes a stream that is cut off for one that
// has ended.
#pragma once

#include <cstdint>
#include <string_view>

namespace raydix {

class ZstdFrames {
public:
    /// Takes the next bytes of the packed stream.
    void feed(std::string_view bytes);
    /// True between frames, so also before the first. A stream that is no zstd is left to the
    /// filter.
    [[nodiscard]] bool is_whole() const { return unknown_ || (part_ == Part::magic && have_ == 0); }

private:
    enum class Part { magic, skippable_size, descriptor, block_header, skip };

    void finish_part();
    void expect(Part part, std::uint32_t bytes);
    void skip(std::uint64_t bytes, Part then, std::uint32_t then_bytes);
    void read_descriptor();
    void read_block_header();

    Part part_ = Part::magic;
    std::uint32_t value_ = 0;            // the bytes of this part so far, little-endian
    std::uint32_t have_ = 0, need_ = 4;  // bytes of this part
    std::uint64_t skip_ = 0;             // bytes to pass over before `after_`
    Part after_ = Part::magic;
    std::uint32_t after_need_ = 4;
    bool has_sum_ = false, unknown_ = false;
};

}  // namespace raydix
