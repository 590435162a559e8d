#include "exec/result_budget.h"

#include <raydix/result_limit.h>

#include <algorithm>

namespace raydix {
namespace {

/// A call that holds less does not ask the system, which takes longer than a small call.
constexpr std::uint64_t never_asked = std::uint64_t{4} << 20;

}  // namespace

ResultBudget::ResultBudget(const char* what, std::uint64_t limit)
    : what_(what), is_given_(limit != 0), limit_(limit != 0 ? limit : never_asked) {}

ResultBudget::ResultBudget(ResultBudget& outer, unsigned weight)
    : what_(outer.what_), outer_(&outer), weight_(weight), limit_(unknown_memory) {}

std::uint64_t ResultBudget::limit() {
    if (!is_given_)
        std::call_once(asked_, [&] { limit_.store(std::max(usual_result_bytes(), never_asked)); });
    return limit_.load();
}

bool ResultBudget::try_take(std::uint64_t bytes) {
    if (bytes > limit_.load(std::memory_order_relaxed) && bytes > limit()) return false;
    const std::uint64_t now = held_.fetch_add(bytes, std::memory_order_relaxed) + bytes;
    const bool fits = now <= limit_.load(std::memory_order_relaxed) || now <= limit();
    if (fits && (outer_ == nullptr || outer_->try_take(saturating_product(bytes, weight_))))
        return true;
    held_.fetch_sub(bytes, std::memory_order_relaxed);
    return false;
}

void ResultBudget::take_last(std::uint64_t bytes) {
    if (try_take(bytes)) return;
    const std::uint64_t others = held(), room = unknown_memory - others;
    throw ResultTooLarge(what_, bytes > room ? unknown_memory : others + bytes, true, limit());
}

void ResultBudget::expect(std::uint64_t bytes) {
    go_on();
    if (bytes > limit_.load(std::memory_order_relaxed) && bytes > limit()) refuse();
}

void ResultBudget::give_back(std::uint64_t bytes) noexcept {
    held_.fetch_sub(bytes, std::memory_order_relaxed);
    if (outer_ != nullptr) outer_->give_back(bytes * weight_);
}

void ResultBudget::count_once() noexcept {
    if (outer_ != nullptr) outer_->give_back(held() * (weight_ - 1));
    weight_ = 1;
}

void ResultBudget::refuse() const {
    refused_.store(true, std::memory_order_relaxed);
    const std::uint64_t limit = outer_ != nullptr ? outer_->limit_.load() : limit_.load();
    throw ResultTooLarge(what_, limit, false, limit);
}

std::uint64_t usual_result_bytes() { return available_memory() / 2; }

void require_result_bytes(const char* what, std::uint64_t bytes, std::uint64_t max_result_bytes) {
    ResultBudget(what, max_result_bytes).take_last(bytes);
}

}  // namespace raydix
