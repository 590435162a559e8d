// Batches of rays through a wide tree on threads of the CPU: the kernel `simd`.
#include <raydix/error.h>
#include <raydix/wide.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "base/float_env.h"
#include "exec/parallel.h"
#include "rays/place_order.h"
#include "trace/all_hits.h"
#include "trace/batch.h"
#include "trace/simd/path_race.h"
#include "trace/simd/simd_kernels.h"
#include "trace/simd/trace_on_this_thread.h"
#include "trace/simd/wide_batch.h"

namespace raydix {

const SimdKernels& kernels_for(const std::string& isa) {
    const auto all = simd_kernels();
    if (isa.empty()) return all.front();
    std::string known;
    for (const SimdKernels& kernels : all) {
        if (kernels.isa == isa) return kernels;
        known += (known.empty() ? "" : ", ") + std::string(kernels.isa);
    }
    throw InputError("instruction set " + isa + ": this processor and build have " + known);
}

/// Rays of a job: as many as give full vectors deep in the tree and still lie in the second-level
/// cache; fewer where the batch would not keep many threads busy. Depends on the batch alone, so
/// that counts do not depend on the threads.
std::size_t rays_per_job(std::size_t n, SimdPath path) {
    constexpr std::size_t smallest = 1024, jobs = 32;
    if (path != SimdPath::stream && path != SimdPath::sorted) return smallest;
    return std::clamp(n / jobs / smallest * smallest, smallest, max_job_rays);
}

namespace {

void (*job_of(const SimdKernels& kernels, SimdPath path))(const SimdJob&, SimdCounts&) {
    if (path == SimdPath::single) return kernels.single;
    return path == SimdPath::packet ? kernels.packets : kernels.streams;
}

/// Kernels of compact trees count unasked: what they count depends on the paths of the jobs.
TraceCounts sum_of(const std::vector<SimdCounts>& parts, std::size_t rays, bool counters) {
    TraceCounts sum;
    sum.rays = rays;
    for (const SimdCounts& part : parts) {
        sum.hits += part.hits;
        sum.invalid_rays += part.invalid;
        if (!counters) continue;
        sum.node_visits += part.visits;
        sum.triangle_tests += part.tests;
    }
    return sum;
}

SimdPath path_for(const WideBvh& tree, std::span<const Ray> rays, SimdPath wanted) {
    const SimdPath path = wanted == SimdPath::automatic ? choose_simd_path(tree, rays) : wanted;
    const bool can_sort = rays.size() <= std::size_t{std::numeric_limits<std::int32_t>::max()};
    return path == SimdPath::sorted && !can_sort ? SimdPath::stream : path;
}

/// With fewer jobs than this a trial would cost more than it may gain.
constexpr std::size_t least_jobs_of_race = 16;

/// A batch as its jobs see it: hits, or else occluded, or all hits.
struct Batch {
    const WideBvh& tree;
    const SimdKernels& kernels;
    SimdPath path;
    std::span<const Ray> rays;
    HitRows hits;
    std::uint8_t* occluded;
    bool counters;
    std::vector<std::uint32_t> order{};  // of the path `sorted`
    HitBlocks<AllHits>* all = nullptr;
    const HitCheck* check = nullptr;

    void run(std::size_t begin, std::size_t end, SimdCounts& counts) const {
        run(path, begin, end, counts);
    }
    void run(SimdPath own, std::size_t begin, std::size_t end, SimdCounts& counts) const {
        const std::size_t stack_size = wide_stack_capacity(tree.stats().max_depth);
        StackMemory stack;
        stack.reserve_words(stack_size * (own == SimdPath::single ? rays_in_turn : 1));
        StreamMemory memory;
        const std::size_t from = order.empty() ? begin : 0;
        TriangleBlock room{};
        const SimdJob job{view_of(tree.arrays(), room),
                          rays.data() + from,
                          order.empty() ? nullptr : order.data() + begin,
                          end - begin,
                          hits ? HitRows{hits.at(from), hits.bytes} : HitRows{},
                          occluded == nullptr ? nullptr : occluded + from,
                          stack.view(),
                          stack.packet_view(),
                          &memory,
                          counters,
                          stack_size,
                          all == nullptr ? nullptr : &all->hits_with(begin),
                          all == nullptr ? nullptr : all->hit_counts() + begin,
                          check};
        job_of(kernels, own)(job, counts);
    }
};

/// What kernels without streams take, and what they may try instead.
struct WaysOfTwo {
    SimdPath ways[2] = {SimdPath::single, SimdPath::packet};
    bool packets;
    PathRace race;

