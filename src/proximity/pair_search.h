// Pairs of primitives of two trees, in float or in double: both are walked together by many
// threads, then the pairs are brought into order by counting those of each first id.
#pragma once

#include <raydix/pairs.h>

#include <algorithm>
#include <atomic>
#include <type_traits>
#include <vector>

#include "exec/parallel.h"
#include "proximity/pair_walk.h"
#include "proximity/result_limit.h"

namespace raydix {

using Pairs = std::vector<PrimitivePair>;

/// What happens to the pairs that one task finds.
class Collector {
public:
    Collector(bool keep, ResultLimit& limit, Pairs& found)
        : keep_(keep), limit_(limit), found_(found) {}
    Collector(const Collector&) = delete;
    Collector& operator=(const Collector&) = delete;

    void take(std::uint32_t first, std::uint32_t second) const {
        ++count_;
        if (!keep_) return;
        found_.push_back({first, second});
        if (count_ == pairs_between_checks) report();
    }
    void report() const {
        limit_.add(count_);
        count_ = 0;
    }

private:
    static constexpr std::uint64_t pairs_between_checks = 1u << 16;
    bool keep_;
    ResultLimit& limit_;
    Pairs& found_;
    mutable std::uint64_t count_ = 0;
};

/// Whether primitives whose boxes overlap are a pair.
template <bool same, class Tree>
bool is_pair(const Tree& a, const Tree& b, std::uint32_t k, std::uint32_t l, bool narrow) {
    if constexpr (std::is_same_v<Tree, PairTreeD>) {
        const LeafTriangleD &s = a.triangles[k], &t = b.triangles[l];
        if (!boxes_touch(box_of(s.v0, s.v1, s.v2), box_of(t.v0, t.v1, t.v2))) return false;
    }
    if (same && a.triangles != nullptr && a.share_a_corner(k, l)) return false;
    return !narrow || triangles_touch(a.triangles[k], b.triangles[l]);
}

/// All pairs, in lists without order; empty ones if they are only counted.
template <bool same, class Tree>
std::vector<Pairs> find_pairs(const Tree& a, const Tree& b, bool narrow, bool keep,
                              ResultLimit& limit) {
    constexpr std::size_t tasks_wanted = 4096;
    const auto in_order = [&](std::uint32_t k, std::uint32_t l, const Collector& out) {
        if (!is_pair<same>(a, b, k, l, narrow)) return;
        const std::uint32_t i = a.boxes[k].prim, j = b.boxes[l].prim;
        if (same && j < i)
            out.take(j, i);
        else
            out.take(i, j);
    };
    std::vector<Pairs> lists(1);
    std::vector<SlotPair> tasks;
    {
        const Collector out(keep, limit, lists[0]);
        const auto pair = [&](std::uint32_t k, std::uint32_t l) { in_order(k, l, out); };
        tasks =
            spread_pairs(PairWalk<same, Tree, decltype(pair)>(a, b, pair), {0, 0}, tasks_wanted);
        out.report();
    }
    lists.resize(tasks.size() + 1);
    for_each_range(tasks.size(), 1, [&](std::size_t begin, std::size_t end) {
        std::vector<SlotPair> stack;
        for (std::size_t task = begin; task < end; ++task) {
            const Collector out(keep, limit, lists[task + 1]);
            const auto pair = [&](std::uint32_t k, std::uint32_t l) { in_order(k, l, out); };
            walk_pairs(PairWalk<same, Tree, decltype(pair)>(a, b, pair), tasks[task],
                       a.max_depth + b.max_depth, stack);
            out.report();
        }
    });
    return lists;
}

/// Lists in any order -> one by (first, second); `rows` is past the highest first id.
inline Pairs sort_pairs(std::vector<Pairs>& lists, std::size_t rows, std::uint64_t total) {
    std::vector<std::uint64_t> ends(rows + 1, 0);  // of the rows, once the pairs are in place
    const auto for_each_pair = [&](const auto& visit) {
        for_each_index(
            lists.size(),
            [&](std::size_t list) {
                for (const PrimitivePair& pair : lists[list]) visit(pair);
            },
            1);
    };
    for_each_pair([&](const PrimitivePair& pair) {
        std::atomic_ref(ends[pair.first + 1]).fetch_add(1, std::memory_order_relaxed);
    });
    for (std::size_t row = 0; row < rows; ++row) ends[row + 1] += ends[row];
    Pairs sorted(total);
    for_each_pair([&](const PrimitivePair& pair) {  // ends[row]: the next free place of the row
        sorted[std::atomic_ref(ends[pair.first]).fetch_add(1, std::memory_order_relaxed)] = pair;
    });
    for_each_index(rows, [&](std::size_t row) {
        const std::uint64_t begin = row == 0 ? 0 : ends[row - 1];
        std::sort(
            sorted.begin() + static_cast<std::ptrdiff_t>(begin),
            sorted.begin() + static_cast<std::ptrdiff_t>(ends[row]),
            [](const PrimitivePair& x, const PrimitivePair& y) { return x.second < y.second; });
    });
    return sorted;
}

/// Finds and, if wanted, sorts them; returns how many. `b` null: within `a`. Side: a tree in the
/// shape that walks want, made from it and from the one where its nodes shall be.
template <class Side, class AnyBvh>
std::uint64_t run_pairs(const AnyBvh& a, const AnyBvh* b, const PairOptions& options,
                        Pairs* result) {
    if (a.empty() || (b != nullptr && b->empty())) return 0;
    ResultLimit limit("pairs", result != nullptr ? options.max_bytes : ~std::uint64_t{0},
                      sizeof(PrimitivePair));
    with_threads(options.threads, [&] {
        const Side side_a(a, a);
        const bool keep = result != nullptr;
        std::vector<Pairs> lists;
        if (b == nullptr)
            lists = find_pairs<true>(side_a.tree, side_a.tree, options.narrow, keep, limit);
        else
            lists = find_pairs<false>(side_a.tree, Side(*b, a).tree, options.narrow, keep, limit);
        if (keep) *result = sort_pairs(lists, a.input_count(), limit.count());
    });
    return limit.count();
}

template <class Side, class AnyBvh>
Pairs all_pairs(const AnyBvh& a, const AnyBvh* b, const PairOptions& options) {
    Pairs pairs;
    run_pairs<Side>(a, b, options, &pairs);
    return pairs;
}

}  // namespace raydix
