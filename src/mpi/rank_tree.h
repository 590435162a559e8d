// What every rank knows of all: some boxes around what each one holds, and a tree over them. Asked
// for the ranks that a query can reach, it gives each with a lower bound: of the squared distance,
// or of where a ray enters.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

#include "mpi/communicator.h"

namespace raydix::mpi {

/// A closed box; empty if lo > hi.
template <class T>
struct RankBox {
    T lo[3], hi[3];

    [[nodiscard]] static RankBox empty() {
        constexpr T inf = std::numeric_limits<T>::infinity();
        return {{inf, inf, inf}, {-inf, -inf, -inf}};
    }
    void unite(const RankBox& other) {
        for (int d = 0; d < 3; ++d) {
            lo[d] = std::min(lo[d], other.lo[d]);
            hi[d] = std::max(hi[d], other.hi[d]);
        }
    }
    [[nodiscard]] T extent(int d) const { return hi[d] - lo[d]; }
    [[nodiscard]] int longest_axis() const {
        int axis = 0;
        for (int d = 1; d < 3; ++d)
            if (extent(d) > extent(axis)) axis = d;
        return axis;
    }
};

/// A rank that a query reaches. They are taken in the order of (bound, rank).
template <class T>
struct Candidate {
    T bound;
    std::uint32_t rank;

    friend bool operator<(const Candidate& a, const Candidate& b) {
        return a.bound < b.bound || (a.bound == b.bound && a.rank < b.rank);
    }
};

template <class T>
class RankTree {
public:
    RankTree() = default;
    /// Collective: every rank gives its boxes. Ranks may have none.
    RankTree(const Communicator& comm, const std::vector<RankBox<T>>& mine) {
        std::vector<Leaf> leaves;
        for (const RankBox<T>& box : mine)
            leaves.push_back({box, static_cast<std::uint32_t>(comm.rank())});
        leaves = comm.gather(leaves);
        bounds_ = RankBox<T>::empty();
        for (const Leaf& leaf : leaves) bounds_.unite(leaf.box);
        if (!leaves.empty()) add_node(leaves, 0, leaves.size());
    }

    [[nodiscard]] const RankBox<T>& bounds() const { return bounds_; }
    [[nodiscard]] std::uint64_t bytes() const { return nodes_.size() * sizeof(Node); }

    /// The first candidate with a bound of at most `most`. False if there is none. bound_of(box)
    /// gives NaN for a box that is not reached; that of a box is at most that of a box within.
    template <class BoundOf>
    [[nodiscard]] bool first(T most, const BoundOf& bound_of, Candidate<T>& found) const {
        bool any = false;
        walk(most, bound_of, [&](const Candidate<T>& candidate) {
            if (!any || candidate < found) found = candidate;
            any = true;
            return found.bound;
        });
        return any;
    }

    /// All candidates with a bound of at most `most`, each rank once, in order.
    template <class BoundOf>
    void all(T most, const BoundOf& bound_of, std::vector<Candidate<T>>& found) const {
        found.clear();
        walk(most, bound_of, [&](const Candidate<T>& candidate) {
            found.push_back(candidate);
            return most;
        });
        // Of a rank's boxes the nearest counts.
        std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) {
            return a.rank < b.rank || (a.rank == b.rank && a.bound < b.bound);
        });
        found.erase(std::unique(found.begin(), found.end(),
                                [](const auto& a, const auto& b) { return a.rank == b.rank; }),
                    found.end());
        std::sort(found.begin(), found.end());
    }

