// Which hits count, by arrays: what each ray leaves out, and which primitives rays see at all.
#pragma once

#include <raydix/error.h>
#include <raydix/types.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>

namespace raydix::python {

/// Views of arrays that somebody else keeps.
struct ArrayFilter {
    /// Of each ray: the primitive that it leaves out; all empty, or of one length.
    std::span<const std::uint32_t> prims, geometries, instances;
    /// (instance, geometry) -> whether rays see its primitives; of others they see all.
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::span<const bool>> seen;

    /// Throws InputError if the array of a geometry ends before the primitive.
    template <class AnyHit>
    [[nodiscard]] bool takes(std::size_t ray, const AnyHit& hit) const {
        if (!prims.empty() && hit.prim == prims[ray] && hit.geometry == geometries[ray] &&
            hit.instance == instances[ray])
            return false;
        const auto found = seen.find({hit.instance, hit.geometry});
        if (found == seen.end()) return true;
        if (hit.prim >= found->second.size())
            throw InputError("keep: geometry " + std::to_string(hit.geometry) + " has primitive " +
                             std::to_string(hit.prim) + ", but its array has " +
                             std::to_string(found->second.size()) + " values");
        return found->second[hit.prim];
    }
};

}  // namespace raydix::python
