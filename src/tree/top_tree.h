// The top of a tree as a small tree of its own, whose leaves stand for all that is below them: the
// nodes of the largest areas, since no node is larger than the one above it. What works on the top
// alone need not touch the rest, and what it touches stays in a core's own cache.
#pragma once

#include <raydix/bvh.h>

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "tree/cluster.h"

namespace raydix {

/// Areas by the upper bits of their floats, which ascend as areas do: 16 bins for a factor of two.
struct AreaBins {
    static constexpr int shift = 19;
    static constexpr std::size_t count = std::size_t{1} << (31 - shift);

    /// Of what is not a number: the last one.
    static std::size_t of(float area) {
        const std::size_t bin = std::bit_cast<std::uint32_t>(area) >> shift;
        return bin < count ? bin : count - 1;
    }
};

struct TopTree {
    /// [2 * inner + 2], slots as in a Bvh. Leaves have count 1, and `first` is the slot they were
    /// made in, wherever they stand now.
    std::vector<BvhNode> nodes;
    std::vector<std::uint32_t> refs;   // [2 * inner + 2], of the large tree, by the slot made in
    std::vector<std::uint32_t> inner;  // [inner], of the large tree: what the top's nodes were
    std::vector<std::uint32_t> next;   // [2 * inner + 2]: lists of slots, while the top is cut
};

/// `View`: root(), is_leaf(ref), box(ref), children(ref) and prefetch(ref) of a tree that is not
/// empty. One use only.
template <class View>
class TopCut {
public:
    TopCut(const View& view, TopTree& top) : view_(view), top_(top) {}

    /// The top gets up to `most_inner` inner nodes.
    void run(std::size_t most_inner) {
        top_.nodes.clear();
        top_.refs.clear();
        top_.inner.clear();
        put(view_.root());
        top_.nodes.push_back({{0, 0, 0}, 0, {0, 0, 0}, 0});
        top_.refs.push_back(0);
        while (waits()) {
            if (top_.inner.size() == most_inner) return;
            open(take_largest());
        }
    }

private:
    void open(std::uint32_t slot) {
        const auto ref = top_.refs[slot];
        top_.nodes[slot].first = static_cast<std::uint32_t>(top_.nodes.size());
        top_.nodes[slot].count = 0;
        top_.inner.push_back(ref);
        for (const auto child : view_.children(ref)) put(child);
    }
    /// A leaf, for the time being.
    void put(std::uint32_t ref) {
        const auto slot = static_cast<std::uint32_t>(top_.nodes.size());
        const Aabb box = view_.box(ref);
        top_.nodes.push_back({box.lo, slot, box.hi, 1});
        top_.refs.push_back(ref);
        if (view_.is_leaf(ref)) return;
        view_.prefetch(ref);
        wait(slot, AreaBins::of(cluster_area(box)));
    }

    // Of each bin a list, the last to come first. Small trees must not pay for bins that they do
    // not use.
    void wait(std::uint32_t slot, std::size_t bin) {
        std::uint64_t& used = used_[bin / 64];
        const std::uint64_t bit = std::uint64_t{1} << bin % 64;
        top_.next.resize(slot + std::size_t{1});
        top_.next[slot] = (used & bit) == 0 ? none : first_[bin];
        first_[bin] = slot;
        used |= bit;
    }
    /// Children are no larger than their parents, so bins empty from the last to the first.
    [[nodiscard]] bool waits() {
        while (used_[word_] == 0) {
            if (word_ == 0) return false;
            --word_;
        }
        return true;
    }
    [[nodiscard]] std::uint32_t take_largest() {
        const std::size_t bit = static_cast<std::size_t>(std::bit_width(used_[word_])) - 1;
        std::uint32_t& first = first_[64 * word_ + bit];
        const std::uint32_t slot = first;
        first = top_.next[slot];
        if (first == none) used_[word_] &= ~(std::uint64_t{1} << bit);
        return slot;
    }

    const View& view_;
    TopTree& top_;
    static constexpr std::uint32_t none = UINT32_MAX;
    static constexpr std::size_t words = AreaBins::count / 64;
    std::array<std::uint64_t, words> used_{};           // bits of the bins that hold a slot
    std::array<std::uint32_t, AreaBins::count> first_;  // of those
    std::size_t word_ = words - 1;
};

}  // namespace raydix
