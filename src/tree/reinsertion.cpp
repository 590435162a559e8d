#include "tree/reinsertion.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>

#include "exec/parallel.h"
#include "exec/progress.h"
#include "exec/scan.h"
#include "tree/top_tree.h"

namespace raydix {

std::size_t ReinsertionScratch::capacity_bytes() const {
    return parents.capacity_bytes() + claims.capacity_bytes() + waiting.capacity_bytes() +
           candidates.capacity_bytes() + block_sums.capacity_bytes() + found.capacity_bytes();
}

namespace {

/// Slots of the passes over all nodes.
constexpr std::size_t block_slots = 1u << 14;
/// Candidates that a thread searches places for at a time.
constexpr std::size_t search_grain = 64;
constexpr std::size_t move_grain = 1024;

class ReinsertionRun {
public:
    ReinsertionRun(std::span<BvhNode> nodes, const ReinsertionOptions& options,
                   ReinsertionScratch& scratch)
        : options_(options),
          s_(scratch),
          slots_(static_cast<std::uint32_t>(nodes.size())),
          tree_{nodes.data(), nullptr} {}

    ReinsertionResult run() {
        ReinsertionResult result;
        // Below four leaves there is one way to put two of them under a node, or none.
        if (slots_ < 6) return result;
        link();
        double area = measure();
        for (int round = 0; round < options_.rounds; ++round) {
            const ProgressStage stage(round / static_cast<double>(options_.rounds),
                                      (round + 1) / static_cast<double>(options_.rounds));
            search(pick_candidates());
            const std::span<Insertion> moves = resolve_conflicts();
            if (moves.empty()) break;
            apply(moves);
            const double after = measure();
            if (after > area) {
                // Moves that each gain may lose together; this is rare, and was for nothing.
                undo(moves);
                break;
            }
            ++result.rounds;
            result.moves += moves.size();
            if (area - after < options_.least_gain * area) break;
            area = after;
        }
        return result;
    }

private:
    [[nodiscard]] std::uint32_t pairs() const { return slots_ / 2; }
    [[nodiscard]] float area(std::size_t slot) const {
        return cluster_area(tree_.box(static_cast<std::uint32_t>(slot)));
    }

    void link() {
        s_.parents.reset(pairs());
        s_.waiting.reset(pairs());
        s_.claims.reset(slots_);
        tree_.parents = s_.parents.data();
        for_each_range(slots_, block_slots, [&](std::size_t begin, std::size_t end) {
            for (std::size_t slot = begin; slot < end; ++slot) {
                s_.claims[slot] = 0;
                if (slot % 2 == 0) s_.waiting[slot / 2] = 0;
                if (slot != 1) tree_.adopt(static_cast<std::uint32_t>(slot));
            }
        });
    }

    /// The summed area of inner nodes; areas of all nodes but the root by bins.
    double measure() {
        std::vector<std::uint32_t>& bins = s_.area_bins;
        bins.assign(AreaBins::count, 0);
        if (slots_ <= block_slots) return measure(0, slots_, bins.data());
        std::vector<double> sums((slots_ + block_slots - 1) / block_slots);
        for_each_block(slots_, block_slots,
                       [&](std::size_t block, std::size_t begin, std::size_t end) {
                           std::array<std::uint32_t, AreaBins::count> own{};
                           sums[block] = measure(begin, end, own.data());
                           for (std::size_t bin = 0; bin < AreaBins::count; ++bin)
                               if (own[bin] != 0) std::atomic_ref(bins[bin]).fetch_add(own[bin]);
                       });
        double total = 0;
        for (const double sum : sums) total += sum;
        return total;
    }
    /// Of the slots begin to end - 1.
    double measure(std::size_t begin, std::size_t end, std::uint32_t* bins) const {
        double sum = 0;
        for (std::size_t slot = begin; slot < end; ++slot) {
            if (slot == 1) continue;
            if (slot != 0) ++bins[AreaBins::of(area(slot))];
            const BvhNode& node = tree_.nodes[slot];
            if (!node.is_leaf()) sum += half_area({node.lo, node.hi});
        }
        return sum;
    }

