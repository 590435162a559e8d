// Calls of distance and overlap on scenes: their names, and what they refuse.
#pragma once

#include <raydix/error.h>

#include <cstddef>
#include <cstdint>
#include <string>

#include "engine/shape_tree.h"

namespace raydix {

enum class NearCall { closest, overlap, sweep };
/// As errors name it.
inline const char* name_of(NearCall call) {
    constexpr const char* names[] = {"closest points", "overlap queries", "sweeps"};
    return names[static_cast<std::size_t>(call)];
}

/// Of a geometry that the mask shows, on a path of instances: InputError, which names both, if the
/// call has no answer for it. Shapes: ShapeTree or ShapeTreeD.
template <class Shapes>
void require_answers(const Shapes& shapes, std::uint32_t path, NearCall call) {
    const auto refuse = [&](const char* why) {
        throw InputError(std::string(name_of(call)) + ": " + name_of(shapes, path) + " " + why);
    };
    if (call == NearCall::sweep) refuse("cannot be swept against: only triangles can");
    if (shapes.user() != nullptr) refuse("has no distances: it is known by its hits alone");
}

}  // namespace raydix
