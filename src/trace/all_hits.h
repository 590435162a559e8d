// Hits of single rays -> one array in the order of the rays (AllHits, AllHitsD), within the memory
// that the call may take.
#pragma once

#include <raydix/trace.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "exec/parallel.h"
#include "exec/result_budget.h"

namespace raydix {

/// Sorts what one ray hit, hits[before] on, by (t, prim). A triangle that is in several leaves was
/// found more than once, with the same t: the others go.
template <class AnyHit>
inline void finish_ray(BudgetVector<AnyHit>& hits, std::size_t before) {
    const auto first = hits.begin() + static_cast<std::ptrdiff_t>(before);
    std::sort(first, hits.end(), [](const AnyHit& a, const AnyHit& b) {
        return a.t != b.t ? a.t < b.t : a.prim < b.prim;
    });
    hits.erase(std::unique(first, hits.end(),
                           [](const AnyHit& a, const AnyHit& b) { return a.prim == b.prim; }),
               hits.end());
}

/// A hit of ray `place` of a job; hits are by no means in the order of their rays yet.
inline Hit found_by(std::uint32_t place, const TreeHit& at) {
    Hit hit = hit_of_tree(at);
    hit.instance = place;
    return hit;
}

/// hits[before] on, each of a ray 0 to rays - 1 (found_by) -> those of one ray behind those of the
/// one before, as finish_ray has them; how many to hit_counts [rays]. Returns how many in all.
std::uint64_t group_by_ray(BudgetVector<Hit>& hits, std::size_t before, std::size_t rays,
                           std::uint64_t* hit_counts);

/// What blocks of rays hit, until all of it is known. All: AllHits or AllHitsD.
template <class All>
class HitBlocks {
public:
    using AnyHit = typename decltype(All::hits)::value_type;

    HitBlocks(std::size_t rays, std::size_t rays_per_block, std::uint64_t max_result_bytes)
        : budget_("trace_all", max_result_bytes), rays_per_block_(rays_per_block) {
        budget_.take((rays + 1) * sizeof(std::uint64_t));  // the offsets
        found_ = budget_lists<AnyHit>((rays + rays_per_block - 1) / rays_per_block, budget_);
        all_.offsets.resize(rays + 1, 0);
    }

    /// Hits of the rays b * rays_per_block on, one ray after the other.
    BudgetVector<AnyHit>& hits(std::size_t b) { return found_[b]; }
    /// Of the block that ray i is in.
    BudgetVector<AnyHit>& hits_with(std::size_t i) { return found_[i / rays_per_block_]; }
    /// [rays]: how many hits each ray has.
    std::uint64_t* hit_counts() { return all_.offsets.data() + 1; }
    /// The block b is complete.
    void finish(std::size_t b) {
        budget_.go_on();
        pack(found_[b]);
    }

    All join() {
        for (std::size_t i = 0; i + 1 < all_.offsets.size(); ++i)
            all_.offsets[i + 1] += all_.offsets[i];
        budget_.take_last(all_.offsets.back() * sizeof(AnyHit));
        all_.hits.resize(all_.offsets.back());
        for_each_index(
            found_.size(),
            [&](std::size_t b) {
                BudgetVector<AnyHit> hits = std::move(found_[b]);
                const std::uint64_t at = all_.offsets[b * rays_per_block_];
                std::copy(hits.begin(), hits.end(),
                          all_.hits.begin() + static_cast<std::ptrdiff_t>(at));
            },
            1);
        return std::move(all_);
    }

private:
    ResultBudget budget_;
    std::size_t rays_per_block_;
    BudgetVector<BudgetVector<AnyHit>> found_;
    All all_;
};

}  // namespace raydix
