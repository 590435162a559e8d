// Batches and single rays in double through scenes.
#include <raydix/buffer.h>
#include <raydix/error.h>
#include <raydix/scene.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "base/double3.h"
#include "base/float_env.h"
#include "base/options.h"
#include "engine/scene_batch.h"
#include "engine/scene_job_double.h"
#include "engine/scene_state.h"
#include "engine/trace_on_this_thread.h"
#include "exec/parallel.h"
#include "exec/path_rates.h"
#include "exec/thread_own.h"
#include "rays/place_order.h"
#include "trace/all_hits.h"
#include "trace/batch.h"
#include "trace/ray_frame.h"
#include "trace/simd/ray_order.h"
#include "trace/simd/wide_batch.h"

namespace raydix {
namespace {

using Batch = BasicSceneBatch<double>;

const SceneTreeD& checked_tree(const SceneD& scene, std::size_t rays,
                               const SceneTraceOptionsD& options) {
    const SceneTreeD& tree = *SceneInternalsD::tree(scene);
    check_options(rays, options);
    static_cast<void>(kernels_for(options.isa));
    return tree;
}

/// Rays begin to end - 1 of a batch, or order[begin] to order[end - 1].
void set_job(SceneJobD& job, const SceneTreeD& tree, const Batch& batch,
             std::span<const std::uint32_t> order, std::size_t begin, std::size_t end) {
    const std::size_t from = order.empty() ? begin : 0;
    job.tree = &tree;
    job.rays = batch.rays.data() + from;
    job.order = order.empty() ? nullptr : order.data() + begin;
    job.first = from;
    job.filter = batch.filter();
    job.n = end - begin;
    job.mask = batch.options.mask;
    job.masks = batch.options.masks.empty() ? nullptr : batch.options.masks.data() + from;
    job.hits = batch.hits == nullptr ? nullptr : batch.hits + from;
    job.occluded = batch.occluded == nullptr ? nullptr : batch.occluded + from;
}

/// look_at for rays about the center of a tree.
BatchLook look_at(const WideTreeD& tree, std::span<const RayD> rays) {
    constexpr std::size_t window = 64, windows = 32;
    std::vector<Ray> some;
    for (std::size_t w = 0; w < windows; ++w) {
        const std::size_t begin = rays.size() / windows * w;
        if (begin + window > rays.size()) break;
        for (const RayD& ray : rays.subspan(begin, window)) {
            Ray& near = some.emplace_back();
            Double3(tree.space.local(ray.origin)).round_to(near.origin);
            Double3(ray.direction).round_to(near.direction);
        }
    }
    return raydix::look_at(tree.arrays.bounds, some, rays.size());
}

/// How a batch goes.
class Plan {
public:
    Plan(const SceneTreeD& tree, const Batch& batch)
        : tree_(tree),
          automatic_(batch.options.path == SimdPath::automatic),
          filtered_(bool(batch.options.filter)),
          look_{batch.options.path, {}, false} {
        const MeshTreeD* const mesh = tree.only_mesh();
        of_mesh_ = mesh != nullptr && !mesh->tree->empty();
        together_ = of_mesh_ && !filtered_ && mesh->tree->suits_packets &&
                    batch.options.masks.empty() && (mesh->mask & batch.options.mask) != 0;
        if (automatic_ && together_) look_ = look_at(*mesh->tree, batch.rays);
        look_.kind.any = batch.hits == nullptr;
    }

    /// Rays 0 to n - 1 by trace(order, begin, end). Only rays through one mesh, without masks and
    /// filters, are sorted or come in several parts.
    template <class Trace>
    void run_in_order(std::size_t n, const Trace& trace) const {
        const bool can_sort = together_ && look_.path == SimdPath::sorted &&
                              n <= std::size_t{std::numeric_limits<std::int32_t>::max()};
        if (!can_sort || (automatic_ && n < least_rays_to_sort))
            trace(RayOrder::given, 0, n);
        else if (!automatic_)
            trace(RayOrder::sorted, 0, n);
        else
            run_in_better_order(tree_.rates.orders(look_.kind), look_.kind, n, trace);
    }

