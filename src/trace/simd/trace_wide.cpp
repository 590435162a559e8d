// Batches of rays through a wide tree on threads of the CPU: the kernel `simd`.
#include <raydix/buffer.h>
#include <raydix/error.h>
#include <raydix/wide.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/float_env.h"
#include "exec/parallel.h"
#include "exec/path_rates.h"
#include "exec/thread_own.h"
#include "rays/place_order.h"
#include "trace/all_hits.h"
#include "trace/batch.h"
#include "trace/simd/one_ray.h"
#include "trace/simd/ray_order.h"
#include "trace/simd/scaled_rays.h"
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

JobBlocks jobs_of(std::size_t n, JobSize size, bool counted) {
    constexpr std::size_t unit = 512, usual = 1024;
    std::size_t largest = usual;
    if (size != JobSize::small) {
        const std::size_t jobs = size == JobSize::medium ? 32 : 4;
        largest = std::clamp(n / jobs / usual * usual, usual, max_job_rays);
    }
    if (counted || n <= undivided_rays) return JobBlocks::fixed(n, largest);
    return JobBlocks::guided(n, unit, largest, static_cast<std::size_t>(thread_count()));
}

namespace {

void (*job_of(const SimdKernels& kernels, PathWay way))(const SimdJob&, SimdCounts&) {
    if (way == PathWay::turns) return kernels.single;
    return way == PathWay::packets ? kernels.packets : kernels.streams;
}

/// Fewer rays are worth no trial of another way if one after the other is the way.
constexpr std::size_t few_rays = 32;
/// BatchKind::size from which on rays may stream: fewer have hardly two in a node.
constexpr std::uint32_t least_size_to_stream = 2;
/// The same of rays that start apart and are not sorted: from here on streams are tried first.
constexpr std::uint32_t least_size_to_stream_apart = 3;

PathWay way_of(SimdPath path) {
    if (path == SimdPath::single) return PathWay::turns;
    return path == SimdPath::packet ? PathWay::packets : PathWay::streams;
}

/// Kernels of compact trees count unasked: what they count depends on the paths of the jobs.
void add_counts(const std::vector<SimdCounts>& parts, bool counters, TraceCounts& sum) {
    for (const SimdCounts& part : parts) {
        sum.hits += part.hits;
        sum.invalid_rays += part.invalid;
        if (!counters) continue;
        sum.node_visits += part.visits;
        sum.triangle_tests += part.tests;
    }
}

/// How a batch goes.
struct Plan {
    const WideBvh& tree;
    BatchLook look;
    bool automatic, learns, streams, counted;
    bool few;  // so few rays that nothing but one after the other can be worth a trial

    /// `streams`: whether they can answer. `any`: what is asked.
    Plan(const WideBvh& through, std::span<const Ray> rays, const TraceOptions& options, bool any,
         bool can_stream)
        : tree(through),
          look{options.path, {}, false},
          automatic(options.path == SimdPath::automatic),
          // Counters are those of one way: they do not depend on times.
          learns(automatic && !options.counters),
          streams(can_stream),
          counted(options.counters),
          few(rays.size() < few_rays) {
        if (automatic)
            look = look_at(tree.arrays().bounds, rays);
        else if (look.path != SimdPath::single && !counted && can_stream)
            look.scaled = look_at(tree.arrays().bounds, rays).scaled;
        // Rays together share one pad.
        if (automatic && tree.arrays().local_pads) look.path = SimdPath::single;
        look.kind.any = any;
    }

    /// On the threads of the calling context.
    [[nodiscard]] JobBlocks jobs(std::size_t rays) const {
        const bool may_stream =
            streams && (look.path == SimdPath::stream || look.path == SimdPath::sorted);
        if (!may_stream) return jobs_of(rays, JobSize::small, counted);
        return jobs_of(rays, counted ? JobSize::medium : JobSize::large, counted);
    }

    /// Rays 0 to n - 1 by trace(order, begin, end).
    template <class Trace>
    void run_in_order(std::size_t n, const Trace& trace) const {
        const bool can_sort = streams && look.path == SimdPath::sorted &&
                              n <= std::size_t{std::numeric_limits<std::int32_t>::max()};
        if (!can_sort || (automatic && n < least_rays_to_sort)) {
            trace(RayOrder::given, 0, n);
        } else if (!learns) {
            trace(RayOrder::sorted, 0, n);
        } else {
            run_in_better_order(tree.arrays().rates.orders(look.kind), look.kind, n, trace);
        }
    }

