// Lines and words of text formats. Numbers are read without a locale and rounded correctly.
#pragma once

#include <cstdint>
#include <string_view>

#include "scene/byte_source.h"

namespace raydix {

/// Longer lines are an error, so that a file without line ends cannot fill the memory.
inline constexpr std::size_t longest_line = std::size_t{16} << 20;

/// Splits a source into lines that end in LF, CR LF or CR. The first line loses its UTF-8 byte
/// order mark; UTF-16 text is an error.
class LineReader {
public:
    explicit LineReader(ByteSource& source);

    /// False at the end of the file. The view holds until the source is read again.
    bool next(std::string_view& line);
    /// The same, but skips lines of blanks.
    bool next_filled(std::string_view& line);

    [[nodiscard]] std::uint64_t number() const { return number_; }  // of the last line, from 1
    [[nodiscard]] ByteSource& source() { return source_; }
    [[noreturn]] void fail(std::string_view reason) const;  // names the last line

private:
    ByteSource& source_;
    std::uint64_t number_ = 0;
};

[[nodiscard]] constexpr bool is_blank(char c) {
    return c == ' ' || c == '\t' || c == '\v' || c == '\f' || c == '\r';
}

/// Walks over the words of one line.
class Words {
public:
    /// `separators` part words besides blanks.
    explicit Words(std::string_view line, std::string_view separators = {})
        : rest_(line), separators_(separators) {}

    /// The next word, empty at the end of the line.
    [[nodiscard]] std::string_view next();
    /// True if the next word is a number as a whole; it is then consumed. Beyond float's range it
    /// is +-Inf, below it +-0; "nan" and "inf" count, with any letter case and sign; so
    /// do 1.#INF, 1.#QNAN and the like.
    [[nodiscard]] bool number(float& value);
    [[nodiscard]] bool integer(std::int64_t& value);
    /// What is left of the line, from the next word on.
    [[nodiscard]] std::string_view rest();

private:
    [[nodiscard]] bool parts(char c) const {
        return is_blank(c) || separators_.find(c) != std::string_view::npos;
    }

    std::string_view rest_, separators_;
};

/// Reads a number at the start of `text`, which then starts behind it; false if there is none.
[[nodiscard]] bool take_number(std::string_view& text, float& value);
[[nodiscard]] bool take_integer(std::string_view& text, std::int64_t& value);

}  // namespace raydix
