// What every build on a device begins with, as launches for any backend: primitives -> their bounds
// and how many are valid -> codes -> sorted keys and ids. What the data decides is never asked for
// by the host.
#pragma once

#include <raydix/device.h>

#include <cstdint>
#include <limits>

#include "exec/arena.h"
#include "exec/host_launcher.h"  // SortArrays
#include "keys/encode_launches.h"
#include "primitives/bounds_launches.h"

namespace raydix {

/// Stands in for memory while sizes are added up: an arena that hands out addresses nobody reads.
inline Arena sizing_arena() {
    return {reinterpret_cast<void*>(Arena::alignment), std::numeric_limits<std::size_t>::max() / 2};
}

/// What the bounds found out; all else in the header is 0.
template <class Counts>
struct PublishCounts {
    const BoundsPart* bounds;
    std::uint32_t input_count;
    Counts* counts;
    RAYDIX_HD void operator()(std::uint32_t) const {
        *counts = Counts{};
        static_cast<DeviceInputCounts&>(*counts) = {bounds->box,
                                                    input_count,
                                                    bounds->valid,
                                                    bounds->left_out,
                                                    bounds->first_left_out,
                                                    bounds->unreadable,
                                                    bounds->first_unreadable};
    }
};

/// Between the stages a caller may look at the time.
struct NoMarks {
    void operator()(const char*) const {}
};

template <class Key>
struct SortedPrimitives {
    const BoundsPart* bounds;    // [1]
    const Key* keys;             // [n] ascending
    const std::uint32_t* count;  // [1]: the first so many are valid
};

/// `order` [n], out: ids by ascending code. Without primitives only `counts` is written.
/// `mark(stage)` is called behind the launches of each stage.
template <class Key, class Launcher, class Source, class Counts, class Mark>
SortedPrimitives<Key> launch_sorted(Launcher& launcher, Arena& arena, const Source& source,
                                    std::uint32_t n, Counts* counts, std::uint32_t* order,
                                    const Mark& mark) {
    auto* bounds = arena.take<BoundsPart>(1);
    const BoundsScratch bounds_scratch(arena);
    launch_bounds(launcher, source, n, bounds_scratch, bounds);
    launcher.launch("bounds.publish", 1, PublishCounts<Counts>{bounds, n, counts});
    mark("bounds");
    if (n == 0) return {bounds, nullptr, &counts->references};

    auto* keys = arena.take<Key>(n);
    auto* sorted_keys = arena.take<Key>(n);
    auto* ids = arena.take<std::uint32_t>(n);
    launch_encode(launcher, source, n, bounds, keys, ids);
    mark("codes");

    // All bits: what is left out has the highest key of all and goes to the end.
    launcher.sort_pairs("sort", SortArrays<Key>{keys, ids, sorted_keys, order}, n, nullptr,
                        static_cast<int>(8 * sizeof(Key)));
    mark("sort");
    return {bounds, sorted_keys, &counts->references};
}

/// Calls `visit(source, n, copies)` with what the mesh is made of: triangles, or else points.
template <class Arrays, class Visit>
void with_source(const DeviceMesh& mesh, const Arrays& arrays, const Visit& visit) {
    if (mesh.triangle_count == 0)
        visit(PointSource{mesh.vertices}, mesh.vertex_count, arrays.points);
    else
        visit(TriangleSource{mesh.vertices, mesh.triangles, mesh.vertex_count}, mesh.triangle_count,
              arrays.triangles);
}

}  // namespace raydix
