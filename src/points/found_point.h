// A point that a query found, the orders of rows that are too long for the kernels, and the rows of
// a block of queries one after the other.
#pragma once

#include <raydix/buffer.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <utility>
#include <vector>

#include "exec/result_budget.h"

namespace raydix {

template <class T>
struct FoundPoint {
    T d2;
    std::uint32_t id;
};

/// By (d2, id).
template <class T>
void sort_by_distance(BudgetVector<FoundPoint<T>>& row) {
    using Point = FoundPoint<T>;
    std::sort(row.begin(), row.end(), [](const Point& a, const Point& b) {
        return a.d2 < b.d2 || (a.d2 == b.d2 && a.id < b.id);
    });
}

/// One digit of a radix sort: `row` goes to `sorted`, in the order of bits [shift, shift + bits) of
/// the ids.
template <class T>
void sort_by_digit(const BudgetVector<FoundPoint<T>>& row, int shift, int bits,
                   BudgetVector<FoundPoint<T>>& sorted) {
    std::array<std::uint32_t, 1 << 11> places;
    const std::uint32_t mask = (1u << bits) - 1;
    std::fill_n(places.begin(), mask + 1, 0u);
    for (const FoundPoint<T>& point : row) ++places[point.id >> shift & mask];
    std::uint32_t sum = 0;
    for (std::uint32_t digit = 0; digit <= mask; ++digit) {
        const std::uint32_t count = places[digit];
        places[digit] = sum;
        sum += count;
    }
    sorted.resize(row.size());
    for (const FoundPoint<T>& point : row) sorted[places[point.id >> shift & mask]++] = point;
}

/// By id. Sorts digit by digit, of those bits alone in which ids differ: comparisons that nobody
/// can foresee made this most of the time of long rows. `spare` is lost.
template <class T>
void sort_by_id(BudgetVector<FoundPoint<T>>& row, BudgetVector<FoundPoint<T>>& spare) {
    if (row.empty()) return;
    std::uint32_t differing = 0;
    for (const FoundPoint<T>& point : row) differing |= point.id ^ row.front().id;
    if (differing == 0) return;
    const int low = std::countr_zero(differing), width = std::bit_width(differing) - low;
    const int most_bits = row.size() < 2048 ? 8 : 11;  // counters should be fewer than points
    const int passes = (width + most_bits - 1) / most_bits, bits = (width + passes - 1) / passes;
    for (int shift = low; shift < low + width; shift += bits) {
        sort_by_digit(row, shift, std::min(bits, 32 - shift), spare);
        std::swap(row, spare);
    }
}

/// Rows of points one after the other, as long as they come. Its memory is charged to a budget.
template <class T>
class RowChunk {
public:
    explicit RowChunk(ResultBudget* budget = nullptr) : budget_(budget) {}
    RowChunk(RowChunk&& other) noexcept
        : ids(std::move(other.ids)),
          distances(std::move(other.distances)),
          size(std::exchange(other.size, 0)),
          budget_(other.budget_),
          charged_(std::exchange(other.charged_, 0)) {}
    RowChunk& operator=(RowChunk&&) = delete;
    ~RowChunk() { clear(); }

    void clear() noexcept {
        ids = {};
        distances = {};
        size = 0;
        if (budget_ != nullptr) budget_->give_back(charged_);
        charged_ = 0;
    }
    /// Room for `more` beyond size. Throws ResultTooLarge.
    void reserve(std::size_t more) {
        if (size + more > ids.size()) grow(2 * ids.size() + more);
    }

    Buffer<std::uint32_t> ids;
    Buffer<T> distances;
    std::size_t size = 0;

private:
    void grow(std::size_t room) {
        const std::uint64_t bytes = room * (sizeof(std::uint32_t) + sizeof(T)), old = charged_;
        if (budget_ != nullptr) budget_->take(bytes);
        charged_ += bytes;
        Buffer<std::uint32_t> longer_ids(room);
        Buffer<T> longer_distances(room);
        std::copy_n(ids.data(), size, longer_ids.data());
        std::copy_n(distances.data(), size, longer_distances.data());
        ids = std::move(longer_ids);
        distances = std::move(longer_distances);
        if (budget_ != nullptr) budget_->give_back(old);
        charged_ -= old;
    }

    ResultBudget* budget_;
    std::uint64_t charged_ = 0;
};

}  // namespace raydix
