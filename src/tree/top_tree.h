// The top of a tree as a small tree of its own, whose leaves stand for all that is below them: the
// nodes of the largest areas, since no node is larger than the one above it. What works on the top
// alone need not touch the rest, and what it touches stays in a core's own cache.
#pragma once

#include <raydix/bvh.h>

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
        for (std::size_t bin = AreaBins::count; bin-- > 0;)
            while (!waiting_[bin].empty()) {
                if (top_.inner.size() == most_inner) return;
                const std::uint32_t slot = waiting_[bin].back();
                waiting_[bin].pop_back();
                open(slot);
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
        waiting_[AreaBins::of(cluster_area(box))].push_back(slot);
    }

    const View& view_;
    TopTree& top_;
    std::vector<std::vector<std::uint32_t>> waiting_{AreaBins::count};
};

}  // namespace raydix
