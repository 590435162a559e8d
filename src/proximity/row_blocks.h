// Rows of ids of any length, found by batches of queries -> one list, each row in order.
// Lists: OverlapLists or SceneOverlapLists.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "exec/result_budget.h"
#include "proximity/query_batch.h"

namespace raydix {

/// Rows that are found block by block, until all their lengths are known. They are put in order
/// when they have their place in the result, so that one that does not fit is refused before; trees
/// with parts of triangles find an id more than once, and order at once to count.
template <class Lists>
class RowBlocks {
public:
    using Id = typename decltype(Lists::prims)::value_type;

    RowBlocks(std::size_t queries, bool finds_twice, ResultBudget& budget)
        : budget_(budget),
          finds_twice_(finds_twice),
          found_(budget_lists<Id>(block_count(queries), budget)) {
        budget_.take((queries + 1) * sizeof(std::uint64_t));
        lists_.offsets.resize(queries + 1, 0);
    }

    /// The row of query i goes behind those that its block has: each id once.
    /// find(ids) puts them there.
    template <class Find>
    std::uint64_t add_row(std::size_t block, std::size_t i, const Find& find) {
        BudgetVector<Id>& ids = found_[block];
        const std::size_t before = ids.size();
        find(ids);
        if (finds_twice_) {
            const auto row = ids.begin() + static_cast<std::ptrdiff_t>(before);
            std::sort(row, ids.end());
            ids.erase(std::unique(row, ids.end()), ids.end());
        }
        return lists_.offsets[i + 1] = ids.size() - before;
    }
    /// The block is complete. Its place in the result is taken now: too many are known early.
    void finish(std::size_t block) {
        pack(found_[block]);
        budget_.take(found_[block].size() * sizeof(Id));
    }

    /// `order`: the one in which the rows were added.
    Lists join(std::span<const std::uint32_t> order) {
        for (std::size_t i = 0; i + 1 < lists_.offsets.size(); ++i)
            lists_.offsets[i + 1] += lists_.offsets[i];
        lists_.prims.resize(lists_.offsets.back());
        for_each_query_block(
            lists_.offsets.size() - 1, order,
            [&](std::size_t block, std::size_t begin, std::size_t end, const auto& at) {
                const BudgetVector<Id> ids = std::move(found_[block]);
                const Id* from = ids.data();
                for (std::size_t k = begin; k < end; ++k) {
                    const std::uint64_t to = lists_.offsets[at(k)];
                    const std::uint64_t length = lists_.offsets[at(k) + 1] - to;
                    Id* const row = lists_.prims.data() + to;
                    std::copy_n(from, length, row);
                    if (!finds_twice_) std::sort(row, row + length);
                    from += length;
                }
            });
        return std::move(lists_);
    }

private:
    ResultBudget& budget_;
    bool finds_twice_;
    BudgetVector<BudgetVector<Id>> found_;
    Lists lists_;
};

}  // namespace raydix
