// Batches and single rays through scenes.
#include <raydix/buffer.h>
#include <raydix/scene.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "base/float_env.h"
#include "base/options.h"
#include "engine/scene_batch.h"
#include "engine/scene_job.h"
#include "engine/scene_state.h"
#include "engine/shape_tree.h"
#include "engine/trace_on_this_thread.h"
#include "exec/parallel.h"
#include "exec/path_rates.h"
#include "exec/thread_own.h"
#include "rays/place_order.h"
#include "trace/all_hits.h"
#include "trace/batch.h"
#include "trace/ray_frame.h"
#include "trace/simd/one_ray.h"
#include "trace/simd/trace_on_this_thread.h"
#include "trace/simd/wide_batch.h"

namespace raydix {
namespace {

using Batch = BasicSceneBatch<float>;

struct Kernels {
    const SimdKernels* tree;
    const SceneKernels* scene;
};

/// Rays begin to end - 1, or order[begin] to order[end - 1].
JobCounts trace_job(const SceneTree& tree, const Kernels& kernels, PathWay way, const Batch& batch,
                    std::span<const std::uint32_t> order, std::size_t begin, std::size_t end) {
    const ThreadOwn<SceneJob> own;
    SceneJob& job = *own;
    const std::size_t from = order.empty() ? begin : 0;
    job.tree = &tree;
    job.kernels = kernels.tree;
    job.rays = batch.rays.data() + from;
    job.order = order.empty() ? nullptr : order.data() + begin;
    job.n = end - begin;
    job.first = from;
    job.mask = batch.options.mask;
    job.masks = batch.options.masks.empty() ? nullptr : batch.options.masks.data() + from;
    job.filter = batch.filter();
    job.any = batch.hits == nullptr;
    job.packets = way == PathWay::packets;
    job.single = way == PathWay::turns || way == PathWay::alone;
    job.turns = way == PathWay::turns;
    kernels.scene->trace(job);
    JobCounts counts;
    counts.invalid = job.invalid;
    for (std::size_t k = 0; k < job.n; ++k) {
        counts.hits += job.hits[k].hit();
        batch.set(order.empty() ? begin + k : order[begin + k], job.hits[k]);
    }
    return counts;
}

/// Whether turns only cost rays time that go alone.
bool is_at_hand(const SceneTree& tree) {
    const ShapeTree* const shapes = tree.only_shapes();
    return shapes != nullptr && shapes->is_at_hand;
}

/// How a batch goes.
struct Plan {
    SimdPath path;
    JobWays ways{};

