// All hits by testing every triangle under the half-open edge rule: the reference of trace_all.
#pragma once

#include <raydix/double.h>
#include <raydix/trace.h>

#include <span>

namespace raydix::attack {

AllHits brute_all(const MeshView& mesh, std::span<const Ray> rays);
AllHitsD brute_all(const MeshViewD& mesh, std::span<const RayD> rays);

}  // namespace raydix::attack
