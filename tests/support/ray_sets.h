// Rays that tracers get wrong: aimed at vertices and edges, in the planes of boxes, with components
// of 0, with limits, from surfaces, of any length.
#pragma once

#include <raydix/model.h>

#include <cstdint>
#include <string_view>
#include <vector>

namespace raydix::test {

enum class RaySet {
    camera,       // primary rays of the scene's first camera
    through_box,  // between two random points of the box
    at_vertex,
    at_edge,         // at the middle of an edge
    axis_aligned,    // along an axis; the other coordinates are those of a vertex
    zero_component,  // one component 0 or -0, that coordinate is a vertex's
    short_tmax,
    tmin_above_zero,
    from_surface,  // starts on a triangle
    any_length,    // directions from 1e-30 to 1e30
    along_edge,    // in the plane of a triangle
    count
};
std::string_view name_of(RaySet set);

/// `count` rays of one kind; the same for the same seed.
std::vector<Ray> make_rays(const Model& scene, RaySet set, std::size_t count, std::uint64_t seed);
/// `count` rays, the same number of every kind.
std::vector<Ray> make_mixed_rays(const Model& scene, std::size_t count, std::uint64_t seed);

}  // namespace raydix::test
