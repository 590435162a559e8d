// The head of a .npy file, a Python dictionary in text -> NpyHeader.
#include <fmt/format.h>

#include <charconv>

#include "scene/input_error.h"
#include "scene/json_input.h"
#include "scene/npy.h"

namespace raydix {
namespace {

constexpr std::uint64_t longest_header = std::uint64_t{1} << 20;

/// Reads {'descr': '<f4', 'fortran_order': False, 'shape': (3, 4), } and nothing more general.
class HeaderText {
public:
    HeaderText(const ByteSource& in, std::string_view text) : in_(in), rest_(text) {}

    NpyHeader read() {
        NpyHeader header;
        bool has_type = false, has_order = false, has_shape = false;
        expect('{');
        while (!accept('}')) {
            const std::string_view key = read_string();
            expect(':');
            if (key == "descr") {
                header.type = read_type();
                has_type = true;
            } else if (key == "fortran_order") {
                header.fortran_order = read_bool();
                has_order = true;
            } else if (key == "shape") {
                header.shape = read_shape();
                has_shape = true;
            } else {
                fail(fmt::format("unknown key {}", in_quotes(key)));
            }
            if (!accept(',')) {
                expect('}');
                break;
            }
        }
        if (!has_type || !has_order || !has_shape) fail("descr, fortran_order or shape is missing");
        return header;
    }

private:
    /// Structured types are lists of fields: they are passed over and come out empty.
    std::string read_type() {
        if (peek() != '[') return std::string(read_string());
        const std::size_t end = rest_.rfind(']');
        if (end == std::string_view::npos) fail("a list without its end");
        rest_.remove_prefix(end + 1);
        return {};
    }

    bool read_bool() {
        peek();
        for (const auto& [word, value] :
             {std::pair{std::string_view("True"), true}, {std::string_view("False"), false}}) {
            if (!rest_.starts_with(word)) continue;
            rest_.remove_prefix(word.size());
            return value;
        }
        fail("fortran_order is neither True nor False");
    }

    std::vector<std::uint64_t> read_shape() {
        std::vector<std::uint64_t> shape;
        expect('(');
        while (!accept(')')) {
            peek();
            std::uint64_t length = 0;
            const auto [stop, error] =
                std::from_chars(rest_.data(), rest_.data() + rest_.size(), length);
            if (error != std::errc()) fail("shape is not a tuple of integers");
            rest_.remove_prefix(static_cast<std::size_t>(stop - rest_.data()));
            shape.push_back(length);
            if (!accept(',')) {
                expect(')');
                break;
            }
        }
        return shape;
    }

    std::string_view read_string() {
        const char quote = peek();
        if (quote != '\'' && quote != '"') fail("expected a string");
        const std::size_t end = rest_.find(quote, 1);
        if (end == std::string_view::npos) fail("a string without its end");
        const std::string_view text = rest_.substr(1, end - 1);
        rest_.remove_prefix(end + 1);
        return text;
    }

    /// The next character that is no blank, 0 at the end.
    char peek() {
        while (!rest_.empty() && (rest_[0] == ' ' || rest_[0] == '\n')) rest_.remove_prefix(1);
        return rest_.empty() ? '\0' : rest_[0];
    }

    bool accept(char c) {
        if (peek() != c) return false;
        rest_.remove_prefix(1);
        return true;
    }

    void expect(char c) {
        if (!accept(c)) fail(fmt::format("expected {:?}", std::string_view(&c, 1)));
    }

    [[noreturn]] void fail(std::string_view reason) const { in_.fail("header", reason); }

    const ByteSource& in_;
    std::string_view rest_;
};

}  // namespace

NpyHeader read_npy_header(ByteSource& in) {
    constexpr std::string_view magic = "\x93NUMPY";
    in.fill(12);
    const std::string_view start = in.buffered();
    if (!start.starts_with(magic) || start.size() < 10) in.fail("header", "not an .npy file");
    const auto byte = [&](std::size_t i) {
        return std::uint64_t{static_cast<unsigned char>(start[i])};
    };
    const std::uint64_t version = byte(6);
    if (version < 1 || version > 3 || (version > 1 && start.size() < 12))
        in.fail("header", fmt::format("unknown version {}", version));
    std::uint64_t length = byte(8) | byte(9) << 8;
    if (version > 1) length |= byte(10) << 16 | byte(11) << 24;
    if (length > longest_header)
        in.fail("header", fmt::format("claims to be {} bytes long", length));
    in.consume(version > 1 ? 12 : 10);
    return HeaderText(in, read_exactly(in, length, "header")).read();
}

}  // namespace raydix
