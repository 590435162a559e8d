// .rdx file -> scene and a tree that views the mapped file.
#include <raydix/error.h>
#include <raydix/rdx.h>

#include <fmt/format.h>

#include <system_error>

#include "api/rdx_parse.h"
#include "exec/mapped_file.h"
#include "measure/stopwatch.h"

namespace raydix {

RdxFile load_rdx(const std::filesystem::path& file) {
    Stopwatch watch;
    MappedFile mapped;
    try {
        mapped = map_file(file);
    } catch (const std::system_error& error) {
        throw InputError(fmt::format("{}: file: {}", file.string(), error.what()));
    }
    RdxFile result = rdx::parse(file.string(), mapped.bytes, mapped.owner);
    result.scene.load_ms = watch.lap();
    return result;
}

}  // namespace raydix