private:
    struct Leaf {
        RankBox<T> box;
        std::uint32_t rank;
    };
    /// Children side by side, so that a loop over them becomes vector instructions.
    static constexpr std::size_t width = 8;
    struct Node {
        T lo[3][width], hi[3][width];
        std::uint32_t below[width];  // a node; or a rank and leaf_bit
        std::uint32_t count;
    };
    static constexpr std::uint32_t leaf_bit = std::uint32_t{1} << 31;
    /// Paths are shorter than 12 nodes: children are full but for the last few.
    static constexpr std::size_t most_pending = 12 * width;
    struct Range {
        std::size_t begin, end;
    };

    /// Of the leaves [begin, end), and all below it. Returns its index.
    std::uint32_t add_node(std::vector<Leaf>& leaves, std::size_t begin, std::size_t end) {
        // Children as large as full trees of their depth, and no more of them than that takes.
        std::size_t most_below = 1;
        while (most_below * width < end - begin) most_below *= width;
        std::vector<Range> parts;
        divide(leaves, {begin, end}, (end - begin + most_below - 1) / most_below, parts);
        const auto index = static_cast<std::uint32_t>(nodes_.size());
        nodes_.emplace_back();  // boxes of zeros where there is no child
        nodes_[index].count = static_cast<std::uint32_t>(parts.size());
        for (std::size_t c = 0; c < parts.size(); ++c) {
            const RankBox<T> box = box_of(leaves, parts[c]);
            for (int d = 0; d < 3; ++d) {
                nodes_[index].lo[d][c] = box.lo[d];
                nodes_[index].hi[d][c] = box.hi[d];
            }
            const auto [first, last] = parts[c];
            const std::uint32_t below =
                last - first == 1 ? leaves[first].rank | leaf_bit : add_node(leaves, first, last);
            nodes_[index].below[c] = below;
        }
        return index;
    }
    static RankBox<T> box_of(const std::vector<Leaf>& leaves, const Range& range) {
        RankBox<T> box = RankBox<T>::empty();
        for (std::size_t i = range.begin; i < range.end; ++i) box.unite(leaves[i].box);
        return box;
    }
    /// Into `count` parts of about equal size, across the longest axes.
    static void divide(std::vector<Leaf>& leaves, const Range& range, std::size_t count,
                       std::vector<Range>& parts) {
        if (count == 1) {
            parts.push_back(range);
            return;
        }
        const std::size_t low = count / 2,
                          middle = range.begin + (range.end - range.begin) * low / count;
        const int axis = box_of(leaves, range).longest_axis();
        const auto at = [&](std::size_t i) {
            return leaves.begin() + static_cast<std::ptrdiff_t>(i);
        };
        std::nth_element(
            at(range.begin), at(middle), at(range.end), [axis](const Leaf& a, const Leaf& b) {
                const T x = a.box.lo[axis] + a.box.hi[axis], y = b.box.lo[axis] + b.box.hi[axis];
                return x < y || (x == y && a.rank < b.rank);
            });
        divide(leaves, {range.begin, middle}, low, parts);
        divide(leaves, {middle, range.end}, count - low, parts);
    }

    /// Nearer nodes first. visit(candidate) gives the bound that still counts.
    template <class BoundOf, class Visit>
    void walk(T most, const BoundOf& bound_of, const Visit& visit) const {
        if (nodes_.empty()) return;
        struct Pending {
            std::uint32_t node;
            T bound;
        } stack[most_pending];
        Pending* top = stack;
        *top++ = {0, -std::numeric_limits<T>::infinity()};
        while (top != stack) {
            const Pending next = *--top;
            if (!(next.bound <= most)) continue;
            const Node& node = nodes_[next.node];
            T bounds[width];
            for (std::size_t c = 0; c < width; ++c)
                bounds[c] = bound_of(RankBox<T>{{node.lo[0][c], node.lo[1][c], node.lo[2][c]},
                                                {node.hi[0][c], node.hi[1][c], node.hi[2][c]}});
            Pending* const others = top;
            for (std::size_t c = 0; c < node.count; ++c) {
                if (!(bounds[c] <= most)) continue;
                if ((node.below[c] & leaf_bit) != 0) {
                    most = visit(Candidate<T>{bounds[c], node.below[c] & ~leaf_bit});
                    continue;
                }
                Pending* place = top++;
                for (; place != others && place[-1].bound < bounds[c]; --place) *place = place[-1];
                *place = {node.below[c], bounds[c]};
            }
        }
    }

    std::vector<Node> nodes_;
    RankBox<T> bounds_ = RankBox<T>::empty();
};

/// A lower bound of d2 from a point to all points in a box: every difference is no more than that
/// of a point after rounding, and squares and sums are monotone (contract.md 8).
template <class T>
[[nodiscard]] T least_d2(const T* query, const RankBox<T>& box) {
    T off[3];
    for (int d = 0; d < 3; ++d)
        off[d] = std::max(std::max(box.lo[d] - query[d], query[d] - box.hi[d]), T(0));
    return (off[0] * off[0] + off[1] * off[1]) + off[2] * off[2];
}

}  // namespace raydix::mpi