    /// Of jobs in this order.
    [[nodiscard]] JobWays ways(RayOrder order) const {
        const bool apart = look.path == SimdPath::sorted && order == RayOrder::given;
        const bool many = look.kind.size >= least_size_to_stream_apart;
        PathWay first = apart && !many ? PathWay::turns : way_of(look.path);
        // Rays from one place are often those of a coarse picture, which packets suit.
        if (!streams && first == PathWay::streams)
            first = automatic ? PathWay::packets : PathWay::turns;
        const bool small = learns && look.kind.size < least_size_to_stream;
        // So few hardly take turns.
        const bool tiny = learns && streams && look.kind.size == 0;
        if (small && first == PathWay::streams) first = PathWay::turns;
        JobWays ways;
        if (automatic && tree.arrays().local_pads) {
            ways.add(PathWay::turns);
            if (!learns || !streams) return ways;
            ways.add(PathWay::alone);
            ways.rates = &tree.arrays().rates.ways(look.kind);
            return ways;
        }
        if (tiny && few && first != PathWay::packets) {
            ways.add(PathWay::alone);
            return ways;
        }
        ways.add(first);
        if (!learns) return ways;
        const auto may_be_best = [&](PathWay way) {
            if (way == PathWay::packets) return !(tiny && apart);
            return way != PathWay::streams || (streams && !small);
        };
        for (const PathWay way : {PathWay::packets, PathWay::turns, PathWay::streams})
            if (way != first && may_be_best(way)) ways.add(way);
        if (tiny) ways.add(PathWay::alone);
        BatchKind kind = look.kind;
        kind.sorted = order == RayOrder::sorted;
        ways.rates = &tree.arrays().rates.ways(kind);
        return ways;
    }
};

/// Kept from job to job.
struct JobMemory {
    StackMemory stack;
    StreamMemory streams;
    ScaledJob scaled;
};

/// A batch as its jobs see it: hits, or else occluded, or all hits.
struct Batch {
    const WideBvh& tree;
    const SimdKernels& kernels;
    std::span<const Ray> rays;
    HitRows hits;
    std::uint8_t* occluded;
    bool counters;
    Buffer<std::uint32_t> order{};  // of the path `sorted`
    HitBlocks<AllHits>* all = nullptr;
    const HitCheck* check = nullptr;
    bool scaled = false;   // many rays have directions far from unit length
    bool passing = false;  // many rays pass the tree's bounds by

