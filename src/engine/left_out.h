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

/// Names the first of n primitives that builders leave out, and tells how many others they do.
/// Returns if they leave out none.
template <class Box, class Source>
void refuse_left_out(std::uint32_t geometry, const char* kind, const Source& source,
                     std::size_t n) {
    std::uint64_t count = 0;
    std::uint32_t first = 0;
    for (std::uint32_t i = 0; i < n; ++i) {
        Box box;
        if (!source.box(i, box) && count++ == 0) first = i;
    }
    if (count == 0) return;
    throw InputError("geometry " + std::to_string(geometry) + ": " + kind + ' ' +
                     std::to_string(first) + ": not finite, out of range or inverted" +
                     others_too(count));
}

}  // namespace raydix
