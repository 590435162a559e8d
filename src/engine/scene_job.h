// A job of rays through a scene: what it is asked, what it answers, and the memory that it works
// in. The work is in scene_walk.h, compiled once per instruction set.
#pragma once

#include <raydix/scene.h>
#include <raydix/user_geometry.h>

#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "engine/scene_tree.h"
#include "exec/result_budget.h"
#include "trace/ray_frame.h"
#include "trace/simd/simd_kernels.h"
#include "trace/simd/wide_batch.h"

namespace raydix {

/// The end of a ray in units of `scale`: t of the caller's ray = scale * t there, and finite.
[[nodiscard]] inline float end_in_units(double scale, float t) {
    if (scale == 1.0) return t;
    constexpr float most = std::numeric_limits<float>::max();
    return static_cast<float>(double{t < most ? t : most} / scale);
}

/// A ray in the space of a scene, in double. Its direction is near unit length, by a power of two.
/// The fourth component of each is 0.
struct SceneLine {
    alignas(32) double origin[4];
    alignas(32) double direction[4];
    double scale;  // t of the caller's ray = scale * t here

    /// The start of the caller's ray.
    [[nodiscard]] float start(float t) const { return scale == 1.0 ? t : start_in_units(t, scale); }
    /// Its end, which must be finite.
    [[nodiscard]] float end(float t) const { return end_in_units(scale, t); }
};

/// Where a ray of a level comes from.
struct SceneRaySource {
    double scale;      // t of the caller's ray = scale * t here
    std::uint32_t id;  // in the job
};

/// The rays in the space of one scene, on one level of instances. Their directions are near unit
/// length, by powers of two.
struct SceneLevel {
    std::size_t count = 0;
    std::vector<Ray> rays;  // tmax: as far as they still go
    std::vector<SceneRaySource> sources;
    // Of scenes that hold instances, below the first level: what floats do not have of the rays.
    std::vector<SceneLine> lines;
    // Of the jobs that triangles get.
    std::vector<TreeHit> hits;
    std::vector<std::uint8_t> occluded;
    std::vector<std::uint32_t> seen;  // those of a list that may see something
    std::vector<Ray> listed;          // of all hits: the rays of a list
    std::vector<std::uint64_t> hit_counts;
    StreamMemory parts_memory, mesh_memory;
    StackMemory parts_stack, mesh_stack;

    /// No rays, and room for `most`.
    void begin(std::size_t most, bool with_lines) {
        count = 0;
        // The last to grow is asked: memory may have ended before.
        if (sources.size() < most) rays.resize(most), sources.resize(most);
        if (with_lines && lines.size() < most) lines.resize(most);
    }
};

/// Rays at a primitive of the caller's, as its function gets them.
class UserRays {
public:
    /// None yet, and room for `most`.
    void begin(std::uint32_t most) {
        count_ = 0;
        if (hits_.size() < most)  // the last to grow
            rays_.resize(most), places_.resize(most), sources_.resize(most), hits_.resize(most);
    }
    /// `number`: of the ray in its level; `scale`: t of the caller's ray = scale * t of this one.
    void add(const Ray& ray, double scale, std::uint32_t number, std::size_t place) {
        rays_[count_] = ray;
        places_[count_] = place;
        sources_[count_] = {scale, number};
        hits_[count_++] = {};
    }
    [[nodiscard]] std::uint32_t count() const { return count_; }
    [[nodiscard]] std::uint32_t number(std::uint32_t k) const { return sources_[k].id; }
    [[nodiscard]] double scale(std::uint32_t k) const { return sources_[k].scale; }
    [[nodiscard]] RaysAtPrimitive at_primitive() {
        return {rays_.data(), places_.data(), hits_.data(), count_};
    }
    [[nodiscard]] const TreeHit& hit(std::uint32_t k) const { return hits_[k]; }

private:
    std::uint32_t count_ = 0;
    std::vector<Ray> rays_;
    std::vector<std::size_t> places_;
    std::vector<SceneRaySource> sources_;
    std::vector<TreeHit> hits_;
};

/// Memory is kept from job to job. Not for two threads at once.
struct SceneJob {
    // At most max_job_rays rays, rays[order[k]], or rays[k] without an order.
    const SceneTree* tree = nullptr;
    const SimdKernels* kernels = nullptr;
    const Ray* rays = nullptr;
    const std::uint32_t* order = nullptr;
    std::size_t n = 0;
    std::size_t first = 0;  // the place of rays[0] among the caller's
    std::uint32_t mask = 0;
    const std::uint32_t* masks = nullptr;  // [rays] instead; or null
    const HitFilter* filter = nullptr;     // or null
    bool any = false;                      // any hit will do; only prim of a hit has a meaning
    bool packets = false;                  // neighbours are alike: triangles take packets of them
    bool single = false;                   // rays go alone
    bool turns = false;                    // if so: some of them in turn

    std::vector<Hit> hits;  // [n], by k
    // Of all hits: those of each ray behind those of the one before, sorted; how many [n].
    BudgetVector<Hit>* found = nullptr;
    std::uint64_t* hit_counts = nullptr;
    std::uint32_t* visits = nullptr;  // of steps: the nodes that each ray visits [n]
    std::uint64_t invalid = 0;

    struct Limits {
        float tmin, reach;  // of the caller's ray; reach: as far as it still goes
        std::uint32_t mask;
    };
    std::vector<Limits> limits;  // [n]
    UserRays user_rays;
    StackMemory single_stack;  // of rays that go alone, for all levels
    std::vector<std::unique_ptr<SceneLevel>> levels;

    /// Of ray k among the caller's.
    [[nodiscard]] std::size_t place(std::size_t k) const {
        return first + (order == nullptr ? k : order[k]);
    }
    /// Ray k as the caller has it.
    [[nodiscard]] const Ray& ray(std::size_t k) const {
        return rays[order == nullptr ? k : order[k]];
    }
    /// Whether the filter takes a hit of ray k.
    [[nodiscard]] bool accepts(std::size_t k, const Hit& hit) const {
        return (*filter)(place(k), ray(k), hit);
    }
    [[nodiscard]] SceneLevel& level(std::size_t depth) {
        while (levels.size() <= depth) levels.push_back(std::make_unique<SceneLevel>());
        return *levels[depth];
    }
};

struct SceneKernels {
    std::string_view isa;
    void (*trace)(SceneJob& job);
    void (*all_hits)(SceneJob& job);
    void (*steps)(SceneJob& job);
    /// `filter` may be null; `place`: of the ray among the caller's; `stack` has room for
    /// SceneTree::stack_size; `history`: of the calls of this thread. For any hit only prim has a
    /// meaning.
    using OneRayOfScene = Hit(const SceneTree& scene, const Ray& ray, std::uint32_t mask,
                              const HitFilter* filter, std::size_t place,
                              const WideStackView& stack, CallHistory& history);
    OneRayOfScene* closest;
    OneRayOfScene* any;
};

/// Empty: the best. The names are those of simd_kernels().
[[nodiscard]] const SceneKernels& scene_kernels_for(std::string_view isa);

}  // namespace raydix
