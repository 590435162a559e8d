// A byte at a time through magic numbers, headers and block lengths.
#include "scene/zstd_frames.h"

#include <algorithm>
#include <array>

namespace raydix {

void ZstdFrames::feed(std::string_view bytes) {
    while (!bytes.empty() && !unknown_) {
        if (part_ == Part::skip) {
            const auto step =
                static_cast<std::size_t>(std::min<std::uint64_t>(skip_, bytes.size()));
            bytes.remove_prefix(step);
            skip_ -= step;
            if (skip_ == 0) expect(after_, after_need_);
            continue;
        }
        value_ |= std::uint32_t{static_cast<unsigned char>(bytes.front())} << (8 * have_);
        bytes.remove_prefix(1);
        if (++have_ == need_) finish_part();
    }
}

void ZstdFrames::expect(Part part, std::uint32_t bytes) {
    part_ = part;
    need_ = bytes;
    value_ = have_ = 0;
}

void ZstdFrames::skip(std::uint64_t bytes, Part then, std::uint32_t then_bytes) {
    if (bytes == 0) return expect(then, then_bytes);
    skip_ = bytes;
    after_ = then;
    after_need_ = then_bytes;
    expect(Part::skip, 0);
}

void ZstdFrames::finish_part() {
    constexpr std::uint32_t frame_magic = 0xFD2FB528u, skippable_magic = 0x184D2A50u;
    switch (part_) {
        case Part::magic:
            if (value_ == frame_magic)
                expect(Part::descriptor, 1);
            else if ((value_ & ~0xFu) == skippable_magic)
                expect(Part::skippable_size, 4);
            else
                unknown_ = true;
            break;
        case Part::skippable_size:
            skip(value_, Part::magic, 4);
            break;
        case Part::descriptor:
            read_descriptor();
            break;
        case Part::block_header:
            read_block_header();
            break;
        case Part::skip:
            break;
    }
}

/// Says how long the rest of the frame header is.
void ZstdFrames::read_descriptor() {
    static constexpr std::array<std::uint64_t, 4> dictionary_bytes{0, 1, 2, 4};
    static constexpr std::array<std::uint64_t, 4> size_bytes{0, 2, 4, 8};
    const bool single_segment = (value_ >> 5 & 1u) != 0;
    has_sum_ = (value_ >> 2 & 1u) != 0;
    std::uint64_t rest = dictionary_bytes[value_ & 3u] + size_bytes[value_ >> 6];
    rest += single_segment ? (value_ >> 6 == 0 ? 1 : 0) : 1;
    skip(rest, Part::block_header, 3);
}

void ZstdFrames::read_block_header() {
    constexpr std::uint32_t repeated_byte = 1;
    const bool last = (value_ & 1u) != 0;
    const std::uint64_t bytes = (value_ >> 1 & 3u) == repeated_byte ? 1 : value_ >> 3;
    if (!last) return skip(bytes, Part::block_header, 3);
    skip(bytes + (has_sum_ ? 4 : 0), Part::magic, 4);
}

}  // namespace raydix
