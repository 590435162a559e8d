// Batches through one wide tree, for what stands on top of them.
#pragma once

#include <raydix/wide.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <functional>
#include <span>
#include <vector>

#include "exec/job_blocks.h"
#include "exec/path_rates.h"
#include "trace/simd/simd_kernels.h"

namespace raydix {

/// Throws InputError that names those there are. Empty: the best.
[[nodiscard]] const SimdKernels& kernels_for(const std::string& isa);

/// What rays through anything with these bounds are like: choose_simd_path, and more.
struct BatchLook {
    SimdPath path;
    BatchKind kind;        // `any` and `sorted` are left to the caller
    bool scaled = false;   // many directions are far from unit length: scaled_rays.h
    bool passing = false;  // many rays pass the bounds by
};
/// `batch`: how many rays it has if `rays` are some of them.
[[nodiscard]] BatchLook look_at(const Aabb& bounds, std::span<const Ray> rays, std::size_t batch);
[[nodiscard]] inline BatchLook look_at(const Aabb& bounds, std::span<const Ray> rays) {
    return look_at(bounds, rays, rays.size());
}

/// A batch of so many rays or fewer is one job, on the caller's thread.
inline constexpr std::size_t undivided_rays = 1024;

/// Whether rays go one by one without a plan, which would cost them more than it gains.
[[nodiscard]] inline bool are_few(std::size_t rays, SimdPath path) {
    return rays < 12 && (path == SimdPath::automatic || path == SimdPath::single);
}
/// The same where the rays and what they go through are known: fewer than 32 that start apart would
/// be sent one by one by a plan, too.
[[nodiscard]] bool are_few(const Aabb& bounds, std::span<const Ray> rays, SimdPath path);

/// How many rays a job has. Streams have as many in a job as give full vectors deep in the tree and
/// still lie in the second-level cache. Jobs are also what ways are tried on.
enum class JobSize : std::uint8_t {
    small,   // 1,024
    medium,  // a 32nd of the batch: it learns from its own first ones. At least as many as that
    large,   // a quarter, likewise: what streams need
};

/// Rays 0 to n - 1 as jobs, on the threads of the calling context; smaller ones where the batch
/// would not keep all threads busy. `counted`: visits are, so that jobs may depend on the batch
/// alone.
[[nodiscard]] JobBlocks jobs_of(std::size_t n, JobSize size, bool counted = false);

/// Stacks for the deepest path of a tree.
class StackMemory {
public:
    explicit StackMemory(std::uint32_t max_depth) { reserve(max_depth); }
    StackMemory() = default;
    void reserve(std::uint32_t max_depth) { reserve_words(wide_stack_capacity(max_depth)); }
    void reserve_words(std::size_t n) {
        if (n <= pairs_.size()) return;  // the last to grow: memory may have ended before
        words_.resize(n), entries_.resize(n), pairs_.resize(n);
    }
    [[nodiscard]] WideStackView view() { return {words_.data(), entries_.data(), pairs_.data()}; }
    [[nodiscard]] PacketStackView packet_view() {
        return {words_.data(), entries_.data(), pairs_.data()};
    }

private:
    std::vector<std::uint32_t> words_;
    std::vector<float> entries_;
    std::vector<std::uint64_t> pairs_;  // or sets of active rays
};

/// The hits of rays first + order[begin] to first + order[end - 1] are there; without an order,
/// those of first + begin to first + end - 1.
using RowsDone = std::function<void(std::size_t first, const std::uint32_t* order,
                                    std::size_t begin, std::size_t end)>;

/// Calls place(hit) for the hits that are there.
template <class Place>
void for_each_row(Hit* hits, const std::uint32_t* order, std::size_t begin, std::size_t end,
                  const Place& place) {
    if (order == nullptr)
        std::for_each(hits + begin, hits + end, place);
    else
        for (std::size_t k = begin; k < end; ++k) place(hits[order[k]]);
}

/// As trace or, without rows for hits, trace_any; `done`, unless empty, comes once for each ray, on
/// any thread.
/// `check`: of the hits that it accepts, or null; its rays are the caller's.
TraceCounts trace_rows(const WideBvh& tree, std::span<const Ray> rays, HitRows hits,
                       std::uint8_t* occluded, const TraceOptions& options, const RowsDone& done,
                       const HitCheck* check = nullptr);

}  // namespace raydix
