// The workloads of `bench cpu`: rays as clients of a ray tracer send them. Scene, cameras and seed
// -> batches of rays.
#pragma once

#include <raydix/model.h>
#include <raydix/scene.h>
#include <raydix/types.h>

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "cpu_options.h"

namespace raydix::bench {

/// NAME, or NAME@N: the rays of NAME in calls of N.
struct Workload {
    std::string text, kind;          // as it is written; NAME
    std::size_t call_rays = 0;       // N; 0: each batch is one call
    [[nodiscard]] bool any() const;  // asks whether anything is hit, not for the closest hit
};
/// Those that NAME may be, separated by commas.
[[nodiscard]] std::string workload_kinds();
/// Names separated by commas, or "all": those that run unless others are asked for. Throws
/// CLI::ValidationError for one that does not exist.
[[nodiscard]] std::vector<Workload> workloads_from(const std::string& names);

/// Rays that are timed in one go. Each call takes those that the one before has left, up to `ends`.
struct Portion {
    std::vector<Ray> rays;
    std::vector<std::size_t> ends;  // of each call
};

/// Makes the rays of one scene.
class WorkloadRays {
public:
    /// `scene` holds the mesh of `model` alone. Both must outlive this, and the options too.
    WorkloadRays(const CpuBench& options, const Model& model, const Scene& scene);

    /// Calls visit(portion, part of the work done). A portion holds up to four million rays, or one
    /// batch that has more.
    void for_each(const Workload& workload,
                  const std::function<void(const Portion&, double)>& visit) const;

private:
    /// Rays with what they hit, in the order of the pixels' Morton curve.
    struct Wave {
        std::vector<Ray> rays;
        std::vector<Hit> hits;
        std::vector<std::uint32_t> pixels;
    };
    using VisitBatch = std::function<void(std::span<const Ray>, double)>;

    void for_each_batch(const Workload& workload, const VisitBatch& visit) const;
    [[nodiscard]] std::vector<Ray> view_rays(const std::string& kind, std::size_t view) const;
    [[nodiscard]] Wave traced(std::vector<Ray> rays, std::vector<std::uint32_t> pixels) const;
    [[nodiscard]] std::vector<Ray> scattered(const Wave& wave, std::uint32_t rays_a_hit, float tmax,
                                             std::uint64_t seed) const;
    [[nodiscard]] std::vector<Ray> bounced(const Wave& primary, int bounce) const;
    [[nodiscard]] std::vector<Ray> lamp_rays(const Wave& wave, bool area) const;
    [[nodiscard]] std::vector<Ray> lidar_turn(std::size_t turn) const;
    [[nodiscard]] std::vector<Ray> random_rays(std::size_t count) const;
    [[nodiscard]] std::vector<Ray> outside_rays(std::size_t count) const;

    const CpuBench& options_;
    const Model& model_;
    const Scene& scene_;
    Aabb box_;
    double diagonal_;
    std::vector<Camera> cameras_;
    std::vector<Wave> views_;   // primary rays of each camera
    std::size_t picture_rays_;  // of all cameras
};

}  // namespace raydix::bench
