// All hits of the rays of a job that go through a scene together. Included once per instruction
// set.
#if defined(RAYDIX_ENGINE_SCENE_ALL_HITS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_ENGINE_SCENE_ALL_HITS_H
#undef RAYDIX_ENGINE_SCENE_ALL_HITS_H
#else
#define RAYDIX_ENGINE_SCENE_ALL_HITS_H
#endif

#include <hwy/highway.h>

#include <bit>

#include "engine/scene_job.h"
#include "engine/scene_ray.h"
#include "trace/hit_rows.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Hits of a job, of all its rays in no order: above the number of the path each has the number of
/// its ray.
class HitsOfJob {
public:
    explicit HitsOfJob(SceneJob& job)
        : job_(job), before_(job.found->size()), path_bits_(bits_of_path(job)) {}

    /// Whether the numbers of rays and of paths have room beside each other.
    static bool has_room(const SceneJob& job) {
        return job.n == 0 || bits_of_path(job) + static_cast<int>(std::bit_width(job.n - 1)) <= 32;
    }

    [[nodiscard]] BudgetVector<Hit>& found() { return *job_.found; }
    /// found()[first] on are of ray `id`.
    void give(std::size_t first, std::uint32_t id) {
        for (std::size_t k = first; k < found().size(); ++k) name(found()[k], id);
    }
    /// A hit of a shape, in units of `scale`.
    void add(const ShapeTree& tree, std::uint32_t number, double scale, const TreeHit& at,
             std::uint32_t id) {
        Hit hit{at, tree.id, number};
        hit.t = static_cast<float>(double{at.t} * scale) + 0.0f;
        name(hit, id);
        found().push_back(hit);
    }
    /// Rays of a level through a mesh: all, or those of a list. Kernel: of a tree.
    template <class Kernel>
    void trace_mesh(const SimdJob& rays, SceneLevel& level, const MeshTree& mesh,
                    std::uint32_t number, const Kernel& kernel) {
        SimdJob job = rays;
        job.hits = {};
        if (rays.order != nullptr) {  // kernels take no order here
            level.listed.resize(rays.n);
            for (std::size_t k = 0; k < rays.n; ++k) level.listed[k] = rays.rays[rays.order[k]];
            job.rays = level.listed.data();
            job.order = nullptr;
        }
        level.hit_counts.resize(rays.n);
        job.all = &found();
        job.hit_counts = level.hit_counts.data();
        std::size_t at = found().size();
        SimdCounts counts;
        kernel(job, counts);
        for (std::size_t k = 0; k < rays.n; ++k) {
            const SceneRaySource& source = level.sources[rays.order ? rays.order[k] : k];
            for (std::uint64_t i = 0; i < level.hit_counts[k]; ++i, ++at) {
                Hit& hit = found()[at];
                hit.t = static_cast<float>(double{hit.t} * source.scale) + 0.0f;
                hit.instance = number;
                mesh.name(hit);
                name(hit, source.id);
            }
        }
    }

    /// In the end: those of each ray behind those of the one before.
    void put_in_order() {
        put_in_rows(found(), before_, std::span(job_.hit_counts, job_.n), Rows{path_bits_});
    }

private:
    struct Rows {
        int path_bits;

        [[nodiscard]] std::uint32_t ray(const Hit& hit) const {
            return static_cast<std::uint32_t>(std::uint64_t{hit.instance} >> path_bits);
        }
        [[nodiscard]] Hit bare(Hit hit) const {
            hit.instance &= static_cast<std::uint32_t>((std::uint64_t{1} << path_bits) - 1);
            return hit;
        }
        static bool is_before(const Hit& a, const Hit& b) { return order_of(a) < order_of(b); }
        static bool same(const Hit& a, const Hit& b) {
            return a.instance == b.instance && a.geometry == b.geometry && a.prim == b.prim;
        }
    };

    static int bits_of_path(const SceneJob& job) {
        return static_cast<int>(std::bit_width(job.tree->paths));
    }
    void name(Hit& hit, std::uint32_t id) const {
        hit.instance |= static_cast<std::uint32_t>(std::uint64_t{id} << path_bits_);
    }

    SceneJob& job_;
    const std::size_t before_;
    const int path_bits_;
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
