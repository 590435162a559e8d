// What a strict commit says of triangles and shapes that rays would never meet.
#pragma once

#include <raydix/error.h>
#include <raydix/mesh.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "base/options.h"
#include "primitives/double_sources.h"
#include "primitives/sources.h"

namespace raydix {

inline TriangleSource source_of(const MeshView& mesh) {
    return {mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
}
inline TriangleSourceD source_of(const MeshViewD& mesh) {
    return {mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
}
inline BoxSource source_of(std::span<const Aabb> boxes) { return {boxes.data()}; }
inline BoxSourceD source_of(std::span<const AabbD> boxes) { return {boxes.data()}; }

/// Names the first primitive that builders leave out, of n of which they left out `count`. Returns
/// if they leave out none.
template <class Box, class Source>
void refuse_left_out(std::uint32_t geometry, const char* kind, const Source& source, std::size_t n,
                     std::uint64_t count) {
    for (std::uint32_t i = 0; i < n; ++i) {
        Box box;
        if (source.box(i, box)) continue;
        throw InputError("geometry " + std::to_string(geometry) + ": " + kind + ' ' +
                         std::to_string(i) + ": not finite, out of range or inverted" +
                         others_too(count));
    }
}

}  // namespace raydix
