#include "trace/all_hits.h"

#include <algorithm>
#include <numeric>
#include <span>

namespace raydix {

namespace {

bool is_before(const Hit& a, const Hit& b) { return a.t != b.t ? a.t < b.t : a.prim < b.prim; }

/// So many are sorted one after the other.
constexpr std::uint64_t few = 16;

/// Copies of hits, in the order of their rays, as far as they are not many; for one thread.
class Room {
public:
    static constexpr std::size_t most = 8192;

    std::span<const Hit> group(std::span<const Hit> hits, std::span<const std::uint64_t> counts) {
        next_.resize(counts.size());
        std::exclusive_scan(counts.begin(), counts.end(), next_.begin(), std::uint64_t{0});
        if (hits_.size() < hits.size()) hits_.resize(std::max(hits.size(), 2 * hits_.size()));
        for (const Hit& hit : hits) hits_[next_[hit.instance]++] = hit;
        return std::span(hits_).first(hits.size());
    }

private:
    std::vector<std::uint64_t> next_;
    std::vector<Hit> hits_;
};

}  // namespace

std::uint64_t group_by_ray(BudgetVector<Hit>& hits, std::size_t before, std::size_t rays,
                           std::uint64_t* hit_counts) {
    const std::span<Hit> all = std::span(hits).subspan(before);
    const std::span<std::uint64_t> counts(hit_counts, rays);
    std::ranges::fill(counts, std::uint64_t{0});
    for (const Hit& hit : all) ++counts[hit.instance];
    std::span<const Hit> grouped = all;
    if (all.size() <= Room::most) {
        thread_local Room room;
        grouped = room.group(all, counts);
    } else {
        std::ranges::sort(all, {}, &Hit::instance);
    }
    // Rows never grow: none is written over before it is read.
    Hit* end = all.data();
    const Hit* from = grouped.data();
    for (std::uint64_t& count : counts) {
        Hit* const row = end;
        for (const Hit* const last = from + count; from != last; ++from, ++end) {
            Hit hit = *from;
            hit.instance = 0;
            Hit* to = end;
            if (count <= few)
                for (; to != row && is_before(hit, to[-1]); --to) *to = to[-1];
            *to = hit;
        }
        if (count < 2) continue;
        if (count > few) std::sort(row, end, is_before);
        end = std::unique(row, end, [](const Hit& a, const Hit& b) { return a.prim == b.prim; });
        count = static_cast<std::uint64_t>(end - row);
    }
    const auto kept = static_cast<std::size_t>(end - all.data());
    hits.resize(before + kept);
    return kept;
}

}  // namespace raydix