    /// Slots of the largest areas, ascending: a whole number of bins, without nodes that have none.
    std::span<const std::uint32_t> pick_candidates() {
        const auto wanted = static_cast<std::uint32_t>(options_.part * slots_) + 1;
        std::size_t least_bin = AreaBins::of(area(0)) + 1;  // no node is larger than the root
        std::uint32_t picked = 0;
        while (least_bin > 1 && picked < wanted) picked += s_.area_bins[--least_bin];
        const auto is_picked = [&](std::size_t slot) {
            return AreaBins::of(area(slot)) >= least_bin;
        };
        s_.candidates.reset(picked);
        s_.block_sums.reset((slots_ + block_slots - 1) / block_slots);
        for_each_block(
            slots_, block_slots, [&](std::size_t block, std::size_t begin, std::size_t end) {
                std::uint32_t count = 0;
                for (std::size_t slot = std::max(begin, std::size_t{2}); slot < end; ++slot)
                    count += is_picked(slot) ? 1 : 0;
                s_.block_sums[block] = count;
            });
        exclusive_scan(s_.block_sums.span());
        for_each_block(
            slots_, block_slots, [&](std::size_t block, std::size_t begin, std::size_t end) {
                std::uint32_t* out = s_.candidates.data() + s_.block_sums[block];
                for (std::size_t slot = std::max(begin, std::size_t{2}); slot < end; ++slot)
                    if (is_picked(slot)) *out++ = static_cast<std::uint32_t>(slot);
            });
        return s_.candidates.view();
    }

    void search(std::span<const std::uint32_t> candidates) {
        s_.found.reset(candidates.size());
        const ProgressCounter progress(static_cast<double>(candidates.size()), 0, 0.8);
        for_each_range(candidates.size(), search_grain, [&](std::size_t begin, std::size_t end) {
            InsertionSearch search(tree_, options_.most_visits);
            for (std::size_t i = begin; i < end; ++i) {
                s_.found[i] = search.find(candidates[i]);
                if (i % search_grain == 0) progress.add(search_grain);
            }
        });
    }

    /// Slots whose nodes a move exchanges: of its pair, of the node over it, of its new place.
    [[nodiscard]] std::array<std::uint32_t, 4> slots_of(const Insertion& move) const {
        return {move.from, move.from ^ 1, tree_.parent(move.from), move.to};
    }
    /// By gain, of equals by slot. Gains are above 0, so their bits ascend.
    static std::uint64_t rank_of(const Insertion& move) {
        return std::uint64_t{std::bit_cast<std::uint32_t>(move.gain)} << 32 | ~move.from;
    }

    template <class Body>
    void for_each_move(std::span<const Insertion> moves, const Body& body) {
        for_each_index(
            moves.size(), [&](std::size_t i) { body(moves[i]); }, move_grain);
    }

    /// Moves that have the best gain of all that want one of their slots, and that close no cycle.
    /// They stand first in s_.found afterwards.
    std::span<Insertion> resolve_conflicts() {
        const auto end =
            std::remove_if(s_.found.data(), s_.found.data() + s_.found.size(),
                           [](const Insertion& move) { return move.to == Insertion::nowhere; });
        const std::span<Insertion> wishes(s_.found.data(), end);
        for_each_move(wishes, [&](const Insertion& move) {
            const std::uint64_t rank = rank_of(move);
            for (const std::uint32_t slot : slots_of(move)) {
                std::atomic_ref claim(s_.claims[slot]);
                std::uint64_t held = claim.load(std::memory_order_relaxed);
                while (held < rank && !claim.compare_exchange_weak(held, rank)) {
                }
            }
        });
        s_.candidates.reset(wishes.size());  // from here on: whether the wish is granted
        for_each_index(
            wishes.size(), [&](std::size_t i) { s_.candidates[i] = is_granted(wishes[i]) ? 1 : 0; },
            move_grain);
        for_each_move(wishes, [&](const Insertion& move) {
            for (const std::uint32_t slot : slots_of(move))
                std::atomic_ref(s_.claims[slot]).store(0, std::memory_order_relaxed);
        });
        std::size_t granted = 0;
        for (std::size_t i = 0; i < wishes.size(); ++i)
            if (s_.candidates[i] != 0) wishes[granted++] = wishes[i];
        return wishes.first(granted);
    }

