// Lengths of the arrays of a filter against what the scene holds.
#include "array_filter.h"

#include <raydix/error.h>
#include <raydix/surface.h>

#include <string>

namespace raydix::python {
namespace {

/// `place`: (instance, geometry), of the last commit.
template <class Scalar>
bool has_primitive(const BasicScene<Scalar>& scene, std::pair<std::uint32_t, std::uint32_t> place,
                   std::uint64_t prim) {
    if (prim >= no_primitive) return false;
    BasicHit<Scalar> hit;
    hit.t = 0;
    hit.prim = static_cast<std::uint32_t>(prim);
    hit.instance = place.first;
    hit.geometry = place.second;
    const BasicRay<Scalar> ray{};
    BasicVec3<Scalar> point{};
    try {
        positions(scene, std::span(&ray, 1), std::span<const BasicHit<Scalar>>(&hit, 1),
                  std::span(&point, 1), 1);
        return true;
    } catch (const InputError&) {
        return false;
    }
}

}  // namespace

template <class Scalar>
void require_lengths(const ArrayFilter& filter, const BasicScene<Scalar>& scene) {
    for (const auto& entry : filter.seen) {
        const auto& place = entry.first;
        const std::size_t given = entry.second.size();
        const auto has = [&](std::uint64_t prim) { return has_primitive(scene, place, prim); };
        if (!has(0) || (given != 0 && has(given - 1) && !has(given))) continue;
        std::uint64_t some = 0, count = no_primitive;
        while (count - some > 1) {
            const std::uint64_t middle = some + (count - some) / 2;
            (has(middle) ? some : count) = middle;
        }
        throw InputError("keep: geometry " + std::to_string(place.second) + " has " +
                         std::to_string(count) + " primitives, but its array has " +
                         std::to_string(given) + " values");
    }
}

template void require_lengths(const ArrayFilter&, const Scene&);
template void require_lengths(const ArrayFilter&, const SceneD&);

}  // namespace raydix::python
