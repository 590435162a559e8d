// Hits of a tree over meshes that stand behind each other -> hits of the scene, one by one, on the
// host and on devices.
#pragma once

#include <raydix/error.h>
#include <raydix/types.h>

#include <cstddef>
#include <cstdint>
#include <string>

#include "base/hd.h"

namespace raydix {

/// Which meshes stand behind each other.
struct NamesView {
    const std::uint32_t* first;  // [count] ascending from 0: the first triangle of each
    const std::uint32_t* ids;    // [count]
    std::uint32_t count;

    [[nodiscard]] RAYDIX_HD Hit name(const TreeHit& hit) const {
        Hit named;
        named.t = hit.t;
        named.prim = hit.prim;
        named.u = hit.u;
        named.v = hit.v;
        if (hit.prim == no_primitive || count == 0) return named;
        std::uint32_t mesh = 0, end = count;  // first[mesh] <= prim
        while (end - mesh > 1) {
            const std::uint32_t middle = mesh + (end - mesh) / 2;
            (first[middle] <= hit.prim ? mesh : end) = middle;
        }
        named.prim -= first[mesh];
        named.geometry = ids[mesh];
        return named;
    }
};

/// found [n] -> hits [n].
struct NameHit {
    NamesView names;
    const TreeHit* found;
    Hit* hits;
    RAYDIX_HD void operator()(std::uint32_t i) const { hits[i] = names.name(found[i]); }
};

inline void check_name_hits(std::size_t found, std::size_t hits) {
    if (found != hits)
        throw InputError(std::to_string(found) + " hits to name, but room for " +
                         std::to_string(hits));
}

}  // namespace raydix
