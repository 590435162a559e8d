// What strict scenes ask of a mesh before they take it.
#pragma once

#include <raydix/double.h>
#include <raydix/error.h>
#include <raydix/mesh.h>

#include <cstddef>
#include <cstdint>
#include <string>

namespace raydix::python {

/// Throws InputError that names the mesh and its first triangle that trees leave out.
inline void require_all_valid(const std::string& name, const MeshView& mesh, int) {
    const auto left_out = [&](std::size_t triangles) {
        return inspect({mesh.vertices, mesh.triangles.first(triangles)}).left_out_triangles;
    };
    const std::uint64_t all = left_out(mesh.triangles.size());
    if (all == 0) return;
    std::size_t none = 0, some = mesh.triangles.size();
    while (some - none > 1) {
        const std::size_t middle = none + (some - none) / 2;
        (left_out(middle) == 0 ? none : some) = middle;
    }
    throw InputError(name + ": triangle " + std::to_string(none) +
                     " is not finite or out of range" +
                     (all == 1   ? ""
                      : all == 2 ? ", as is 1 other"
                                 : ", as are " + std::to_string(all - 1) + " others"));
}

/// The same: the library counts them in double only where it builds.
inline void require_all_valid(const std::string& name, const MeshViewD& mesh, int threads) {
    try {
        static_cast<void>(
            build_bvh(mesh, {.builder = Builder::apetrei, .strict = true, .threads = threads}));
    } catch (const InputError& error) {
        throw InputError(name + ": " + error.what());
    }
}

}  // namespace raydix::python
