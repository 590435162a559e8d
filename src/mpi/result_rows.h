// Rows of any length whose parts come from several ranks: kept as they come, and put behind one
// another in the end. And how a rank answers with rows: in chunks, until its share is used up.
#pragma once

#include <raydix/buffer.h>
#include <raydix/error.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <span>
#include <vector>

#include "exec/result_budget.h"
#include "mpi/exchange.h"

namespace raydix::mpi {

/// A point and its d2, as it travels.
template <class T>
struct FoundGlobal {
    std::uint64_t id;
    T d2;
};

/// Parts of rows. All it holds is charged to a budget.
template <class Row>
class RowStore {
public:
    RowStore(const char* what, std::size_t queries, std::uint64_t max_result_bytes)
        : budget_(what, max_result_bytes),
          queries_(queries),
          rows_(BudgetAllocator<Row>(&budget_)),
          parts_(BudgetAllocator<Part>(&budget_)) {}

    /// A count, and so many rows.
    void take(std::size_t query, Reader& reader) {
        const auto count = reader.take<std::uint64_t>();
        if (count == 0) return;
        parts_.push_back({query, rows_.size(), count});
        for (std::uint64_t k = 0; k < count; ++k) rows_.push_back(reader.take<Row>());
    }

    /// Rows in the order of queries, each sorted by `before`: offsets [queries + 1], out; then
    /// each(place, row) for all.
    template <class Before, class Each>
    void finish(Buffer<std::uint64_t>& offsets, std::uint64_t bytes_each, const Before& before,
                const Each& each) {
        budget_.take((queries_ + 1) * sizeof(std::uint64_t));
        offsets.reset(queries_ + 1);
        std::fill_n(offsets.data(), queries_ + 1, std::uint64_t{0});
        for (const Part& part : parts_) offsets[part.query + 1] += part.count;
        std::inclusive_scan(offsets.data(), offsets.data() + queries_ + 1, offsets.data());
        budget_.take_last(saturating_product(offsets[queries_], bytes_each));
        each.make_room(offsets[queries_]);
        std::stable_sort(parts_.begin(), parts_.end(),
                         [](const Part& a, const Part& b) { return a.query < b.query; });
        BudgetVector<Row> row(rows_.get_allocator());
        for (std::size_t p = 0; p < parts_.size();) {
            const std::size_t query = parts_[p].query;
            row.clear();
            for (; p < parts_.size() && parts_[p].query == query; ++p) {
                const auto begin = rows_.begin() + static_cast<std::ptrdiff_t>(parts_[p].begin);
                row.insert(row.end(), begin, begin + static_cast<std::ptrdiff_t>(parts_[p].count));
            }
            std::sort(row.begin(), row.end(), before);
            for (std::size_t k = 0; k < row.size(); ++k) each(offsets[query] + k, row[k]);
        }
    }

private:
    struct Part {
        std::size_t query;
        std::size_t begin;
        std::uint64_t count;
    };

    ResultBudget budget_;
    std::size_t queries_;
    BudgetVector<Row> rows_;
    BudgetVector<Part> parts_;
};

/// Answers questions by search(chunk, limit) until `out` holds more than `most` bytes; at least
/// one. A chunk whose rows would not fit into what is left of `most` is halved. The limit of a
/// single question is 0, half of what is left to the process: how long a result may be is for the
/// rank to say that asked. Returns how many were answered.
template <class Question, class Search>
std::uint64_t answer_in_chunks(std::span<const Question> questions, std::uint64_t most,
                               const Bytes& out, const Search& search) {
    constexpr std::size_t most_in_chunk = 1024;
    // What a search of one chunk may hold apart from rows.
    constexpr std::uint64_t least_room = std::uint64_t{1} << 20;
    std::size_t done = 0, in_chunk = most_in_chunk;
    while (done < questions.size() && (done == 0 || out.size() < most)) {
        const std::size_t size = std::min(in_chunk, questions.size() - done);
        try {
            search(questions.subspan(done, size),
                   size == 1
                       ? 0
                       : std::max(most - std::min<std::uint64_t>(most, out.size()), least_room));
            done += size;
        } catch (const ResultTooLarge&) {
            if (size == 1) throw;
            in_chunk = size / 2;
        }
    }
    return done;
}

}  // namespace raydix::mpi