    Plan(const SceneTree& tree, const Batch& batch) : path(batch.options.path) {
        const bool automatic = path == SimdPath::automatic;
        BatchLook look{path, {}, false};
        if (automatic) look = look_at(tree.extent.box, batch.rays);
        // Rays that go apart meet parts in lists too short to pay.
        path = automatic && look.path == SimdPath::sorted ? SimdPath::single : look.path;
        // Rays from one place are often those of a coarse picture, which packets suit.
        if (automatic && path == SimdPath::stream && tree.only_shapes() != nullptr)
            ways.add(PathWay::packets);
        if (path != SimdPath::single)
            ways.add(path == SimdPath::packet ? PathWay::packets : PathWay::streams);
        const bool at_hand = path == SimdPath::single && is_at_hand(tree);
        ways.add(at_hand ? PathWay::alone : PathWay::turns);
        ways.add(at_hand ? PathWay::turns : PathWay::alone);
        if (!automatic) return;
        look.kind.any = batch.hits == nullptr;
        ways.rates = &tree.rates.ways(look.kind);
    }
};

TraceCounts trace_scene(const SceneTree& tree, const Batch& batch) {
    const std::size_t n = batch.rays.size();
    const Plan plan(tree, batch);
    const bool sorted =
        plan.path == SimdPath::sorted && n <= std::size_t{std::numeric_limits<std::int32_t>::max()};
    std::vector<JobCounts> parts;
    const Kernels kernels{&kernels_for(batch.options.isa), &scene_kernels_for(batch.options.isa)};
    with_threads(batch.options.threads, [&] {
        Buffer<std::uint32_t> order;
        if (sorted) order = order_by_place(tree.extent.box, batch.rays);
        const JobBlocks jobs = jobs_of(n, JobSize::medium);
        parts.resize(jobs.count());
        jobs.run([&](std::size_t job, std::size_t begin, std::size_t end) {
            plan.ways.run(begin, end, [&](PathWay way, std::size_t from, std::size_t to) {
                parts[job] += trace_job(tree, kernels, way, batch, order.view(), from, to);
            });
        });
    });
    return sum_of(parts, n);
}

/// How all hits of a batch are found. Together or alone: which is faster depends on the scene.
JobWays ways_of_all_hits(const SceneTree& tree, const Batch& batch) {
    const SimdPath path = batch.options.path;
    const bool automatic = path == SimdPath::automatic;
    BatchLook look{path, {}, false};
    if (automatic) look = look_at(tree.extent.box, batch.rays);
    JobWays ways;
    if (!batch.options.filter && look.path == SimdPath::packet) ways.add(PathWay::packets);
    if (!batch.options.filter && look.path == SimdPath::stream) ways.add(PathWay::streams);
    if (automatic || ways.count == 0) ways.add(PathWay::alone);
    if (ways.count < 2) return ways;
    look.kind.sorted = true;  // no rays are sorted here: this keeps them apart from closest hits
    ways.rates = &tree.rates.ways(look.kind);
    return ways;
}

/// All hits of rays begin to end - 1, behind those of their block. How many rays are invalid.
std::uint64_t find_all(const SceneTree& tree, const Kernels& kernels, PathWay way,
                       const Batch& batch, HitBlocks<AllHits>& found, std::size_t begin,
                       std::size_t end) {
    const ThreadOwn<SceneJob> own;
    SceneJob& job = *own;
    job.tree = &tree;
    job.kernels = kernels.tree;
    job.rays = batch.rays.data() + begin;
    job.order = nullptr;
    job.n = end - begin;
    job.first = begin;
    job.mask = batch.options.mask;
    job.masks = batch.options.masks.empty() ? nullptr : batch.options.masks.data() + begin;
    job.filter = batch.filter();
    job.packets = way == PathWay::packets;
    job.single = way == PathWay::alone;
    job.turns = false;
    job.found = &found.hits_with(begin);
    job.hit_counts = found.hit_counts() + begin;
    kernels.scene->all_hits(job);
    return job.invalid;
}

/// Asks a filter about hits of the only mesh tree.
struct FilterOfMesh {
    const MeshTree& mesh;
    const Batch& batch;

    static bool accepts(const void* context, const Ray* ray, const TreeHit& hit) {
        const auto& [mesh, batch] = *static_cast<const FilterOfMesh*>(context);
        Hit found{hit, no_primitive, 0};
        mesh.name(found);
        return batch.options.filter(static_cast<std::size_t>(ray - batch.rays.data()), *ray, found);
    }
};

/// One tree for all: the kernels write where the answers go.
TraceCounts trace_mesh(const MeshTree& mesh, const Batch& batch) {
    const FilterOfMesh filter{mesh, batch};
    const HitCheck check{&FilterOfMesh::accepts, &filter};
    TraceOptions options;
    options.threads = batch.options.threads;
    options.path = batch.options.path;
    options.isa = batch.options.isa;
    const HitRows rows(batch.hits, mesh.ids.front());
    RowsDone name;
    if (batch.hits != nullptr && mesh.ids.size() != 1)
        name = [&](std::size_t first, const std::uint32_t* order, std::size_t begin,
                   std::size_t end) {
            for_each_row(batch.hits + first, order, begin, end, [&](Hit& hit) {
                if (hit.hit()) mesh.name(hit);
            });
        };
    return trace_rows(*mesh.tree, batch.rays, rows, batch.occluded, options, name,
                      batch.options.filter ? &check : nullptr);
}

/// All rays see all masks.
void trace_on_this_thread(const SceneTree& tree, std::span<const Ray> rays, Hit* hits,
                          std::uint8_t* occluded) {
    const SceneTraceOptions options;
    const Batch batch{rays, hits, occluded, options};
    const PathWay way = Plan(tree, batch).ways.ways[0];
    const Kernels kernels{&kernels_for({}), &scene_kernels_for({})};
    for (std::size_t begin = 0; begin < rays.size(); begin += max_job_rays)
        trace_job(tree, kernels, way, batch, {}, begin,
                  std::min(begin + max_job_rays, rays.size()));
}

/// The only mesh tree, if all rays can see it.
const MeshTree* visible_mesh(const SceneTree& tree, const SceneTraceOptions& options = {}) {
    const MeshTree* const mesh = tree.only_mesh();
    const bool seen = mesh != nullptr && options.masks.empty() && (mesh->mask & options.mask) != 0;
    return seen ? mesh : nullptr;
}

/// A ray alone through the parts of a scene.
struct OneOfParts {
    SceneKernels::OneRayOfScene* kernel;
    const SceneTree& tree;
    std::uint32_t mask;
    const HitFilter* filter;
    std::size_t place = 0;

