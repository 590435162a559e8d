// Which hits count, by arrays: what each ray leaves out, and which primitives rays see at all.
#pragma once

#include <raydix/double.h>
#include <raydix/scene.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <utility>

namespace raydix::python {

/// Views of arrays that somebody else keeps.
struct ArrayFilter {
    /// Of each ray: the primitive that it leaves out; all empty, or of one length.
    std::span<const std::uint32_t> prims, geometries, instances;
    /// (instance, geometry) -> whether rays see its primitives, all of them; of others they see
    /// all.
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::span<const bool>> seen;

    template <class AnyHit>
    [[nodiscard]] bool takes(std::size_t ray, const AnyHit& hit) const {
        if (!prims.empty() && hit.prim == prims[ray] && hit.geometry == geometries[ray] &&
            hit.instance == instances[ray])
            return false;
        const auto found = seen.find({hit.instance, hit.geometry});
        return found == seen.end() || found->second[hit.prim];
    }
};

/// Throws InputError for an array of `seen` that has another length than its geometry has
/// primitives by the scene's last commit. Geometries that the scene does not have are passed over.
template <class Scalar>
void require_lengths(const ArrayFilter& filter, const BasicScene<Scalar>& scene);
extern template void require_lengths(const ArrayFilter&, const Scene&);
extern template void require_lengths(const ArrayFilter&, const SceneD&);

}  // namespace raydix::python
