// .rdx file -> scene and a tree, or a Scene, that view the mapped file.
#include <raydix/rdx.h>

#include <array>
#include <fstream>
#include <system_error>

#include "base/printable.h"
#include "io/map_input.h"
#include "io/rdx_parse.h"
#include "io/rdx_sections.h"
#include "measure/stopwatch.h"

namespace raydix {
RdxFile load_rdx(const std::filesystem::path& file) {
    Stopwatch watch;
    const MappedFile whole = mapped_input(file);
    RdxFile result = rdx::parse(printable(file), whole.bytes, whole.owner);
    result.scene.load_ms = watch.lap();
    return result;
}

RdxScene load_rdx_scene(const std::filesystem::path& file) {
    Stopwatch watch;
    const MappedFile whole = mapped_input(file);
    RdxScene result = rdx::parse_scene(printable(file), whole.bytes, whole.owner);
    result.load_ms = watch.lap();
    return result;
}

RdxSceneD load_rdx_scene_double(const std::filesystem::path& file) {
    Stopwatch watch;
    const MappedFile whole = mapped_input(file);
    RdxSceneD result = rdx::parse_scene_double(printable(file), whole.bytes, whole.owner);
    result.load_ms = watch.lap();
    return result;
}

bool is_rdx_file(const std::filesystem::path& file) {
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(file, ignored)) return false;
    std::array<unsigned char, rdx::magic.size()> start{};
    std::ifstream(file, std::ios::binary).read(reinterpret_cast<char*>(start.data()), start.size());
    return start == rdx::magic;
}

bool holds_scene(const std::filesystem::path& file) {
    const MappedFile whole = mapped_input(file);
    return rdx::version_of(printable(file), whole.bytes) != rdx::version;
}

bool holds_scene_double(const std::filesystem::path& file) {
    const MappedFile whole = mapped_input(file);
    return rdx::version_of(printable(file), whole.bytes) == rdx::double_version;
}

}  // namespace raydix