    /// In a plain environment.
    [[nodiscard]] Hit trace(const Ray& ray) const {
        constexpr std::size_t inside = 1024;
        if (tree.stack_size > inside) {
            StackMemory stack;
            stack.reserve_words(tree.stack_size);
            return kernel(tree, ray, mask, filter, place, stack.view(), call_history);
        }
        std::uint32_t words[inside];
        float entries[inside];
        return kernel(tree, ray, mask, filter, place, {words, entries}, call_history);
    }
};

[[gnu::noinline]] Hit trace_parts(const SceneTree& tree, const Ray& ray, std::uint32_t mask,
                                  const HitFilter* filter, bool any) {
    static const SceneKernels& kernels = scene_kernels_for({});
    const OneOfParts one{any ? kernels.any : kernels.closest, tree, mask, filter};
    if (FloatEnvironment::is_plain()) return one.trace(ray);
    const FloatEnvironment plain;
    return one.trace(ray);
}

/// Rays through parts one by one, without a plan.
TraceCounts trace_few(const SceneTree& tree, const Batch& batch) {
    check_threads(batch.options.threads);
    const SceneKernels& kernels = scene_kernels_for(batch.options.isa);
    const FloatEnvironment plain;
    OneOfParts one{batch.hits == nullptr ? kernels.any : kernels.closest, tree, 0, batch.filter()};
    TraceCounts counts;
    counts.rays = batch.rays.size();
    for (; one.place < batch.rays.size(); ++one.place) {
        const Ray& ray = batch.rays[one.place];
        one.mask = batch.mask(one.place);
        const Hit hit = one.trace(ray);
        counts.hits += hit.hit();
        counts.invalid_rays += !hit.hit() && !is_valid(ray);
        batch.set(one.place, hit);
    }
    return counts;
}

TraceCounts trace_batch(const Scene& scene, const Batch& batch) {
    const SceneTree& tree = *SceneInternals::tree(scene);
    const SceneTraceOptions& options = batch.options;
    check_options(batch.rays.size(), options);
    static_cast<void>(kernels_for(options.isa));
    if (const MeshTree* const mesh = visible_mesh(tree, options)) return trace_mesh(*mesh, batch);
    return are_few(tree.extent.box, batch.rays, options.path) ? trace_few(tree, batch)
                                                              : trace_scene(tree, batch);
}

/// The order by triangles of the tree is that by geometry and triangle.
AllHits all_hits_of(const MeshTree& mesh, std::span<const Ray> rays,
                    const SceneTraceOptions& options) {
    TraceOptions of_tree;
    of_tree.threads = options.threads;
    of_tree.isa = options.isa;
    of_tree.path = options.path;
    of_tree.max_result_bytes = options.max_result_bytes;
    AllHits all = trace_all(*mesh.tree, rays, of_tree);
    if (mesh.ids.size() == 1 && mesh.ids.front() == 0) return all;  // as hits of a tree are
    with_threads(options.threads, [&] {
        for_each_index(all.hits.size(), [&](std::size_t i) { mesh.name(all.hits[i]); });
    });
    return all;
}

}  // namespace

TraceCounts trace(const Scene& scene, std::span<const Ray> rays, std::span<Hit> hits,
                  const SceneTraceOptions& options) {
    check_sizes(rays.size(), hits.size());
    return trace_batch(scene, {rays, hits.data(), nullptr, options});
}

std::vector<Hit> trace(const Scene& scene, std::span<const Ray> rays,
                       const SceneTraceOptions& options) {
    std::vector<Hit> hits(rays.size());
    trace(scene, rays, hits, options);
    return hits;
}

TraceCounts trace_any(const Scene& scene, std::span<const Ray> rays,
                      std::span<std::uint8_t> occluded, const SceneTraceOptions& options) {
    check_sizes(rays.size(), occluded.size());
    return trace_batch(scene, {rays, nullptr, occluded.data(), options});
}

void closest_on_this_thread(const SceneTree& scene, std::span<const Ray> rays,
                            std::span<Hit> hits) {
    check_sizes(rays.size(), hits.size());
    if (const MeshTree* const mesh = visible_mesh(scene)) {
        closest_on_this_thread(*mesh->tree, rays, hits);
        for (Hit& hit : hits)
            if (hit.hit()) mesh->name(hit);
    } else {
        trace_on_this_thread(scene, rays, hits.data(), nullptr);
    }
}

void occluded_on_this_thread(const SceneTree& scene, std::span<const Ray> rays,
                             std::span<std::uint8_t> occluded) {
    check_sizes(rays.size(), occluded.size());
    if (const MeshTree* const mesh = visible_mesh(scene))
        occluded_on_this_thread(*mesh->tree, rays, occluded);
    else
        trace_on_this_thread(scene, rays, nullptr, occluded.data());
}

void count_steps_on_this_thread(const SceneTree& scene, std::span<const Ray> rays,
                                std::span<std::uint32_t> visits) {
    check_sizes(rays.size(), visits.size());
    const ThreadOwn<SceneJob> own;
    SceneJob& job = *own;
    job.tree = &scene;
    job.rays = rays.data();
    job.n = rays.size();
    job.mask = ~std::uint32_t{0};
    job.visits = visits.data();
    scene_kernels_for({}).steps(job);
}

AllHits trace_all(const Scene& scene, std::span<const Ray> rays, const SceneTraceOptions& options) {
    const SceneTree& tree = *SceneInternals::tree(scene);
    check_options(rays.size(), options);
    static_cast<void>(kernels_for(options.isa));
    if (const MeshTree* const mesh = visible_mesh(tree, options); mesh && !options.filter)
        return all_hits_of(*mesh, rays, options);
    constexpr std::size_t block_size = 1024;
    HitBlocks<AllHits> found(rays.size(), block_size, options.max_result_bytes);
    std::vector<JobCounts> parts((rays.size() + block_size - 1) / block_size);
    const Kernels kernels{&kernels_for(options.isa), &scene_kernels_for(options.isa)};
    const Batch batch{rays, nullptr, nullptr, options};
    const JobWays ways = ways_of_all_hits(tree, batch);
    AllHits all;
    with_threads(options.threads, [&] {
        for_each_block(
            rays.size(), block_size, [&](std::size_t block, std::size_t begin, std::size_t end) {
                ways.run(begin, end, [&](PathWay way, std::size_t from, std::size_t to) {
                    parts[block].invalid += find_all(tree, kernels, way, batch, found, from, to);
                });
                parts[block].hits = found.hits(block).size();
                found.finish(block);
            });
        all = found.join();
    });
    all.counts = sum_of(parts, rays.size());
    return all;
}

Hit closest_hit(const Scene& scene, const Ray& ray, const HitFilter& filter, std::uint32_t mask) {
    return trace_parts(*SceneInternals::tree(scene), ray, mask, filter ? &filter : nullptr, false);
}

bool any_hit(const Scene& scene, const Ray& ray, const HitFilter& filter, std::uint32_t mask) {
    return trace_parts(*SceneInternals::tree(scene), ray, mask, filter ? &filter : nullptr, true)
        .hit();
}

Hit closest_hit(const Scene& scene, const Ray& ray, std::uint32_t mask) {
    static OneRay* const kernel = simd_kernels().front().closest;
    const SceneTree& tree = *SceneInternals::tree(scene);
    const MeshTree* const mesh = tree.only_mesh();
    if (mesh == nullptr) return trace_parts(tree, ray, mask, nullptr, false);
    if ((mesh->mask & mask) == 0 || mesh->stack_size == 0) return {};
    const TreeHit found = one_ray(kernel, mesh->view, mesh->stack_size, ray);
    if (!found.hit()) return {};
    if (mesh->ids.size() == 1) return {found, mesh->ids.front(), 0};
    Hit hit{found};
    mesh->name(hit);
    return hit;
}

bool any_hit(const Scene& scene, const Ray& ray, std::uint32_t mask) {
    static OneRay* const kernel = simd_kernels().front().any;
    const SceneTree& tree = *SceneInternals::tree(scene);
    const MeshTree* const mesh = tree.only_mesh();
    if (mesh == nullptr) return trace_parts(tree, ray, mask, nullptr, true).hit();
    return (mesh->mask & mask) != 0 && mesh->stack_size != 0 &&
           one_ray(kernel, mesh->view, mesh->stack_size, ray).hit();
}

}  // namespace raydix
