// OFF (also COFF, NOFF, CNOFF, STOFF: extra numbers of a vertex are passed over) -> mesh.
#include <fmt/format.h>

#include "scene/formats.h"
#include "scene/input_error.h"
#include "scene/mesh_builder.h"
#include "scene/text.h"

namespace raydix {
namespace {

class OffReader {
public:
    explicit OffReader(ByteSource& in) : in_(in), lines_(in) {}

    Mesh read() {
        read_header();
        constexpr std::uint64_t shortest_vertex = 6, shortest_face = 8;  // "0 0 0\n", "3 0 1 2\n"
        reserve_for(in_, mesh_.vertices, vertex_count_, shortest_vertex);
        for (std::uint64_t i = 1; i <= vertex_count_; ++i) read_vertex(i);
        reserve_for(in_, mesh_.triangles, face_count_, shortest_face);
        for (std::uint64_t i = 1; i <= face_count_; ++i) read_face(i);
        return std::move(mesh_);
    }

private:
    /// The next line that holds more than blanks and a comment, without the comment.
    bool next_line(std::string_view& line) {
        while (lines_.next(line)) {
            line = line.substr(0, line.find('#'));
            if (!Words(line).next().empty()) return true;
        }
        return false;
    }

    /// The counts follow the magic word on its line or the next; the number of edges may be
    /// missing.
    void read_header() {
        std::string_view line;
        if (!next_line(line)) in_.fail("header", "the file is empty");
        Words words(line);
        std::string_view magic = words.next();
        while (magic.size() > 3 && (magic[0] == 'C' || magic[0] == 'N')) magic.remove_prefix(1);
        if (magic.starts_with("ST")) magic.remove_prefix(2);
        if (magic != "OFF") in_.fail("header", "does not start with \"OFF\"");
        if (words.rest().empty()) {
            if (!next_line(line)) in_.fail("header", "file ends before the counts");
            words = Words(line);
        }
        if (words.rest() == "BINARY") in_.fail("header", "binary OFF is not read");
        std::int64_t vertices = 0, faces = 0;
        if (!words.integer(vertices) || !words.integer(faces) || vertices < 0 || faces < 0)
            lines_.fail("expected the numbers of vertices, faces and edges");
        vertex_count_ = static_cast<std::uint64_t>(vertices);
        face_count_ = static_cast<std::uint64_t>(faces);
    }

    void read_vertex(std::uint64_t number) {
        std::string_view line;
        if (!next_line(line)) fail_at_end("vertex", number, vertex_count_, "vertices");
        Words words(line);
        Vec3 p{};
        if (!words.number(p.x) || !words.number(p.y) || !words.number(p.z))
            fail_word("vertex", number, words, "three numbers");
        add_vertex(in_, mesh_, p);
    }

    void read_face(std::uint64_t number) {
        std::string_view line;
        if (!next_line(line)) fail_at_end("face", number, face_count_, "faces");
        Words words(line);
        std::int64_t corners = 0;
        if (!words.integer(corners) || corners < 0)
            fail_word("face", number, words, "the number of corners");
        PolygonFan fan(in_, mesh_);
        for (; corners > 0; --corners) {
            std::int64_t index = 0;
            if (!words.integer(index)) fail_word("face", number, words, "an index per corner");
            fan.add_corner(checked_index(in_, number, index, vertex_count_));
        }
    }

    [[noreturn]] void fail_at_end(std::string_view element, std::uint64_t number,
                                  std::uint64_t count, std::string_view plural) {
        in_.fail(fmt::format("{} {}", element, number),
                 fmt::format("file ends after {} of {} {}", number - 1, count, plural));
    }

    [[noreturn]] void fail_word(std::string_view element, std::uint64_t number, Words& words,
                                std::string_view expected) {
        const std::string_view word = words.next();
        in_.fail(fmt::format("{} {}", element, number),
                 fmt::format("expected {}, found {} in line {}", expected,
                             word.empty() ? "the end" : in_quotes(word), lines_.number()));
    }

    ByteSource& in_;
    LineReader lines_;
    Mesh mesh_;
    std::uint64_t vertex_count_ = 0, face_count_ = 0;
};

}  // namespace

Mesh load_off(ByteSource& in) { return OffReader(in).read(); }

}  // namespace raydix
