// Text with a point per line: x y z, whatever follows them -> point cloud.
#include <fmt/format.h>

#include "scene/formats.h"
#include "scene/input_error.h"
#include "scene/mesh_builder.h"
#include "scene/text.h"

namespace raydix {

Mesh load_xyz(ByteSource& in) {
    LineReader lines(in);
    Mesh mesh;
    std::string_view line;
    while (lines.next_filled(line)) {
        Words words(line, ",;");
        const std::string_view start = words.rest();
        if (start.empty() || start.starts_with('#') || start.starts_with("//")) continue;
        Vec3 p{};
        if (!words.number(p.x) || !words.number(p.y) || !words.number(p.z)) {
            const std::string_view word = words.next();
            lines.fail(word.empty() ? "a point with less than three numbers"
                                    : in_quotes(word) + " is not a number");
        }
        add_vertex(in, mesh, p);
    }
    return mesh;
}

}  // namespace raydix
