// The nodes of an LBVH whose sorted primitives lie on several ranks, each rank those that begin in
// its run (radix_tree.h has the tree). A split s stands between positions s and s + 1; its node
// reaches on both sides to the nearest split with a shorter prefix. So all that a rank must know of
// the ranks behind it is where prefixes get shorter than all before: at most one place for each
// length of a prefix.
#pragma once

#include <raydix/types.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "base/math.h"
#include "mpi/communicator.h"
#include "tree/radix_tree.h"

namespace raydix::mpi {

struct SortedPrimitive {
    std::uint64_t code;
    std::uint32_t id;
    Aabb box;
};

/// Primitives from a split on, up to the next one with a shorter prefix.
struct Stretch {
    std::int32_t prefix;  // of the split before them
    std::uint32_t count;
    Aabb box;
};

/// A node whose first primitive lies on this rank.
struct SpreadNode {
    std::uint32_t count;  // primitives below it
    Aabb box;
};

/// Collective. The nodes of the whole tree, of all runs of sorted primitives, one after the other.
template <class Key>
class SpreadLbvh {
public:
    SpreadLbvh(const Communicator& comm, std::span<const SortedPrimitive> run,
               std::uint32_t max_leaf)
        : run_(run), max_leaf_(max_leaf) {
        first_ = comm.sum_before(run.size());
        exchange(comm);
    }

    /// This rank's nodes from the last to the first in preorder. Of the subtrees of up to max_leaf
    /// primitives that begin at one position there is the largest alone.
    [[nodiscard]] std::vector<SpreadNode> reversed_nodes() const {
        std::vector<SpreadNode> nodes;
        nodes.reserve(2 * run_.size() + behind_.size());
        std::vector<Stretch> open(behind_.rbegin(), behind_.rend());  // the next split is the last
        for (std::size_t i = run_.size(); i-- > 0;) {
            const std::int32_t before = prefix_before(i);
            SpreadNode node{1, run_[i].box};
            const std::size_t leaf = nodes.size();
            nodes.push_back(node);
            for (; !open.empty() && open.back().prefix > before; open.pop_back()) {
                node.count += open.back().count;
                node.box = unite(node.box, open.back().box);
                if (node.count <= max_leaf_)
                    nodes[leaf] = node;
                else
                    nodes.push_back(node);
            }
            open.push_back({before, node.count, node.box});
        }
        return nodes;
    }

    /// The id at a position of this run or a little behind it.
    [[nodiscard]] std::uint32_t id(std::size_t i) const {
        return i < run_.size() ? run_[i].id : ids_behind_[i - run_.size()];
    }

private:
    struct Head {
        std::uint64_t first, count, stretches, ids;
        std::uint64_t first_code, last_code;
    };

    [[nodiscard]] static std::int32_t prefix(std::uint64_t a, std::uint64_t b, std::uint64_t at) {
        return SortedKeys<Key>::prefix_of(static_cast<Key>(a), static_cast<Key>(b),
                                          static_cast<std::int64_t>(at),
                                          static_cast<std::int64_t>(at + 1));
    }
    /// Of the split before a position of this run; below all others at the very beginning.
    [[nodiscard]] std::int32_t prefix_before(std::size_t i) const {
        if (i > 0) return prefix(run_[i - 1].code, run_[i].code, first_ + i - 1);
        return has_before_ ? prefix(code_before_, run_[0].code, first_ - 1) : -1;
    }

    /// The first primitive, then those behind each split whose prefix is shorter than all before.
    [[nodiscard]] std::vector<Stretch> stretches_of_run() const {
        std::vector<Stretch> stretches;
        for (std::size_t i = 0; i < run_.size(); ++i) {
            const std::int32_t before = i == 0 ? 0 : prefix_before(i);
            add_stretch(stretches, {before, 1, run_[i].box}, i < 2);
        }
        return stretches;
    }
    /// One more behind the others; it begins a stretch of its own if it must or its prefix is
    /// shorter than all before.
    static void add_stretch(std::vector<Stretch>& stretches, const Stretch& one, bool begins) {
        if (begins || one.prefix < stretches.back().prefix) {
            stretches.push_back(one);
            return;
        }
        stretches.back().count += one.count;
        stretches.back().box = unite(stretches.back().box, one.box);
    }

    void exchange(const Communicator& comm) {
        const std::vector<Stretch> mine = stretches_of_run();
        std::vector<std::uint32_t> first_ids;
        for (std::size_t i = 0; i < std::min<std::size_t>(run_.size(), max_leaf_); ++i)
            first_ids.push_back(run_[i].id);
        Head head{first_, run_.size(), mine.size(), first_ids.size(), 0, 0};
        if (!run_.empty()) {
            head.first_code = run_.front().code;
            head.last_code = run_.back().code;
        }
        const std::vector<Head> heads = comm.gather(std::vector<Head>{head});
        const std::vector<Stretch> stretches = comm.gather(mine);
        const std::vector<std::uint32_t> ids = comm.gather(first_ids);
        std::size_t stretch = 0, id = 0;
        std::uint64_t last_code = run_.empty() ? 0 : run_.back().code;
        for (std::size_t r = 0; r < heads.size(); ++r) {
            const Head& other = heads[r];
            const bool is_behind = r > std::size_t(comm.rank());
            if (r < std::size_t(comm.rank()) && other.count != 0) {
                has_before_ = true;
                code_before_ = other.last_code;
            }
            for (std::uint64_t k = 0; k < other.stretches; ++k, ++stretch) {
                if (!is_behind || run_.empty()) continue;
                Stretch one = stretches[stretch];
                if (k == 0) one.prefix = prefix(last_code, other.first_code, other.first - 1);
                add_stretch(behind_, one, behind_.empty());
            }
            for (std::uint64_t k = 0; k < other.ids; ++k, ++id)
                if (is_behind) ids_behind_.push_back(ids[id]);
            if (is_behind && other.count != 0) last_code = other.last_code;
        }
    }

    std::span<const SortedPrimitive> run_;
    std::uint32_t max_leaf_;
    std::uint64_t first_ = 0;  // position of the run in the whole
    bool has_before_ = false;
    std::uint64_t code_before_ = 0;
    std::vector<Stretch> behind_;  // of the ranks behind this one, prefixes falling
    std::vector<std::uint32_t> ids_behind_;
};

}  // namespace raydix::mpi
