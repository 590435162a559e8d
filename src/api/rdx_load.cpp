// .rdx file -> scene and a tree that views the mapped file.
#include <raydix/rdx.h>

#include <system_error>

#include "api/rdx_parse.h"
#include "exec/mapped_file.h"
#include "measure/stopwatch.h"
#include "scene/input_error.h"

namespace raydix {

RdxFile load_rdx(const std::filesystem::path& file) {
    Stopwatch watch;
    MappedFile mapped;
    try {
        mapped = map_file(file);
    } catch (const std::system_error& error) {
        input_error(printable(file), "file", error.what());
    }
    RdxFile result = rdx::parse(printable(file), mapped.bytes, mapped.owner);
    result.scene.load_ms = watch.lap();
    return result;
}

}  // namespace raydix
