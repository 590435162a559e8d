// The order of hits in a scene.
#pragma once

#include <raydix/types.h>

#include <algorithm>
#include <cstddef>
#include <tuple>

#include "exec/result_budget.h"

namespace raydix {

/// Where hits stand in order: at equal t the least instance, geometry and triangle. AnyHit: Hit or
/// HitD.
template <class AnyHit>
inline auto order_of(const AnyHit& hit) {
    return std::tuple(hit.t, hit.instance, hit.geometry, hit.prim);
}

/// Sorts what one ray hit, hits[before] on. A triangle that is in several leaves was found more
/// than once, with the same t: the others go.
template <class AnyHit>
inline void finish_scene_ray(BudgetVector<AnyHit>& hits, std::size_t before) {
    const auto first = hits.begin() + static_cast<std::ptrdiff_t>(before);
    std::sort(first, hits.end(),
              [](const AnyHit& a, const AnyHit& b) { return order_of(a) < order_of(b); });
    hits.erase(std::unique(first, hits.end(),
                           [](const AnyHit& a, const AnyHit& b) {
                               return a.instance == b.instance && a.geometry == b.geometry &&
                                      a.prim == b.prim;
                           }),
               hits.end());
}

}  // namespace raydix
