// Wavefront OBJ -> mesh: positions and faces; everything else in the file is passed over.
#include <fmt/format.h>

#include <string>

#include "scene/formats.h"
#include "scene/input_error.h"
#include "scene/mesh_builder.h"
#include "scene/text.h"

namespace raydix {
namespace {

/// Lines joined where they end in a backslash; `number` is that of the first.
class ObjLines {
public:
    explicit ObjLines(ByteSource& in) : lines_(in) {}

    bool next(std::string_view& line) {
        if (!lines_.next(line)) return false;
        number_ = lines_.number();
        if (!continues(line)) return true;
        joined_.clear();
        for (;;) {
            const bool more = continues(line);
            joined_.append(more ? line.substr(0, line.size() - 1) : line);
            joined_ += ' ';
            if (joined_.size() > longest_line) fail("longer than 16 MiB");
            if (!more || !lines_.next(line)) break;
        }
        line = joined_;
        return true;
    }

    [[nodiscard]] std::uint64_t number() const { return number_; }
    [[noreturn]] void fail(std::string_view reason) {
        lines_.source().fail(fmt::format("line {}", number_), reason);
    }

private:
    static bool continues(std::string_view line) { return line.ends_with('\\'); }

    LineReader lines_;
    std::string joined_;
    std::uint64_t number_ = 0;
};

class ObjReader {
public:
    explicit ObjReader(ByteSource& in) : in_(in), lines_(in) {}

    Mesh read() {
        std::string_view line;
        while (lines_.next(line)) {
            Words words(line);
            const std::string_view keyword = words.next();
            if (keyword == "v")
                read_vertex(words);
            else if (keyword == "f" || keyword == "fo")
                read_face(words);
            else
                check_keyword(keyword);
        }
        if (highest_index_ > mesh_.vertices.size())
            in_.fail(fmt::format("line {}", highest_line_),
                     no_such_vertex(static_cast<std::int64_t>(highest_index_)));
        return std::move(mesh_);
    }

private:
    void read_vertex(Words& words) {
        Vec3 p{};
        if (!words.number(p.x) || !words.number(p.y) || !words.number(p.z)) {
            const std::string_view word = words.next();
            lines_.fail(word.empty() ? "a vertex with less than three numbers"
                                     : in_quotes(word) + " is not a number");
        }
        add_vertex(in_, mesh_, p);
    }

    /// Corners are v, v/vt, v//vn or v/vt/vn; only v counts.
    void read_face(Words& words) {
        PolygonFan fan(in_, mesh_);
        for (std::string_view corner = words.next(); !corner.empty() && corner[0] != '#';
             corner = words.next()) {
            std::string_view after = corner;
            std::int64_t index = 0;
            if (!take_integer(after, index) || (!after.empty() && after[0] != '/'))
                lines_.fail(in_quotes(corner) + " is not a corner of a face");
            fan.add_corner(absolute(index));
        }
    }

    /// File index (from 1; negative ones count back from the last vertex so far) -> position.
    /// A face may come before its vertices, so the upper end is checked once, at the end of the
    /// file.
    std::uint32_t absolute(std::int64_t index) {
        const auto count = static_cast<std::int64_t>(mesh_.vertices.size());
        if (index == 0 || index < -count || index > static_cast<std::int64_t>(max_vertices))
            lines_.fail(no_such_vertex(index));
        if (index < 0) return static_cast<std::uint32_t>(count + index);
        if (static_cast<std::uint64_t>(index) > highest_index_) {
            highest_index_ = static_cast<std::uint64_t>(index);
            highest_line_ = lines_.number();
        }
        return static_cast<std::uint32_t>(index - 1);
    }

    [[nodiscard]] std::string no_such_vertex(std::int64_t index) const {
        return fmt::format("index {} of {} vertices", index, mesh_.vertices.size());
    }

    /// Unknown statements are passed over as long as they look like text.
    void check_keyword(std::string_view keyword) {
        for (const char c : keyword.substr(0, keyword.find('#')))
            if (static_cast<unsigned char>(c) < 0x20)
                lines_.fail(in_quotes(keyword) + " is not an OBJ statement");
    }

    ByteSource& in_;
    ObjLines lines_;
    Mesh mesh_;
    std::uint64_t highest_index_ = 0, highest_line_ = 0;
};

}  // namespace

Mesh load_obj(ByteSource& in) { return ObjReader(in).read(); }

}  // namespace raydix
