// Pairs of primitives of two trees, in float or in double: both are walked together by many
// threads, then the pairs are brought into order by counting those of each first id.
#pragma once

#include <raydix/pairs.h>

#include <algorithm>
#include <atomic>
#include <type_traits>
#include <vector>

#include "base/options.h"
#include "exec/parallel.h"
#include "exec/result_budget.h"
#include "proximity/pair_walk.h"

namespace raydix {

using Pairs = std::vector<PrimitivePair>;

/// What happens to the pairs that one task finds.
class Collector {
public:
    /// `found` null: they are only counted.
    Collector(BudgetVector<PrimitivePair>* found, std::atomic<std::uint64_t>& total)
        : found_(found), total_(total) {}
    Collector(const Collector&) = delete;
    Collector& operator=(const Collector&) = delete;

    void take(std::uint32_t first, std::uint32_t second) const {
        ++count_;
        if (found_ != nullptr) found_->push_back({first, second});
    }
    void finish() const {
        if (found_ != nullptr) pack(*found_);
        total_.fetch_add(count_, std::memory_order_relaxed);
    }

private:
    BudgetVector<PrimitivePair>* found_;
    std::atomic<std::uint64_t>& total_;
    mutable std::uint64_t count_ = 0;
};

/// Pairs without order, of each task, and how many there are.
struct FoundPairs {
    BudgetVector<BudgetVector<PrimitivePair>> lists;  // empty if they are only counted
    std::atomic<std::uint64_t> total{0};
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

/// All pairs. `budget` null: they are only counted.
template <bool same, class Tree>
void find_pairs(const Tree& a, const Tree& b, bool narrow, ResultBudget* budget,
                FoundPairs& found) {
    constexpr std::size_t tasks_wanted = 4096;
    const auto in_order = [&](std::uint32_t k, std::uint32_t l, const Collector& out) {
        if (!is_pair<same>(a, b, k, l, narrow)) return;
        const std::uint32_t i = a.boxes[k].prim, j = b.boxes[l].prim;
        if (same && j < i)
            out.take(j, i);
        else
            out.take(i, j);
    };
    BudgetVector<PrimitivePair> met{BudgetAllocator<PrimitivePair>(budget)};
    std::vector<SlotPair> tasks;
    {
        const Collector out(budget != nullptr ? &met : nullptr, found.total);
        const auto pair = [&](std::uint32_t k, std::uint32_t l) { in_order(k, l, out); };
        tasks =
            spread_pairs(PairWalk<same, Tree, decltype(pair)>(a, b, pair), {0, 0}, tasks_wanted);
        out.finish();
    }
    if (budget != nullptr) {
        found.lists = budget_lists<PrimitivePair>(tasks.size() + 1, *budget);
        found.lists.back() = std::move(met);
    }
    for_each_range(tasks.size(), 1, [&](std::size_t begin, std::size_t end) {
        std::vector<SlotPair> stack;
        for (std::size_t task = begin; task < end; ++task) {
            if (budget != nullptr) budget->go_on();
            const Collector out(budget != nullptr ? &found.lists[task] : nullptr, found.total);
            const auto pair = [&](std::uint32_t k, std::uint32_t l) { in_order(k, l, out); };
            walk_pairs(PairWalk<same, Tree, decltype(pair)>(a, b, pair), tasks[task],
                       a.max_depth + b.max_depth, stack);
            out.finish();
        }
    });
}

/// Lists in any order -> one by (first, second); `rows` is past the highest first id.
inline Pairs sort_pairs(const FoundPairs& found, std::size_t rows, ResultBudget& budget) {
    const std::uint64_t total = found.total;
    budget.take_last(total * sizeof(PrimitivePair) + (rows + 1) * sizeof(std::uint64_t));
    const auto& lists = found.lists;
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
    check_threads(options.threads);
    if (a.empty() || (b != nullptr && b->empty())) return 0;
    ResultBudget budget("overlapping_pairs", options.max_result_bytes);
    ResultBudget* const kept = result != nullptr ? &budget : nullptr;
    FoundPairs found;
    with_threads(options.threads, [&] {
        if (kept != nullptr)
            kept->take(Side::bytes_for(a) + (b != nullptr ? Side::bytes_for(*b) : 0));
        const Side side_a(a, a);
        if (b == nullptr)
            find_pairs<true>(side_a.tree, side_a.tree, options.narrow, kept, found);
        else
            find_pairs<false>(side_a.tree, Side(*b, a).tree, options.narrow, kept, found);
        if (kept != nullptr) *result = sort_pairs(found, a.input_count(), budget);
    });
    return found.total;
}

template <class Side, class AnyBvh>
Pairs all_pairs(const AnyBvh& a, const AnyBvh* b, const PairOptions& options) {
    Pairs pairs;
    run_pairs<Side>(a, b, options, &pairs);
    return pairs;
}

}  // namespace raydix
