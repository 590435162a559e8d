#include "io/rdx_faults.h"

#include <fmt/format.h>

#include "base/math.h"
#include "exec/parallel.h"
#include "primitives/double_sources.h"

namespace raydix::rdx {
namespace {

template <class Set>
Fault fault_of(const Set& set) {
    constexpr std::uint32_t largest_side = 65536;
    const auto is_side = [](std::uint32_t side) { return side >= 1 && side <= largest_side; };
    if (!is_side(set.width) || !is_side(set.height))
        return fmt::format("info: a picture of {} x {}; sides are 1 to {}", set.width, set.height,
                           largest_side);
    if (!(set.ao_radius >= 0.0f && set.ao_radius <= max_coordinate))
        return fmt::format("info: ao_radius {} is not in 0..{}", set.ao_radius, max_coordinate);
    for (std::size_t i = 0; i < set.cameras.size(); ++i) {
        const auto& camera = set.cameras[i];
        if (!in_range(camera.position) || !in_range(camera.target) || !in_range(camera.up))
            return fmt::format("cameras: camera {} is not finite or beyond {}", i, max_coordinate);
        if (!(camera.vfov > 0 && camera.vfov < 180))
            return fmt::format("cameras: camera {} has the angle {}, not between 0 and 180", i,
                               camera.vfov);
    }
    return {};
}

}  // namespace

Fault camera_fault(const CameraSet& set) { return fault_of(set); }
Fault camera_fault(const CameraSetD& set) { return fault_of(set); }

Fault content_fault(const Bvh& bvh, const Mesh& mesh, const CameraSet& cameras) {
    if (Fault fault = camera_fault(cameras)) return fault;
    const MeshView view = mesh;
    Fault fault;
    with_threads(0, [&] { fault = validate(bvh, &view); });
    return fault;
}

}  // namespace raydix::rdx
