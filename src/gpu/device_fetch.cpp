#include "gpu/device_fetch.h"

#include <raydix/error.h>

#include <string>

#include "base/options.h"

namespace raydix {
namespace {

const char* name_of(PrimitiveKind kind) {
    switch (kind) {
        case PrimitiveKind::triangles:
            return "triangle";
        case PrimitiveKind::boxes:
            return "box";
        default:
            return "point";
    }
}

}  // namespace

void check_device_input(PrimitiveKind kind, std::uint32_t n, PrimitiveKind expected,
                        std::uint32_t capacity) {
    if (kind != expected)
        throw InputError(std::string("this memory is for a tree of another kind than a ") +
                         name_of(kind));
    if (n > capacity)
        throw InputError(std::to_string(n) + " primitives; this memory is for " +
                         std::to_string(capacity));
}

void check_counts(const DeviceInputCounts& counts, PrimitiveKind kind, bool strict) {
    if (counts.unreadable != 0)
        throw InputError(std::string(name_of(kind)) + " " +
                         std::to_string(counts.first_unreadable) +
                         ": an index is past the last of the vertices");
    if (strict && counts.left_out != 0)
        throw InputError(std::string(name_of(kind)) + " " + std::to_string(counts.first_left_out) +
                         ": not finite, out of range or inverted" + others_too(counts.left_out));
}

}  // namespace raydix
