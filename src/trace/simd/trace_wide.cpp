// Batches of rays through a wide tree on threads of the CPU: the kernel `simd`.
#include <raydix/error.h>
#include <raydix/wide.h>

#include <string>
#include <vector>

#include "exec/parallel.h"
#include "trace/simd/simd_kernels.h"

namespace raydix {
namespace {

constexpr std::size_t rays_per_block = 1024;

void check_sizes(std::size_t rays, std::size_t results) {
    if (rays != results)
        throw InputError("trace: " + std::to_string(rays) + " rays, but room for " +
                         std::to_string(results) + " results");
}

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

class StackMemory {
public:
    explicit StackMemory(std::uint32_t max_depth)
        : words_(wide_stack_capacity(max_depth)), entries_(words_.size()) {}
    [[nodiscard]] WideStackView view() { return {words_.data(), entries_.data()}; }

private:
    std::vector<std::uint32_t> words_;
    std::vector<float> entries_;
};

WideView view_of(const WideBvh& tree) {
    const WideBvh::Arrays& arrays = tree.arrays();
    return {arrays.nodes.data(), arrays.blocks.data(), arrays.bounds};
}

TraceCounts trace_batch(const WideBvh& tree, std::span<const Ray> rays, Hit* hits,
                        std::uint8_t* occluded, const TraceOptions& options) {
    const SimdKernels& kernels = kernels_for(options.isa);
    std::vector<SimdCounts> parts((rays.size() + rays_per_block - 1) / rays_per_block);
    with_threads(options.threads, [&] {
        for_each_block(
            rays.size(), rays_per_block,
            [&](std::size_t block, std::size_t begin, std::size_t end) {
                StackMemory stack(tree.stats().max_depth);
                SimdJob job{view_of(tree),  rays.data() + begin,
                            nullptr,        end - begin,
                            hits == nullptr ? nullptr : hits + begin,
                            hits == nullptr ? occluded + begin : nullptr,
                            stack.view(),   options.counters};
                kernels.single(job, parts[block]);
            });
    });
    TraceCounts sum;
    sum.rays = rays.size();
    for (const SimdCounts& part : parts) {
        sum.hits += part.hits;
        sum.invalid_rays += part.invalid;
        sum.node_visits += part.visits;
        sum.triangle_tests += part.tests;
    }
    return sum;
}

/// Nothing to hit: all rays miss, but invalid ones still count.
TraceCounts miss_all(std::span<const Ray> rays) {
    TraceCounts counts;
    counts.rays = rays.size();
    for (const Ray& ray : rays) counts.invalid_rays += !is_valid(ray);
    return counts;
}

}  // namespace

TraceCounts trace(const WideBvh& tree, std::span<const Ray> rays, std::span<Hit> hits,
                  const TraceOptions& options) {
    check_sizes(rays.size(), hits.size());
    if (!tree.empty()) return trace_batch(tree, rays, hits.data(), nullptr, options);
    for (Hit& hit : hits) hit = Hit{};
    return miss_all(rays);
}

std::vector<Hit> trace(const WideBvh& tree, std::span<const Ray> rays, const TraceOptions& options) {
    std::vector<Hit> hits(rays.size());
    trace(tree, rays, hits, options);
    return hits;
}

TraceCounts trace_any(const WideBvh& tree, std::span<const Ray> rays,
                      std::span<std::uint8_t> occluded, const TraceOptions& options) {
    check_sizes(rays.size(), occluded.size());
    if (!tree.empty()) return trace_batch(tree, rays, nullptr, occluded.data(), options);
    for (std::uint8_t& o : occluded) o = 0;
    return miss_all(rays);
}

namespace {

template <class Result>
Result one_ray(const WideBvh& tree, const Ray& ray, bool closest) {
    constexpr std::size_t inside = 512;
    const std::size_t capacity = wide_stack_capacity(tree.stats().max_depth);
    std::uint32_t words[inside];
    float entries[inside];
    std::unique_ptr<StackMemory> outside;
    WideStackView stack{words, entries};
    if (capacity > inside) {
        outside = std::make_unique<StackMemory>(tree.stats().max_depth);
        stack = outside->view();
    }
    Result result{};
    SimdCounts counts;
    SimdJob job{view_of(tree), &ray, nullptr, 1, nullptr, nullptr, stack, false};
    if constexpr (std::is_same_v<Result, Hit>)
        job.hits = &result;
    else
        job.occluded = &result;
    static_cast<void>(closest);
    static const SimdKernels& kernels = simd_kernels().front();
    kernels.single(job, counts);
    return result;
}

}  // namespace

Hit closest_hit(const WideBvh& tree, const Ray& ray) {
    return tree.empty() ? Hit{} : one_ray<Hit>(tree, ray, true);
}

bool any_hit(const WideBvh& tree, const Ray& ray) {
    return !tree.empty() && one_ray<std::uint8_t>(tree, ray, false) != 0;
}

std::vector<std::string> simd_instruction_sets() {
    std::vector<std::string> names;
    for (const SimdKernels& kernels : simd_kernels()) names.emplace_back(kernels.isa);
    return names;
}

}  // namespace raydix
