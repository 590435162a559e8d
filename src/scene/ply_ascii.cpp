// Body of an ascii PLY file, one record a line -> vertices and triangles. What follows the last
// needed property on a line is not looked at.
#include "scene/input_error.h"
#include "scene/ply.h"

namespace raydix {
namespace {

class AsciiRecords {
public:
    AsciiRecords(LineReader& lines, const PlyPart& part, std::uint64_t vertex_count, Mesh& mesh)
        : lines_(lines),
          in_(lines.source()),
          part_(part),
          vertex_count_(vertex_count),
          mesh_(mesh) {}

    void read_all() {
        for (number_ = 1; number_ <= part_.element->count; ++number_) {
            std::string_view line;
            if (!lines_.next_filled(line)) fail_at_end(in_, *part_.element, number_);
            Words words(line);
            if (part_.role == PlyRole::vertices) read_vertex(words);
            if (part_.role == PlyRole::faces || part_.role == PlyRole::strips) read_indices(words);
        }
    }

private:
    void read_vertex(Words& words) {
        std::array<float, 3> xyz{};
        int found = 0;
        for (std::size_t i = 0; found < 3; ++i) {
            if (part_.element->properties[i].is_list) {
                skip_list(words, i);
                continue;
            }
            float value = 0;
            if (!words.number(value)) fail_word(words, i);
            for (std::size_t axis = 0; axis < 3; ++axis) {
                if (part_.position[axis] != static_cast<int>(i)) continue;
                xyz[axis] = value;
                ++found;
            }
        }
        add_vertex(in_, mesh_, {xyz[0], xyz[1], xyz[2]});
    }

    void read_indices(Words& words) {
        const auto list = static_cast<std::size_t>(part_.index_list);
        for (std::size_t i = 0; i < list; ++i) {
            float ignored = 0;
            if (part_.element->properties[i].is_list)
                skip_list(words, i);
            else if (!words.number(ignored))
                fail_word(words, i);
        }
        PlyIndexSink sink(in_, mesh_, part_, number_, vertex_count_);
        for (std::int64_t rest = list_length(words, list); rest > 0; --rest) {
            std::int64_t index = 0;
            if (!words.integer(index)) fail_word(words, list);
            sink.add(index);
        }
    }

    std::int64_t list_length(Words& words, std::size_t property) {
        std::int64_t length = 0;
        if (!words.integer(length)) fail_word(words, property);
        if (length < 0)
            in_.fail(fmt::format("{} {}", part_.element->name, number_),
                     fmt::format("a list of {} items", length));
        return length;
    }

    void skip_list(Words& words, std::size_t property) {
        for (std::int64_t rest = list_length(words, property); rest > 0; --rest)
            if (words.next().empty()) fail_word(words, property);
    }

    [[noreturn]] void fail_word(Words& words, std::size_t property) {
        const std::string_view word = words.next();
        const std::string& name = part_.element->properties[property].name;
        in_.fail(fmt::format("{} {}", part_.element->name, number_),
                 word.empty() ? fmt::format("line {} ends before {}", lines_.number(), name)
                              : fmt::format("{} cannot be {} (line {})", in_quotes(word), name,
                                            lines_.number()));
    }

    LineReader& lines_;
    ByteSource& in_;
    const PlyPart& part_;
    std::uint64_t vertex_count_;
    Mesh& mesh_;
    std::uint64_t number_ = 1;  // of the record, from 1
};

}  // namespace

void read_ascii_part(LineReader& lines, const PlyPart& part, std::uint64_t vertex_count,
                     Mesh& mesh) {
    constexpr std::uint64_t shortest_vertex = 6, shortest_face = 8;  // "0 0 0\n", "3 0 1 2\n"
    if (part.element->properties.empty()) return;
    if (part.role == PlyRole::vertices)
        reserve_for(lines.source(), mesh.vertices, part.element->count, shortest_vertex);
    if (part.role == PlyRole::faces)
        reserve_for(lines.source(), mesh.triangles, part.element->count, shortest_face);
    AsciiRecords(lines, part, vertex_count, mesh).read_all();
}

}  // namespace raydix
