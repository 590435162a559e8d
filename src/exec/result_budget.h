// What a call holds whose result can have any length, in bytes, over all its threads, against the
// limit max_result_bytes. Memory is charged before it is allocated, by capacity, and given back
// when it is freed; the call that asks for too much throws ResultTooLarge.
#pragma once

#include <raydix/error.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <type_traits>
#include <vector>

#include "exec/result_memory.h"

namespace raydix {

class ResultBudget {
public:
    /// `limit` 0: half of what is left to the process, asked for when the call has become large.
    ResultBudget(const char* what, std::uint64_t limit);
    /// A share of `outer` for parts that are kept only if there is room. All it takes counts
    /// `weight` times in `outer`; what it refuses does not stop `outer`.
    ResultBudget(ResultBudget& outer, unsigned weight);
    ResultBudget(const ResultBudget&) = delete;
    ResultBudget& operator=(const ResultBudget&) = delete;

    /// Throws ResultTooLarge if `bytes` more are too many, or if that was so once on any thread.
    void take(std::uint64_t bytes) {
        go_on();
        if (!try_take(bytes)) refuse();
    }
    /// False, and nothing taken, if they are too many.
    [[nodiscard]] bool try_take(std::uint64_t bytes);
    /// As take(), where these bytes are all that the call still needs: the error names the sum.
    void take_last(std::uint64_t bytes);
    /// Throws if the call is known to hold `bytes` or more in the end and they are too many.
    void expect(std::uint64_t bytes);
    void give_back(std::uint64_t bytes) noexcept;
    /// From here on what a share holds counts once in the outer budget. On one thread.
    void count_once() noexcept;

    /// Throws if take() has refused: other threads need not go on.
    void go_on() const {
        if (refused_.load(std::memory_order_relaxed)) refuse();
    }
    [[nodiscard]] std::uint64_t held() const { return held_.load(std::memory_order_relaxed); }

private:
    [[noreturn]] void refuse() const;
    /// The limit, once it is asked for.
    std::uint64_t limit();

    const char* what_;
    ResultBudget* outer_ = nullptr;
    unsigned weight_ = 1;
    mutable std::atomic<bool> refused_{false};
    std::once_flag asked_;
    bool is_given_ = true;
    std::atomic<std::uint64_t> limit_;
    std::atomic<std::uint64_t> held_{0};
};

/// Charges a budget with all that a container allocates; without one it is std::allocator.
template <class T>
class BudgetAllocator {
public:
    using value_type = T;
    using propagate_on_container_move_assignment = std::true_type;
    using propagate_on_container_swap = std::true_type;

    BudgetAllocator() = default;
    explicit BudgetAllocator(ResultBudget* budget) : budget_(budget) {}
    template <class U>
    explicit BudgetAllocator(const BudgetAllocator<U>& other) : budget_(other.budget()) {}

    [[nodiscard]] T* allocate(std::size_t n) {
        if (budget_ == nullptr) return std::allocator<T>().allocate(n);
        budget_->take(n * sizeof(T));
        try {
            return std::allocator<T>().allocate(n);
        } catch (...) {
            budget_->give_back(n * sizeof(T));
            throw;
        }
    }
    void deallocate(T* memory, std::size_t n) noexcept {
        std::allocator<T>().deallocate(memory, n);
        if (budget_ != nullptr) budget_->give_back(n * sizeof(T));
    }
    [[nodiscard]] ResultBudget* budget() const { return budget_; }

    template <class U>
    friend bool operator==(const BudgetAllocator& a, const BudgetAllocator<U>& b) {
        return a.budget() == b.budget();
    }

private:
    ResultBudget* budget_ = nullptr;
};

/// A vector whose memory is charged.
template <class T>
using BudgetVector = std::vector<T, BudgetAllocator<T>>;

/// n empty ones.
template <class T>
[[nodiscard]] BudgetVector<BudgetVector<T>> budget_lists(std::size_t n, ResultBudget& budget) {
    return BudgetVector<BudgetVector<T>>(n, BudgetVector<T>(BudgetAllocator<T>(&budget)),
                                         BudgetAllocator<BudgetVector<T>>(&budget));
}

/// Gives the room behind the last element back if it is worth a copy.
template <class T>
void pack(BudgetVector<T>& list) {
    if (list.capacity() - list.size() > list.size() / 8)
        list = BudgetVector<T>(list.begin(), list.end(), list.get_allocator());
}

}  // namespace raydix