    [[nodiscard]] bool holds_all(const Insertion& move) const {
        const std::uint64_t rank = rank_of(move);
        for (const std::uint32_t slot : slots_of(move))
            if (s_.claims[slot] != rank) return false;
        return true;
    }
    /// Two nodes that each go below the other would leave the tree. In any such circle there is a
    /// move whose way down leads through a node that may move with a better gain: it stays.
    [[nodiscard]] bool is_granted(const Insertion& move) const {
        if (!holds_all(move)) return false;
        if (move.top == 0) return true;
        const std::uint64_t rank = rank_of(move);
        for (std::uint32_t slot = move.to;; slot = tree_.parent(slot)) {
            const std::uint64_t claim = s_.claims[slot];
            if (claim > rank && static_cast<std::uint32_t>(~claim) == slot) return false;
            if (slot == move.top) return true;
        }
    }

    /// No two of the moves have a slot or a pair in common.
    void apply(std::span<Insertion> moves) {
        for_each_index(
            moves.size(), [&](std::size_t i) { tree_.insert(moves[i]); }, move_grain);
        refit(moves);
    }
    void undo(std::span<const Insertion> moves) {
        for_each_move(moves, [&](const Insertion& move) { tree_.take_back(move); });
        refit(moves);
    }

    static constexpr std::uint32_t marked = 1u << 31, taken = 1u << 30;

    /// Boxes of all nodes above the pairs and places of the moves, and of no others.
    void refit(std::span<const Insertion> moves) {
        for_each_move(moves, [&](const Insertion& move) {
            mark_upwards(move.from / 2);
            for (const std::uint32_t slot : {move.to, move.top})
                if (slot != 0) mark_upwards(slot / 2);
        });
        s_.candidates.reset(3 * moves.size());  // from here on: pairs to begin with
        std::uint32_t starts = 0;
        const auto start_at = [&](std::uint32_t pair) {
            std::atomic_ref state(s_.waiting[pair]);
            if (state.load(std::memory_order_relaxed) != marked) return;
            if (state.fetch_or(taken) != marked) return;
            s_.candidates[std::atomic_ref(starts).fetch_add(1)] = pair;
        };
        for_each_move(moves, [&](const Insertion& move) {
            start_at(move.from / 2);
            for (const std::uint32_t slot : {move.to, move.top})
                if (slot != 0) start_at(slot / 2);
        });
        for_each_index(
            starts, [&](std::size_t i) { fit_upwards(s_.candidates[i]); }, 256);
    }
    void mark_upwards(std::uint32_t pair) {
        while ((std::atomic_ref(s_.waiting[pair]).fetch_or(marked) & marked) == 0) {
            const std::uint32_t slot = tree_.parents[pair];
            if (slot == 0) return;
            pair = slot / 2;
            std::atomic_ref(s_.waiting[pair]).fetch_add(1);
        }
    }
    void fit_upwards(std::uint32_t pair) {
        for (;;) {
            s_.waiting[pair] = 0;
            const std::uint32_t slot = tree_.parents[pair];
            const Aabb box = unite(tree_.box(2 * pair), tree_.box(2 * pair + 1));
            tree_.nodes[slot].lo = box.lo;
            tree_.nodes[slot].hi = box.hi;
            if (slot == 0) return;
            pair = slot / 2;
            // The last child to come goes on, and sees the boxes of the others.
            const std::uint32_t before = std::atomic_ref(s_.waiting[pair]).fetch_sub(1);
            if ((before & ~(marked | taken)) != 1) return;
        }
    }

    const ReinsertionOptions& options_;
    ReinsertionScratch& s_;
    std::uint32_t slots_;
    LinkedTree tree_;
};

}  // namespace

ReinsertionResult reinsert_nodes(std::span<BvhNode> nodes, const ReinsertionOptions& options,
                                 ReinsertionScratch& scratch) {
    return ReinsertionRun(nodes, options, scratch).run();
}

}  // namespace raydix
