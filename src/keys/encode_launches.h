// Primitives [n] -> keys [n] and ids [n] to sort, as one launch for any backend. The scene's box is
// read where the launch runs: the host need not know it.
#pragma once

#include <cstdint>

#include "base/hd.h"
#include "keys/morton.h"
#include "primitives/bounds_launches.h"

namespace raydix {

template <class Source, class Key>
struct EncodeInScene {
    Source source;
    const BoundsPart* bounds;
    Key* keys;           // [n], out
    std::uint32_t* ids;  // [n], out

    RAYDIX_HD void operator()(std::uint32_t i) const {
        ids[i] = i;
        if (!source.readable(i)) {
            keys[i] = left_out_key<Key>;
            return;
        }
        const Grid grid = make_grid(bounds->box, CodeFormat<Key>::axis_bits);
        EncodeMorton<Source, Key>{source, grid, keys}(i);
    }
};

template <class Launcher, class Source, class Key>
void launch_encode(Launcher& launcher, const Source& source, std::uint32_t n,
                   const BoundsPart* bounds, Key* keys, std::uint32_t* ids) {
    launcher.launch("keys.encode", n, EncodeInScene<Source, Key>{source, bounds, keys, ids});
}

}  // namespace raydix
