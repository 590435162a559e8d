// The doors to the kernels that are compiled once per instruction set.
#pragma once

#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <vector>

#include "exec/result_budget.h"
#include "trace/simd/call_history.h"
#include "trace/simd/stream_rays.h"
#include "trace/simd/wide_ray.h"

namespace raydix {

inline constexpr std::size_t max_job_rays = 16384;
/// So many rays that go alone take turns.
inline constexpr std::size_t rays_in_turn = 20;

struct SimdCounts {
    std::uint64_t hits = 0, invalid = 0, visits = 0, tests = 0;
};

/// Where hits go: TreeHits, or Hits on one geometry of a scene. By default, and from a null
/// pointer, there are none, and it is false.
class HitRows {
public:
    HitRows() = default;
    explicit HitRows(TreeHit* hits) : first_(hits) {}
    HitRows(Hit* hits, std::uint32_t geometry)
        : first_(hits), bytes_(sizeof(Hit)), geometry_(geometry) {}
    explicit operator bool() const { return first_ != nullptr; }

    [[nodiscard]] HitRows from(std::size_t i) const {
        HitRows out = *this;
        if (out) out.first_ = out.at(i);
        return out;
    }
    [[nodiscard]] TreeHit* at(std::size_t i) const {
        return reinterpret_cast<TreeHit*>(reinterpret_cast<char*>(first_) + bytes_ * i);
    }
    [[nodiscard]] bool of_scene() const { return bytes_ == sizeof(Hit); }
    [[nodiscard]] std::uint32_t geometry() const { return geometry_; }

    void put(std::size_t i, const TreeHit& hit) const {
        *at(i) = hit;
        if (of_scene()) put_place(i, hit.hit() ? geometry_ : no_primitive);
    }
    /// What a tree does not know.
    void put_place(std::size_t i, std::uint32_t geometry) const {
        const std::uint32_t place[2] = {geometry, 0};
        std::memcpy(&static_cast<Hit*>(at(i))->geometry, place, sizeof place);  // both in one store
    }

private:
    TreeHit* first_ = nullptr;
    std::size_t bytes_ = sizeof(TreeHit);
    std::uint32_t geometry_ = no_primitive;
};

/// At most max_job_rays rays, rays[order[k]], or rays[k] without an order; hits, or occluded if
/// there are no rows for hits, go to the same places.
struct SimdJob {
    WideView tree;
    const Ray* rays;
    const std::uint32_t* order;
    std::size_t n;
    HitRows hits;
    std::uint8_t* occluded;
    WideStackView stack;
    PacketStackView packet_stack;
    StreamMemory* memory;
    bool counting;
    std::size_t stack_size = 0;  // of each of rays_in_turn rays that go alone
    /// All hits instead, without an order and not in streams: behind those of earlier rays, sorted
    /// (all_hits.h); how many each ray has to hit_counts [n].
    BudgetVector<Hit>* all = nullptr;
    std::uint64_t* hit_counts = nullptr;
    /// Closest or any of the hits that it accepts; not in streams. null: of all.
    const HitCheck* check = nullptr;
    /// Rays that take turns are first put to the root's bounds: many pass them by.
    bool passing = false;
};

/// `tree` need not have room for blocks of a compact tree.
using OneRay = TreeHit(const WideView& tree, const Ray& ray, const WideStackView& stack,
                       CallHistory& history);

/// Copies have room for so many rays more than they have.
inline constexpr std::size_t spare_scaled_rays = 16;
/// scaled_copy (scaled_rays.h) of n rays, rays[order[k]] or rays[k] without an order.
using ScaleRays = void(const Ray* rays, const std::uint32_t* order, std::size_t n, Ray* copies,
                       float* scales);

struct SimdKernels {
    std::string_view isa;
    /// One ray; for any hit only the primitive has a meaning.
    OneRay* closest;
    OneRay* any;
    void (*single)(const SimdJob& job, SimdCounts& counts);
    void (*packets)(const SimdJob& job, SimdCounts& counts);
    void (*streams)(const SimdJob& job, SimdCounts& counts);
    ScaleRays* scale;
};

/// Best first; those this processor can run.
[[nodiscard]] std::span<const SimdKernels> simd_kernels();

}  // namespace raydix
