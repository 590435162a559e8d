// Hits of a job's rays in no order -> those of one ray behind those of the one before.
#pragma once

#include <raydix/types.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "exec/result_budget.h"

namespace raydix {

/// Copies of hits, in the order of their rays, as far as they are not many; for one thread.
class HitRoom {
public:
    static constexpr std::size_t most = 8192;

    template <class Rows>
    std::span<const Hit> group(std::span<const Hit> hits, std::span<const std::uint64_t> counts,
                               const Rows& rows) {
        next_.resize(counts.size());
        std::exclusive_scan(counts.begin(), counts.end(), next_.begin(), std::uint64_t{0});
        if (hits_.size() < hits.size()) hits_.resize(std::max(hits.size(), 2 * hits_.size()));
        for (const Hit& hit : hits) hits_[next_[rows.ray(hit)]++] = hit;
        return std::span(hits_).first(hits.size());
    }

private:
    std::vector<std::uint64_t> next_;
    std::vector<Hit> hits_;
};

/// hits[before] on -> in rows, one a ray, each sorted and without repetitions; how many of each ray
/// to `counts`. Returns how many in all. Rows says of hits:
///   std::uint32_t ray(const Hit&)
///   Hit bare(Hit)                  without what only names the ray
///   bool is_before(a, b), bool same(a, b)  of bare hits of one ray
template <class Rows>
std::uint64_t put_in_rows(BudgetVector<Hit>& hits, std::size_t before,
                          std::span<std::uint64_t> counts, const Rows& rows) {
    constexpr std::uint64_t few = 16;  // so many are sorted one after the other
    const auto is_before = [&](const Hit& a, const Hit& b) { return rows.is_before(a, b); };
    const std::span<Hit> all = std::span(hits).subspan(before);
    std::ranges::fill(counts, std::uint64_t{0});
    for (const Hit& hit : all) ++counts[rows.ray(hit)];
    std::span<const Hit> grouped = all;
    if (all.size() <= HitRoom::most) {
        thread_local HitRoom room;
        grouped = room.group(all, counts, rows);
    } else {
        std::ranges::sort(all, {}, [&](const Hit& hit) { return rows.ray(hit); });
    }
    // Rows never grow: none is written over before it is read.
    Hit* end = all.data();
    const Hit* from = grouped.data();
    for (std::uint64_t& count : counts) {
        Hit* const row = end;
        for (const Hit* const last = from + count; from != last; ++from, ++end) {
            const Hit hit = rows.bare(*from);
            Hit* to = end;
            if (count <= few)
                for (; to != row && is_before(hit, to[-1]); --to) *to = to[-1];
            *to = hit;
        }
        if (count < 2) continue;
        if (count > few) std::sort(row, end, is_before);
        end = std::unique(row, end, [&](const Hit& a, const Hit& b) { return rows.same(a, b); });
        count = static_cast<std::uint64_t>(end - row);
    }
    const auto kept = static_cast<std::size_t>(end - all.data());
    hits.resize(before + kept);
    return kept;
}

}  // namespace raydix