    explicit WaysOfTwo(SimdPath path)
        : packets(path == SimdPath::packet),
          race(path == SimdPath::stream ? 2 : 1, path == SimdPath::stream ? 0 : 1) {}
    [[nodiscard]] SimdPath first() const { return packets ? SimdPath::packet : SimdPath::single; }
};

TraceCounts trace_checked(const WideBvh& tree, std::span<const Ray> rays, HitRows hits,
                          std::uint8_t* occluded, const TraceOptions& options, const RowsDone& done,
                          const HitCheck& check) {
    WaysOfTwo two(path_for(tree, rays, options.path));
    const std::size_t block_size = rays_per_job(rays.size(), two.first());
    std::vector<SimdCounts> parts((rays.size() + block_size - 1) / block_size);
    Batch batch{tree,     kernels_for(options.isa), two.first(), rays, hits,
                occluded, options.counters};
    batch.check = &check;
    const bool race =
        options.path == SimdPath::automatic && !two.packets && parts.size() >= least_jobs_of_race;
    with_threads(options.threads, [&] {
        for_each_block(rays.size(), block_size,
                       [&](std::size_t block, std::size_t begin, std::size_t end) {
                           if (race)
                               two.race.run(begin, end,
                                            [&](std::size_t way, std::size_t from, std::size_t to) {
                                                batch.run(two.ways[way], from, to, parts[block]);
                                            });
                           else
                               batch.run(begin, end, parts[block]);
                           done(nullptr, begin, end);
                       });
    });
    return sum_of(parts, rays.size(), options.counters);
}

TraceCounts trace_batch(const WideBvh& tree, std::span<const Ray> rays, HitRows hits,
                        std::uint8_t* occluded, const TraceOptions& options,
                        const RowsDone* done = nullptr) {
    const SimdKernels& kernels = kernels_for(options.isa);
    const SimdPath path = path_for(tree, rays, options.path);
    const std::size_t block_size = rays_per_job(rays.size(), path);
    std::vector<SimdCounts> parts((rays.size() + block_size - 1) / block_size);
    Batch batch{tree, kernels, path, rays, hits, occluded, options.counters};
    // Counters are those of one path: they do not depend on times.
    const bool race = options.path == SimdPath::automatic && path != SimdPath::packet &&
                      !options.counters && parts.size() >= least_jobs_of_race;
    // Rays that take turns only win where they go anywhere.
    constexpr SimdPath ways[] = {SimdPath::stream, SimdPath::packet, SimdPath::single};
    PathRace paths(2, path == SimdPath::sorted ? 1 : 0);
    with_threads(options.threads, [&] {
        if (path == SimdPath::sorted) batch.order = order_by_place(tree.arrays().bounds, rays);
        for_each_block(
            rays.size(), block_size, [&](std::size_t block, std::size_t begin, std::size_t end) {
                if (race)
                    paths.run(begin, end, [&](std::size_t way, std::size_t from, std::size_t to) {
                        batch.run(ways[way], from, to, parts[block]);
                    });
                else
                    batch.run(begin, end, parts[block]);
                if (done != nullptr)
                    (*done)(batch.order.empty() ? nullptr : batch.order.data(), begin, end);
            });
    });
    return sum_of(parts, rays.size(), options.counters);
}

HitRows rows_of(std::span<Hit> hits) { return {hits.data(), sizeof(Hit)}; }

void place_in_tree(Hit& hit) { place_hit(hit, 0); }

/// Largest jobs, one after the other, in the caller's floating-point environment.
void trace_on_this_thread(const WideBvh& tree, std::span<const Ray> rays, HitRows hits,
                          std::uint8_t* occluded) {
    SimdPath path = choose_simd_path(tree, rays);
    if (path == SimdPath::sorted) path = SimdPath::stream;
    const Batch batch{tree, simd_kernels().front(), path, rays, hits, occluded, false};
    SimdCounts counts;
    for (std::size_t begin = 0; begin < rays.size(); begin += max_job_rays)
        batch.run(begin, std::min(begin + max_job_rays, rays.size()), counts);
}

/// Before a call may end early: an empty tree answers without any threads.
void check_call(const TraceOptions& options) {
    check_options(options);
    check_threads(options.threads);
}

/// Nothing to hit: all rays miss, but invalid ones still count.
TraceCounts miss_all(std::span<const Ray> rays) {
    const FloatEnvironment plain;
    TraceCounts counts;
    counts.rays = rays.size();
    for (const Ray& ray : rays) counts.invalid_rays += !is_valid(ray);
    return counts;
}

}  // namespace

TraceCounts trace(const WideBvh& tree, std::span<const Ray> rays, std::span<Hit> hits,
                  const TraceOptions& options) {
    check_sizes(rays.size(), hits.size());
    check_call(options);
    static_cast<void>(kernels_for(options.isa));
    const RowsDone place = [&](const std::uint32_t* order, std::size_t begin, std::size_t end) {
        for_each_row(hits.data(), order, begin, end, place_in_tree);
    };
    if (!tree.empty()) return trace_batch(tree, rays, rows_of(hits), nullptr, options, &place);
    std::ranges::fill(hits, Hit{});
    return miss_all(rays);
}

std::vector<Hit> trace(const WideBvh& tree, std::span<const Ray> rays,
                       const TraceOptions& options) {
    std::vector<Hit> hits(rays.size());
    trace(tree, rays, hits, options);
    return hits;
}

TraceCounts trace_any(const WideBvh& tree, std::span<const Ray> rays,
                      std::span<std::uint8_t> occluded, const TraceOptions& options) {
    check_sizes(rays.size(), occluded.size());
    check_call(options);
    static_cast<void>(kernels_for(options.isa));
    if (!tree.empty()) return trace_batch(tree, rays, {}, occluded.data(), options);
    std::ranges::fill(occluded, std::uint8_t{0});
    return miss_all(rays);
}

void closest_on_this_thread(const WideBvh& tree, std::span<const Ray> rays, std::span<Hit> hits) {
    check_sizes(rays.size(), hits.size());
    if (tree.empty()) {
        std::ranges::fill(hits, Hit{});
        return;
    }
    trace_on_this_thread(tree, rays, rows_of(hits), nullptr);
    std::ranges::for_each(hits, place_in_tree);
}

void occluded_on_this_thread(const WideBvh& tree, std::span<const Ray> rays,
                             std::span<std::uint8_t> occluded) {
    check_sizes(rays.size(), occluded.size());
    if (tree.empty())
        std::ranges::fill(occluded, std::uint8_t{0});
    else
        trace_on_this_thread(tree, rays, {}, occluded.data());
}

AllHits trace_all(const WideBvh& tree, std::span<const Ray> rays, const TraceOptions& options) {
    check_call(options);
    const SimdKernels& kernels = kernels_for(options.isa);
    constexpr std::size_t block_size = 1024;
    HitBlocks<AllHits> found(rays.size(), block_size, options.max_result_bytes);
    AllHits all;
    if (tree.empty()) {
        all = found.join();
        all.counts = miss_all(rays);
        return all;
    }
    std::vector<SimdCounts> parts((rays.size() + block_size - 1) / block_size);
    WaysOfTwo two(path_for(tree, rays, options.path));
    Batch batch{tree, kernels, two.first(), rays, {}, nullptr, options.counters};
    batch.all = &found;
    const bool race = options.path == SimdPath::automatic && !two.packets && !options.counters &&
                      parts.size() >= least_jobs_of_race;
    with_threads(options.threads, [&] {
        for_each_block(rays.size(), block_size,
                       [&](std::size_t block, std::size_t begin, std::size_t end) {
                           if (race)
                               two.race.run(begin, end,
                                            [&](std::size_t way, std::size_t from, std::size_t to) {
                                                batch.run(two.ways[way], from, to, parts[block]);
                                            });
                           else
                               batch.run(begin, end, parts[block]);
                           found.finish(block);
                       });
        all = found.join();
    });
    all.counts = sum_of(parts, rays.size(), options.counters);
    return all;
}

TraceCounts trace_rows(const WideBvh& tree, std::span<const Ray> rays, HitRows hits,
                       std::uint8_t* occluded, const TraceOptions& options, const RowsDone& done,
                       const HitCheck* check) {
    check_call(options);
    static_cast<void>(kernels_for(options.isa));
    if (!tree.empty())
        return check == nullptr ? trace_batch(tree, rays, hits, occluded, options, &done)
                                : trace_checked(tree, rays, hits, occluded, options, done, *check);
    for (std::size_t i = 0; i < rays.size(); ++i)
        if (hits)
            *hits.at(i) = {};
        else
            occluded[i] = 0;
    done(nullptr, 0, rays.size());
    return miss_all(rays);
}

SimdPath choose_simd_path(const WideBvh& tree, std::span<const Ray> rays) {
    return choose_path(tree.arrays().bounds, rays);
}

SimdPath choose_path(const Aabb& bounds, std::span<const Ray> rays) {
    const FloatEnvironment plain;
    constexpr std::size_t window = 64, windows = 32;
    constexpr float small_angle = 0.25f, small_part = 0.05f;
    const Vec3 size = bounds.hi - bounds.lo;
    const float near = small_part * max_of(max_of(size.x, size.y), size.z);
    std::size_t looked_at = 0, coherent = 0, close = 0;
    for (std::size_t w = 0; w < windows; ++w) {
        const std::size_t begin = rays.size() / windows * w;
        if (begin + window > rays.size()) break;
        Aabb origins = empty_box(), directions = empty_box();
        for (const Ray& ray : rays.subspan(begin, window)) {
            if (!is_valid(ray)) continue;
            const Vec3 d = ray.direction;
            const float longest = max_of(max_of(std::fabs(d.x), std::fabs(d.y)), std::fabs(d.z));
            const Vec3 scaled{d.x / longest, d.y / longest, d.z / longest};
            origins = unite(origins, {ray.origin, ray.origin});
            directions = unite(directions, {scaled, scaled});
        }
        ++looked_at;
        const Vec3 o = origins.hi - origins.lo, d = directions.hi - directions.lo;
        const bool here = max_of(max_of(o.x, o.y), o.z) <= near;
        close += here;
        coherent += here && max_of(max_of(d.x, d.y), d.z) <= small_angle;
    }
    if (4 * coherent >= 3 * looked_at) return SimdPath::packet;
    return 2 * close >= looked_at ? SimdPath::stream : SimdPath::sorted;
}

namespace {

thread_local CallHistory call_history;

/// In a plain environment.
TreeHit trace_one_ray(OneRay* kernel, const WideBvh& tree, const Ray& ray) {
    constexpr std::size_t inside = 512;
    if (wide_stack_capacity(tree.stats().max_depth) > inside) {
        StackMemory stack(tree.stats().max_depth);
        return kernel(tree.arrays(), ray, stack.view(), call_history);
    }
    std::uint32_t words[inside];
    float entries[inside];
    return kernel(tree.arrays(), ray, {words, entries}, call_history);
}

TreeHit one_ray(OneRay* kernel, const WideBvh& tree, const Ray& ray) {
    if (FloatEnvironment::is_plain()) return trace_one_ray(kernel, tree, ray);
    const FloatEnvironment plain;
    return trace_one_ray(kernel, tree, ray);
}

}  // namespace

Hit closest_hit(const WideBvh& tree, const Ray& ray) {
    static OneRay* const kernel = simd_kernels().front().closest;
    return tree.empty() ? Hit{} : hit_of_tree(one_ray(kernel, tree, ray));
}

bool any_hit(const WideBvh& tree, const Ray& ray) {
    static OneRay* const kernel = simd_kernels().front().any;
    return !tree.empty() && one_ray(kernel, tree, ray).hit();
}

namespace {

constexpr std::array<std::string_view, 5> path_names{"automatic", "single", "packet", "stream",
                                                     "sorted"};

}  // namespace

std::string_view simd_path_name(SimdPath path) {
    const auto k = static_cast<std::size_t>(path);
    return k < path_names.size() ? path_names[k] : "unknown";
}

SimdPath simd_path_from_name(std::string_view name) {
    std::string known;
    for (std::size_t k = 0; k < path_names.size(); ++k) {
        if (path_names[k] == name) return static_cast<SimdPath>(k);
        known += (known.empty() ? "" : ", ") + std::string(path_names[k]);
    }
    throw InputError("unknown path " + std::string(name) + "; known are " + known);
}

std::vector<std::string> simd_instruction_sets() {
    std::vector<std::string> names;
    for (const SimdKernels& kernels : simd_kernels()) names.emplace_back(kernels.isa);
    return names;
}

}  // namespace raydix
