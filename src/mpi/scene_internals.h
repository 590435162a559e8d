// What the renderer asks a distributed scene for and users do not.
#pragma once

#include <raydix/mpi.h>

#include <span>
#include <vector>

#include "base/double3.h"
#include "mpi/communicator.h"

namespace raydix::mpi {

template <class Scalar>
struct DistributedSceneInternals {
    using DistributedOf = BasicDistributedScene<Scalar>;
    using Box = BasicAabb<Scalar>;
    using Ray = typename DistributedOf::Ray;
    using Hit = typename DistributedOf::Hit;

    [[nodiscard]] static const Communicator& communicator(const DistributedOf& scene);
    /// Around what all ranks hold; lo > hi if that is nothing.
    [[nodiscard]] static Box bounds(const DistributedOf& scene);
    /// Collective. Closest hits. normals [rays]: set for those that hit, as Tracer::closest.
    [[nodiscard]] static std::vector<Hit> trace(const DistributedOf& scene,
                                                std::span<const Ray> rays,
                                                std::span<Double3> normals);
};
extern template struct DistributedSceneInternals<float>;
extern template struct DistributedSceneInternals<double>;

}  // namespace raydix::mpi