    /// Of jobs in this order.
    [[nodiscard]] JobWays ways(RayOrder order) const {
        JobWays ways;
        if (filtered_) {
            ways.add(PathWay::alone);
        } else if (!of_mesh_) {
            ways.add(PathWay::turns);
            // Rays that follow each other through little gain by no turns.
            ways.add(PathWay::alone);
        } else {
            const bool packets = together_ && look_.path == SimdPath::packet;
            ways.add(packets ? PathWay::packets : PathWay::turns);
            if (together_) ways.add(packets ? PathWay::turns : PathWay::packets);
        }
        if (!automatic_ || ways.count < 2) return ways;
        BatchKind kind = look_.kind;
        kind.sorted = order == RayOrder::sorted;
        ways.rates = &tree_.rates.ways(kind);
        return ways;
    }

private:
    const SceneTreeD& tree_;
    bool automatic_, filtered_;
    bool of_mesh_;   // one mesh with triangles is all there is
    bool together_;  // packets may take the rays
    BatchLook look_;
};

/// Rays along a curve through where they start.
Buffer<std::uint32_t> order_by_place(const WideTreeD& tree, std::span<const RayD> rays) {
    Buffer<Vec3> places(rays.size());
    for_each_index(rays.size(), [&](std::size_t i) {
        places[i] = Double3(tree.space.local(rays[i].origin)).rounded();
    });
    return raydix::order_by_place(tree.arrays.bounds, places.view());
}

/// Rays one by one, without a plan.
TraceCounts trace_few(const SceneTreeD& tree, const Batch& batch) {
    check_threads(batch.options.threads);
    const SceneKernelsD& kernels = scene_kernels_double_for(batch.options.isa);
    SceneKernelsD::OneRayOfScene* const kernel =
        batch.hits == nullptr ? kernels.any : kernels.closest;
    const HitFilterD* const filter = batch.filter();
    const ThreadOwn<SceneJobD> own;
    own->stack.reserve_words(tree.stack_size);
    const FloatEnvironment plain;
    TraceCounts counts;
    counts.rays = batch.rays.size();
    for (std::size_t k = 0; k < batch.rays.size(); ++k) {
        HitD hit;
        if (is_valid(batch.rays[k]))
            hit = kernel(tree, batch.rays[k], batch.mask(k), filter, k, own->stack.view());
        else
            ++counts.invalid_rays;
        counts.hits += hit.hit();
        batch.set(k, hit);
    }
    return counts;
}

TraceCounts trace_batch(const SceneD& scene, const Batch& batch) {
    const SceneTreeD& tree = checked_tree(scene, batch.rays.size(), batch.options);
    const std::size_t n = batch.rays.size();
    if (are_few(n, batch.options.path)) return trace_few(tree, batch);
    const SceneKernelsD& kernels = scene_kernels_double_for(batch.options.isa);
    const Plan plan(tree, batch);
    JobCounts sum;
    with_threads(batch.options.threads, [&] {
        plan.run_in_order(n, [&](RayOrder ray_order, std::size_t first, std::size_t last) {
            const Batch part = batch.part(first, last);
            Buffer<std::uint32_t> order;
            if (ray_order == RayOrder::sorted)
                order = order_by_place(*tree.only_mesh()->tree, part.rays);
            const JobWays ways = plan.ways(ray_order);
            const JobBlocks blocks = jobs_of(part.rays.size(), JobSize::small);
            std::vector<JobCounts> counts(blocks.count());
            blocks.run([&](std::size_t number, std::size_t begin, std::size_t end) {
                ways.run(begin, end, [&](PathWay way, std::size_t from, std::size_t to) {
                    const ThreadOwn<SceneJobD> own;
                    SceneJobD& job = *own;
                    set_job(job, tree, part, order.view(), from, to);
                    job.way = way;
                    kernels.trace(job);
                    counts[number] += {job.hit_count, job.invalid};
                });
            });
            for (const JobCounts& job : counts) sum += job;
        });
    });
    return sum_of({sum}, n);
}

void trace_on_this_thread(const SceneTreeD& tree, const Batch& batch) {
    const PathWay way = Plan(tree, batch).ways(RayOrder::given).ways[0];
    const ThreadOwn<SceneJobD> own;
    for (std::size_t begin = 0; begin < batch.rays.size(); begin += max_job_rays) {
        set_job(*own, tree, batch, {}, begin, std::min(begin + max_job_rays, batch.rays.size()));
        own->way = way;
        scene_kernels_double_for({}).trace(*own);
    }
}

/// For any hit only prim has a meaning.
HitD trace_one(const SceneD& scene, const RayD& ray, std::uint32_t mask, const HitFilterD* filter,
               bool any) {
    static const SceneKernelsD& kernels = scene_kernels_double_for({});
    const SceneTreeD& tree = *SceneInternalsD::tree(scene);
    const ThreadOwn<SceneJobD> own;
    StackMemory& stack = own->stack;
    stack.reserve_words(tree.stack_size);
    const auto answer = [&]() -> HitD {
        if (!is_valid(ray)) return {};
        return (any ? kernels.any : kernels.closest)(tree, ray, mask, filter, 0, stack.view());
    };
    if (FloatEnvironment::is_plain()) return answer();
    const FloatEnvironment plain;
    return answer();
}

}  // namespace

void closest_on_this_thread(const SceneTreeD& scene, std::span<const RayD> rays,
                            std::span<HitD> hits) {
    check_sizes(rays.size(), hits.size());
    const SceneTraceOptionsD options;
    trace_on_this_thread(scene, {rays, hits.data(), nullptr, options});
}

void occluded_on_this_thread(const SceneTreeD& scene, std::span<const RayD> rays,
                             std::span<std::uint8_t> occluded) {
    check_sizes(rays.size(), occluded.size());
    const SceneTraceOptionsD options;
    trace_on_this_thread(scene, {rays, nullptr, occluded.data(), options});
}

TraceCounts trace(const SceneD& scene, std::span<const RayD> rays, std::span<HitD> hits,
                  const SceneTraceOptionsD& options) {
    check_sizes(rays.size(), hits.size());
    return trace_batch(scene, {rays, hits.data(), nullptr, options});
}

std::vector<HitD> trace(const SceneD& scene, std::span<const RayD> rays,
                        const SceneTraceOptionsD& options) {
    std::vector<HitD> hits(rays.size());
    trace(scene, rays, hits, options);
    return hits;
}

TraceCounts trace_any(const SceneD& scene, std::span<const RayD> rays,
                      std::span<std::uint8_t> occluded, const SceneTraceOptionsD& options) {
    check_sizes(rays.size(), occluded.size());
    return trace_batch(scene, {rays, nullptr, occluded.data(), options});
}

AllHitsD trace_all(const SceneD& scene, std::span<const RayD> rays,
                   const SceneTraceOptionsD& options) {
    const SceneTreeD& tree = checked_tree(scene, rays.size(), options);
    const SceneKernelsD& kernels = scene_kernels_double_for(options.isa);
    const Batch batch{rays, nullptr, nullptr, options};
    constexpr std::size_t block_size = 512;
    HitBlocks<AllHitsD> found(rays.size(), block_size, options.max_result_bytes);
    std::vector<JobCounts> parts((rays.size() + block_size - 1) / block_size);
    AllHitsD all;
    with_threads(options.threads, [&] {
        for_each_block(rays.size(), block_size,
                       [&](std::size_t block, std::size_t begin, std::size_t end) {
                           const ThreadOwn<SceneJobD> own;
                           SceneJobD& job = *own;
                           set_job(job, tree, batch, {}, begin, end);
                           job.found = &found.hits(block);
                           job.hit_counts = found.hit_counts() + begin;
                           kernels.all_hits(job);
                           parts[block] = {job.hit_count, job.invalid};
                           found.finish(block);
                       });
        all = found.join();
    });
    all.counts = sum_of(parts, rays.size());
    return all;
}

HitD closest_hit(const SceneD& scene, const RayD& ray, std::uint32_t mask) {
    return trace_one(scene, ray, mask, nullptr, false);
}

bool any_hit(const SceneD& scene, const RayD& ray, std::uint32_t mask) {
    return trace_one(scene, ray, mask, nullptr, true).hit();
}

HitD closest_hit(const SceneD& scene, const RayD& ray, const HitFilterD& filter,
                 std::uint32_t mask) {
    return trace_one(scene, ray, mask, filter ? &filter : nullptr, false);
}

bool any_hit(const SceneD& scene, const RayD& ray, const HitFilterD& filter, std::uint32_t mask) {
    return trace_one(scene, ray, mask, filter ? &filter : nullptr, true).hit();
}

}  // namespace raydix
