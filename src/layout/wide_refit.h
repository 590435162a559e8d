// A wide tree around triangles that have moved: nodes and leaves stay, boxes are fitted again.
#pragma once

#include <raydix/mesh.h>
#include <raydix/wide.h>

#include <optional>

namespace raydix {

/// Its stats().sah is that of the tree as it is now. None where the tree cannot be kept: it is
/// compact, or empty, or holds parts of triangles; there is another number of triangles; one of the
/// tree is not finite, out of range or without area now; or one that was left out could be hit now.
/// The same bits for every thread count. The indices must be within the vertices.
[[nodiscard]] std::optional<WideBvh> refit_wide(const WideBvh& tree, const MeshView& mesh);

}  // namespace raydix