    void run(PathWay way, std::size_t begin, std::size_t end, SimdCounts& counts) const {
        const ThreadOwn<JobMemory> own;
        StackMemory& stack = own->stack;
        const std::size_t stack_size = wide_stack_capacity(tree.stats().max_depth);
        stack.reserve_words(stack_size * (way == PathWay::turns ? rays_in_turn : 1));
        const std::size_t from = order.empty() ? begin : 0;
        TriangleBlock room{};
        const SimdJob job{view_of(tree.arrays(), &room),
                          rays.data() + from,
                          order.empty() ? nullptr : order.data() + begin,
                          end - begin,
                          hits.from(from),
                          occluded == nullptr ? nullptr : occluded + from,
                          stack.view(),
                          stack.packet_view(),
                          &own->streams,
                          counters,
                          stack_size,
                          all == nullptr ? nullptr : &all->hits_with(begin),
                          all == nullptr ? nullptr : all->hit_counts() + begin,
                          check,
                          passing};
        if (way == PathWay::alone) {
            run_alone(job, counts);
        } else if (scaled && all == nullptr && check == nullptr) {
            job_of(kernels, way)(own->scaled.copied(job, kernels.scale), counts);
            own->scaled.hand_over(job);
        } else {
            job_of(kernels, way)(job, counts);
        }
    }

private:
    /// Calls of one ray, without an order.
    void run_alone(const SimdJob& job, SimdCounts& counts) const {
        OneRay* const kernel = hits ? kernels.closest : kernels.any;
        CallHistory history;
        for (std::size_t k = 0; k < job.n; ++k) {
            const TreeHit hit = kernel(job.tree, job.rays[k], job.stack, history);
            counts.hits += hit.hit();
            counts.invalid += !hit.hit() && !is_valid(job.rays[k]);
            if (hits)
                job.hits.put(k, hit);
            else
                job.occluded[k] = hit.hit();
        }
    }
};

/// Rays one by one, without a plan.
TraceCounts trace_few(const WideBvh& tree, std::span<const Ray> rays, HitRows hits,
                      std::uint8_t* occluded, const TraceOptions& options, const RowsDone& done) {
    check_threads(options.threads);
    const SimdKernels& kernels = kernels_for(options.isa);
    OneRay* const kernel = hits ? kernels.closest : kernels.any;
    const WideView view = view_of(tree.arrays());
    const std::size_t stack_size = wide_stack_capacity(tree.stats().max_depth);
    const FloatEnvironment plain;
    TraceCounts counts;
    counts.rays = rays.size();
    for (std::size_t k = 0; k < rays.size(); ++k) {
        const TreeHit hit = one_ray_plainly(kernel, view, stack_size, rays[k]);
        counts.hits += hit.hit();
        counts.invalid_rays += !hit.hit() && !is_valid(rays[k]);
        if (hits)
            hits.put(k, hit);
        else
            occluded[k] = hit.hit();
    }
    if (done) done(0, nullptr, 0, rays.size());
    return counts;
}

/// `done` comes for the rays of each job. `check`: of the hits that it accepts, or null.
TraceCounts trace_batch(const WideBvh& tree, std::span<const Ray> rays, HitRows hits,
                        std::uint8_t* occluded, const TraceOptions& options, const RowsDone& done,
                        const HitCheck* check) {
    if (are_few(tree.arrays().bounds, rays, options.path) && !options.counters && check == nullptr)
        return trace_few(tree, rays, hits, occluded, options, done);
    const Plan plan(tree, rays, options, !hits, check == nullptr);
    const SimdKernels& kernels = kernels_for(options.isa);
    TraceCounts sum;
    sum.rays = rays.size();
    const auto run = [&] {
        plan.run_in_order(rays.size(), [&](RayOrder order, std::size_t first, std::size_t last) {
            const std::span<const Ray> part = rays.subspan(first, last - first);
            Batch batch{tree,
                        kernels,
                        part,
                        hits.from(first),
                        occluded == nullptr ? nullptr : occluded + first,
                        options.counters};
            batch.check = check;
            batch.scaled = plan.look.scaled;
            batch.passing = plan.look.passing && !options.counters;
            if (order == RayOrder::sorted) batch.order = order_by_place(tree.arrays().bounds, part);
            const JobWays ways = plan.ways(order);
            const JobBlocks jobs = plan.jobs(part.size());
            std::vector<SimdCounts> parts(jobs.count());
            jobs.run([&](std::size_t job, std::size_t begin, std::size_t end) {
                SimdCounts counts;  // this thread's alone: kernels count ray by ray
                ways.run(begin, end, [&](PathWay way, std::size_t from, std::size_t to) {
                    batch.run(way, from, to, counts);
                });
                parts[job] = counts;
                if (done)
                    done(first, order == RayOrder::sorted ? batch.order.data() : nullptr, begin,
                         end);
            });
            add_counts(parts, options.counters, sum);
        });
    };
    if (rays.size() <= undivided_rays) {  // one job: no other thread has a part in it
        check_threads(options.threads);
        run();
    } else {
        with_threads(options.threads, run);
    }
    return sum;
}

HitRows rows_of(std::span<Hit> hits) { return {hits.data(), 0}; }

/// Largest jobs, one after the other, in the caller's floating-point environment.
void trace_on_this_thread(const WideBvh& tree, std::span<const Ray> rays, HitRows hits,
                          std::uint8_t* occluded) {
    PathWay way = tree.arrays().local_pads ? PathWay::turns : way_of(choose_simd_path(tree, rays));
    if (way == PathWay::streams && BatchKind::size_of(rays.size()) < least_size_to_stream)
        way = PathWay::turns;
    const Batch batch{tree, simd_kernels().front(), rays, hits, occluded, false};
    SimdCounts counts;
    for (std::size_t begin = 0; begin < rays.size(); begin += max_job_rays)
        batch.run(way, begin, std::min(begin + max_job_rays, rays.size()), counts);
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
    if (!tree.empty()) return trace_batch(tree, rays, rows_of(hits), nullptr, options, {}, nullptr);
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
    if (!tree.empty()) return trace_batch(tree, rays, {}, occluded.data(), options, {}, nullptr);
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
    const Plan plan(tree, rays, options, false, false);
    const JobWays ways = plan.ways(RayOrder::given);
    std::vector<SimdCounts> parts((rays.size() + block_size - 1) / block_size);
    Batch batch{tree, kernels, rays, {}, nullptr, options.counters};
    batch.all = &found;
    with_threads(options.threads, [&] {
        for_each_block(rays.size(), block_size,
                       [&](std::size_t block, std::size_t begin, std::size_t end) {
                           SimdCounts counts;
                           ways.run(begin, end, [&](PathWay way, std::size_t from, std::size_t to) {
                               batch.run(way, from, to, counts);
                           });
                           parts[block] = counts;
                           found.finish(block);
                       });
        all = found.join();
    });
    all.counts.rays = rays.size();
    add_counts(parts, options.counters, all.counts);
    return all;
}

TraceCounts trace_rows(const WideBvh& tree, std::span<const Ray> rays, HitRows hits,
                       std::uint8_t* occluded, const TraceOptions& options, const RowsDone& done,
                       const HitCheck* check) {
    check_call(options);
    static_cast<void>(kernels_for(options.isa));
    if (!tree.empty()) return trace_batch(tree, rays, hits, occluded, options, done, check);
    for (std::size_t i = 0; i < rays.size(); ++i)
        if (hits)
            hits.put(i, {});
        else
            occluded[i] = 0;
    if (done) done(0, nullptr, 0, rays.size());
    return miss_all(rays);
}

SimdPath choose_simd_path(const WideBvh& tree, std::span<const Ray> rays) {
    return look_at(tree.arrays().bounds, rays).path;
}

namespace {

/// How many of the limits, which grow, x is beyond.
template <std::size_t n>
std::uint32_t beyond(const float (&limits)[n], float x) {
    std::uint32_t count = 0;
    for (const float limit : limits) count += !(x <= limit);
    return count;
}

/// As far as a plain test tells.
bool passes_by(const Aabb& box, const Ray& ray) {
    float in = ray.tmin, out = ray.tmax;
    const auto cut = [&](float lo, float hi, float origin, float direction) {
        const float to_lo = (lo - origin) / direction, to_hi = (hi - origin) / direction;
        in = max_of(in, min_of(to_lo, to_hi)), out = min_of(out, max_of(to_lo, to_hi));
    };
    cut(box.lo.x, box.hi.x, ray.origin.x, ray.direction.x);
    cut(box.lo.y, box.hi.y, ray.origin.y, ray.direction.y);
    cut(box.lo.z, box.hi.z, ray.origin.z, ray.direction.z);
    return in > out;
}

}  // namespace

namespace {

/// Of the longest side of the bounds: rays that start as close are neighbours.
constexpr float small_part = 0.05f;

/// Fewer rays are often a part of a picture, of which each part has a view of its own.
constexpr std::size_t least_rays_of_view = 8192;

/// Of a picture whose middle ray this one is; none if it cannot be told.
std::optional<BatchView> seen_by(const Aabb& bounds, float longest_side, const Ray& ray) {
    if (!is_valid(ray) || !(longest_side > 0)) return {};
    const float longest = longest_of(ray);
    const Vec3 from = ray.origin - bounds.lo, d = ray.direction;
    return BatchView{{from.x / longest_side, from.y / longest_side, from.z / longest_side},
                     {d.x / longest, d.y / longest, d.z / longest}};
}

}  // namespace

bool are_few(const Aabb& bounds, std::span<const Ray> rays, SimdPath path) {
    const std::size_t n = rays.size();
    if (n >= few_rays || path != SimdPath::automatic || are_few(n, path)) return are_few(n, path);
    const FloatEnvironment plain;
    const Vec3 size = bounds.hi - bounds.lo;
    const float far = small_part * max_of(max_of(size.x, size.y), size.z);
    for (const std::size_t k : {n / 2, n - 1}) {
        const Vec3 away = rays[k].origin - rays[0].origin;
        if (max_of(max_of(std::fabs(away.x), std::fabs(away.y)), std::fabs(away.z)) > far)
            return true;
    }
    return false;
}

BatchLook look_at(const Aabb& bounds, std::span<const Ray> rays, std::size_t batch) {
    const FloatEnvironment plain;
    constexpr std::size_t largest_window = 64;
    const std::size_t window = std::min(largest_window, rays.size());
    constexpr float small_angle = 0.25f, wide_angle = 1.0f;
    constexpr float parts[] = {0.002f, 0.01f, small_part, 0.3f},
                    angles[] = {small_angle, wide_angle};
    const Vec3 size = bounds.hi - bounds.lo;
    const float longest_side = max_of(max_of(size.x, size.y), size.z);
    const std::size_t windows = std::clamp<std::size_t>(rays.size() / 256, 1, 32);
    constexpr std::size_t put_to_bounds = 8;  // of a window
    std::size_t looked_at = 0, coherent = 0, close = 0, apart = 0, spread = 0, odd = 0, passing = 0;
    for (std::size_t w = 0; w < windows; ++w) {
        const std::size_t begin = rays.size() / windows * w;
        if (window == 0 || begin + window > rays.size()) break;
        Aabb origins = empty_box(), directions = empty_box();
        for (const Ray& ray : rays.subspan(begin, window)) {
            if (!is_valid(ray)) continue;
            const Vec3 d = ray.direction;
            const float longest = longest_of(ray);
            odd += !is_near_unit(longest);
            const Vec3 scaled{d.x / longest, d.y / longest, d.z / longest};
            origins = unite(origins, {ray.origin, ray.origin});
            directions = unite(directions, {scaled, scaled});
        }
        ++looked_at;
        for (std::size_t k = 0; k < put_to_bounds; ++k)
            passing += passes_by(bounds, rays[begin + k * window / put_to_bounds]);
        const Vec3 o = origins.hi - origins.lo, d = directions.hi - directions.lo;
        const float from = max_of(max_of(o.x, o.y), o.z), to = max_of(max_of(d.x, d.y), d.z);
        const bool here = from <= small_part * longest_side;
        close += here;
        coherent += here && to <= small_angle;
        apart += beyond(parts, from / longest_side);
        spread += beyond(angles, to);
    }
    BatchLook look{SimdPath::packet, {}, false};
    look.kind.size = BatchKind::size_of(batch);
    if (looked_at != 0) {
        look.kind.apart = static_cast<std::uint32_t>((apart + looked_at / 2) / looked_at);
        look.kind.spread = static_cast<std::uint32_t>((spread + looked_at / 2) / looked_at);
        look.scaled = 8 * odd >= window * looked_at;
        look.passing = 8 * passing >= put_to_bounds * looked_at;
    }
    if (looked_at != 0 && batch >= least_rays_of_view && look.kind.apart == 0 &&
        look.kind.spread == 0)
        look.kind.view = seen_by(bounds, longest_side, rays[rays.size() / 2]);
    if (4 * coherent < 3 * looked_at)
        look.path = 2 * close >= looked_at ? SimdPath::stream : SimdPath::sorted;
    return look;
}

namespace {

TreeHit one_ray_of(OneRay* kernel, const WideBvh& tree, const Ray& ray) {
    return one_ray(kernel, view_of(tree.arrays()), wide_stack_capacity(tree.stats().max_depth),
                   ray);
}

}  // namespace

Hit closest_hit(const WideBvh& tree, const Ray& ray) {
    static OneRay* const kernel = simd_kernels().front().closest;
    return tree.empty() ? Hit{} : hit_of_tree(one_ray_of(kernel, tree, ray));
}

bool any_hit(const WideBvh& tree, const Ray& ray) {
    static OneRay* const kernel = simd_kernels().front().any;
    return !tree.empty() && one_ray_of(kernel, tree, ray).hit();
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
