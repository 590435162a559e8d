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
        if (!leaves.empty()) divide(leaves, 0, leaves.size());
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
    /// Of an inner node the left child is the next node, and `right` the other; of a leaf, 0.
    struct Node {
        RankBox<T> box;
        std::uint32_t right, rank;
    };
    /// Halving keeps every path shorter than this.
    static constexpr int most_depth = 40;

    void divide(std::vector<Leaf>& leaves, std::size_t begin, std::size_t end) {
        RankBox<T> box = RankBox<T>::empty();
        for (std::size_t i = begin; i < end; ++i) box.unite(leaves[i].box);
        const std::size_t node = nodes_.size();
        nodes_.push_back({box, 0, leaves[begin].rank});
        if (end - begin == 1) return;
        const std::size_t middle = begin + (end - begin) / 2;
        const int axis = box.longest_axis();
        const auto at = [&](std::size_t i) {
            return leaves.begin() + static_cast<std::ptrdiff_t>(i);
        };
        std::nth_element(at(begin), at(middle), at(end), [axis](const Leaf& a, const Leaf& b) {
            const T x = a.box.lo[axis] + a.box.hi[axis], y = b.box.lo[axis] + b.box.hi[axis];
            return x < y || (x == y && a.rank < b.rank);
        });
        divide(leaves, begin, middle);
        nodes_[node].right = static_cast<std::uint32_t>(nodes_.size());
        divide(leaves, middle, end);
    }

    /// Nearer children first. visit(candidate) gives the bound that still counts.
    template <class BoundOf, class Visit>
    void walk(T most, const BoundOf& bound_of, const Visit& visit) const {
        if (nodes_.empty()) return;
        struct Pending {
            std::uint32_t node;
            T bound;
        } stack[most_depth];
        Pending* top = stack;
        const T root = bound_of(nodes_[0].box);
        if (!(root <= most)) return;
        *top++ = {0, root};
        while (top != stack) {
            const Pending next = *--top;
            if (!(next.bound <= most)) continue;
            const Node& node = nodes_[next.node];
            if (node.right == 0) {
                most = visit(Candidate<T>{next.bound, node.rank});
                continue;
            }
            Pending near{next.node + 1, bound_of(nodes_[next.node + 1].box)},
                far{node.right, bound_of(nodes_[node.right].box)};
            if (!(near.bound <= far.bound)) std::swap(near, far);
            if (far.bound <= most) *top++ = far;
            if (near.bound <= most) *top++ = near;
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
