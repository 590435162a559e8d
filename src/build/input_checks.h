// What every build asks of its input before it starts.
#pragma once

#include <raydix/error.h>

#include <algorithm>
#include <string>

#include "base/options.h"
#include "primitives/bounds.h"

namespace raydix {

/// Names the primitive that stops a build, if there is one.
template <class Source>
void check_bounds(const Bounds& bounds, const Source& source, const char* kind, bool strict) {
    if constexpr (requires { source.vertex_count; }) {
        if (bounds.first_unreadable != no_primitive) {
            const Triangle& t = source.triangles[bounds.first_unreadable];
            throw InputError(std::string(kind) + " " + std::to_string(bounds.first_unreadable) +
                             ": index " + std::to_string(std::max({t[0], t[1], t[2]})) +
                             " is past the last of " + std::to_string(source.vertex_count) +
                             " vertices");
        }
    }
    if (strict && bounds.left_out != 0)
        throw InputError(std::string(kind) + " " + std::to_string(bounds.first_left_out) +
                         ": not finite, out of range or inverted" + others_too(bounds.left_out));
}

}  // namespace raydix
