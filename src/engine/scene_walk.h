// Rays of one job through a scene: down its tree over parts, at each part with all rays that reach
// it, through the inverses of instances into their scenes, and on from there.
#pragma once

#include <raydix/scene.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "engine/scene_tree.h"
#include "instances/affine.h"
#include "trace/simd/simd_kernels.h"
#include "trace/simd/wide_batch.h"

namespace raydix {

/// What a job of rays wants.
struct SceneQuery {
    const SimdKernels* kernels;
    bool any;      // any hit will do
    bool packets;  // neighbours are alike: meshes take them as packets
};

/// Memory is kept from job to job. Not for two threads at once.
class SceneWalk {
public:
    /// Rays of a job, at most.
    static constexpr std::size_t max_rays = max_job_rays;

    SceneWalk();
    ~SceneWalk();

    /// Before each job. The tree must stay until its end.
    void begin(const SceneTree& tree, const SceneQuery& query);
    /// Rays of a job are numbered from 0. The ray must be valid.
    void add(const Ray& ray, std::uint32_t mask);
    void trace();
    /// Of the ray that was added as number k; for any hit only prim has a meaning.
    [[nodiscard]] const SceneHit& hit(std::size_t k) const { return best_[k]; }

private:
    struct Level;
    class Visitor;

    /// A ray of the job into a level, whose last one it becomes. False if it can hit nothing there.
    bool enter(Level& level, std::uint32_t id, WideRayLine line, double scale) const;
    void walk(std::size_t depth, const SceneTree& tree, std::uint32_t number);
    void visit(std::size_t depth, const SceneTree& tree, std::uint32_t number, std::uint32_t part,
               const std::uint32_t* rays, std::uint32_t count);
    void visit_instance(std::size_t depth, const PlacedScene& placed, std::uint32_t number,
                        const std::uint32_t* rays, std::uint32_t count);
    /// `rays` null: all of the level.
    void visit_mesh(Level& level, const MeshTree& mesh, std::uint32_t number,
                    const std::uint32_t* rays, std::uint32_t count);
    void take(Level& level, const MeshTree& mesh, std::uint32_t number, std::uint32_t ray);
    /// The ray ends where it hits.
    void shorten(Level& level, std::uint32_t ray) const;
    [[nodiscard]] Level& level(std::size_t depth);

    struct JobRay {
        float tmin, tmax;
        std::uint32_t mask;
    };
    const SceneTree* tree_ = nullptr;
    SceneQuery query_{};
    std::vector<JobRay> rays_;
    std::vector<SceneHit> best_;
    std::vector<std::unique_ptr<Level>> levels_;
};

}  // namespace raydix
