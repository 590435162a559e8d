// Which nodes of a binary tree become children of which wide node: the least cost that the surface
// area heuristic can give (Ylitie, Karras, Laine 2017, section 3.1), by dynamic programming from
// the leaves up. A subtree of a binary tree -> its entries, with a plan for each.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "base/math.h"
#include "layout/binary_view.h"
#include "layout/search_odds.h"
#include "layout/subtree_shares.h"
#include "layout/wide_collapse.h"

namespace raydix {

/// A node of the subtree. Pairs of children are neighbours and come after their parents.
template <class Ref>
struct CollapseEntry {
    Aabb box;
    Ref ref;
    std::uint32_t children;  // the first one; none of a leaf
    PrimitiveRun run;
    float hits;  // as SearchOdds has it; areas are parts of the tree's

    static constexpr std::uint32_t none = ~std::uint32_t{0};
    [[nodiscard]] bool is_leaf() const { return children == none; }
};

/// What is best for the subtree of an entry.
template <int width>
struct CollapsePlan {
    std::array<float, width - 1> cost;  // [i - 1]: as at most i wide subtrees; areas are parts of
                                        // the tree's
    std::uint32_t choices;              // four bits per i: see choice()

    /// i = 1: 1 for a leaf, 0 for a wide node. i > 1: so many of the i subtrees go to the left
    /// child; 0: as for i - 1.
    [[nodiscard]] int choice(int i) const {
        return static_cast<int>(choices >> (4 * (i - 1)) & 15u);
    }
    void choose(int i, int what) { choices |= static_cast<std::uint32_t>(what) << (4 * (i - 1)); }
    [[nodiscard]] bool is_leaf() const { return choice(1) == 1; }
};

/// The plan of a node whose children's plans can be shared as `shared` says. node_cost, leaf_cost:
/// of the node as a wide node and as a leaf; infinity if it cannot be one.
template <int width>
[[gnu::always_inline]] inline void make_plan(const SubtreeShares<width>& shared, float node_cost,
                                             float leaf_cost, CollapsePlan<width>& out) {
    const auto left = [&](std::size_t i) { return shared.left[i - 1]; };
    out.choices = 0;
    out.choose(width, left(width));
    out.cost[0] = shared.cost[width - 1] + node_cost;
    if (leaf_cost <= out.cost[0]) {
        out.cost[0] = leaf_cost;
        out.choose(1, 1);
    }
    for (std::size_t i = 2; i < width; ++i) {
        const float together = out.cost[i - 2], apart = shared.cost[i - 1];
        out.cost[i - 1] = apart <= together ? apart : together;
        out.choose(static_cast<int>(i), apart <= together ? left(i) : 0);
    }
}

#if defined(RAYDIX_X86_INTRINSICS)

/// The same of two plans, for nodes that cannot be leaves, in functions compiled for AVX2. A plan
/// is stored as one vector: one that was stored float by float would be waited for when it is
/// loaded.
[[gnu::always_inline]] __attribute__((target("avx2"))) inline void make_plan_within_avx2(
    const CollapsePlan<8>& a, const CollapsePlan<8>& b, float node_cost, CollapsePlan<8>& out) {
    const ShareVectors shared = cheapest_shares_within_avx2(a.cost.data(), b.cost.data());
    const __m256 as_node = _mm256_add_ps(
        _mm256_permutevar8x32_ps(shared.cost, _mm256_set1_epi32(7)), _mm256_set1_ps(node_cost));
    // Costs of a and b fall with the number of subtrees, so those of shares do: i subtrees cost no
    // more than i - 1 unless one node costs less than all of them.
    const __m256 least = _mm256_min_ps(shared.cost, as_node);
    const __m256 divides = _mm256_cmp_ps(shared.cost, as_node, _CMP_LE_OQ);
    const __m256i choices =
        _mm256_sllv_epi32(_mm256_and_si256(shared.left, _mm256_castps_si256(divides)),
                          _mm256_setr_epi32(0, 4, 8, 12, 16, 20, 24, 28));
    __m128i word =
        _mm_or_si128(_mm256_castsi256_si128(choices), _mm256_extracti128_si256(choices, 1));
    word = _mm_or_si128(word, _mm_shuffle_epi32(word, 0x4E));
    word = _mm_or_si128(word, _mm_shuffle_epi32(word, 0xB1));
    _mm256_storeu_ps(
        reinterpret_cast<float*>(&out),
        _mm256_blend_ps(least, _mm256_castsi256_ps(_mm256_broadcastd_epi32(word)), 0x80));
}

/// The plan of a leaf, likewise.
[[gnu::always_inline]] __attribute__((target("avx2"))) inline void set_leaf_plan_within_avx2(
    float cost, CollapsePlan<8>& out) {
    _mm256_storeu_ps(
        reinterpret_cast<float*>(&out),
        _mm256_blend_ps(_mm256_set1_ps(cost), _mm256_castsi256_ps(_mm256_set1_epi32(1)), 0x80));
}

#endif

/// The children of the wide node whose root is k, from left to right; returns how many. Of k and of
/// what is below it `tree` tells its plan, whether it is a leaf of the binary tree, and the two
/// that it consists of if it is not.
template <int width, class Tree>
[[gnu::always_inline]] inline int choose_children(const Tree& tree, std::uint32_t k,
                                                  std::array<std::uint32_t, width>& chosen) {
    struct Forest {
        std::uint32_t root;
        int trees;
    };
    std::array<Forest, width> open;
    std::size_t waiting = 0;
    int count = 0;
    const auto divide = [&](std::uint32_t inner, int trees) {
        const int left = tree.plan_of(inner).choice(trees);
        const auto [a, b] = tree.parts_of(inner);
        open[waiting++] = {b, trees - left};
        open[waiting++] = {a, left};
    };
    divide(k, width);
    while (waiting > 0) {
        Forest next = open[--waiting];
        const CollapsePlan<width>& plan = tree.plan_of(next.root);
        if (tree.is_whole(next.root)) next.trees = 1;
        while (next.trees > 1 && plan.choice(next.trees) == 0) --next.trees;
        if (next.trees == 1)
            chosen[static_cast<std::size_t>(count++)] = next.root;
        else
            divide(next.root, next.trees);
    }
    return count;
}

/// Entry 0 is the root of the subtree. Used for one after the other, to keep the memory.
template <int width, class View>
class Collapse {
public:
    using Ref = typename View::Ref;
    using Entry = CollapseEntry<Ref>;
    using Plan = CollapsePlan<width>;

    Collapse(const View& view, const WideOptions& options) : view_(view), options_(options) {
        const double root = half_area(view.box(view.root()));
        per_area_ = root > 0 ? 1.0 / root : 0.0;
    }

    /// Enters and plans the subtree of `root`.
    void plan(Ref root) {
        entries_.reserve(2 * std::size_t{view_.size(root)});
        entries_.assign(1, entry_of(root));
        for (std::size_t k = 0; k < entries_.size(); ++k) {
            if (entries_[k].is_leaf()) continue;
            entries_[k].children = static_cast<std::uint32_t>(entries_.size());
            const auto [a, b] = view_.children(entries_[k].ref);
            entries_.push_back(entry_of(a));
            entries_.push_back(entry_of(b));
        }
        plans_.resize(entries_.size());
        for (std::size_t k = entries_.size(); k-- > 0;)
            if (entries_[k].is_leaf())
                plan_leaf(k);
            else
                make_plan(k);
    }

    [[nodiscard]] const Entry& entry(std::uint32_t k) const { return entries_[k]; }
    [[nodiscard]] std::size_t size() const { return entries_.size(); }
    /// Whether a subtree is a leaf of the wide tree, as a child of some node.
    [[nodiscard]] bool is_leaf(std::uint32_t k) const { return plans_[k].is_leaf(); }
    /// Of a subtree that is a child of some node.
    [[nodiscard]] SearchOdds odds(std::uint32_t k) const {
        return {entries_[k].hits, plans_[k].cost[0]};
    }
    /// Calls take(position) for the primitives of a leaf of the wide tree, in the tree's order.
    template <class Take>
    void for_each_primitive(std::uint32_t k, const Take& take) const {
        const Entry& e = entries_[k];
        if (e.is_leaf()) {
            view_.for_each_primitive(e.ref, take);
        } else {
            for_each_primitive(e.children, take);
            for_each_primitive(e.children + 1, take);
        }
    }

    /// The children of the wide node whose root is entry k; returns how many.
    int children(std::uint32_t k, std::array<std::uint32_t, width>& chosen) const {
        if (is_leaf(k)) {  // the whole tree is one leaf
            chosen[0] = k;
            return 1;
        }
        return choose_children<width>(*this, k, chosen);
    }

    // What choose_children asks.
    [[nodiscard]] const Plan& plan_of(std::uint32_t k) const { return plans_[k]; }
    [[nodiscard]] bool is_whole(std::uint32_t k) const { return entries_[k].is_leaf(); }
    [[nodiscard]] std::array<std::uint32_t, 2> parts_of(std::uint32_t k) const {
        return {entries_[k].children, entries_[k].children + 1};
    }

private:
    /// What its children will be read from is asked for ahead.
    [[nodiscard]] Entry entry_of(Ref ref) const {
        view_.prefetch(ref);
        if (view_.is_leaf(ref)) return {view_.box(ref), ref, Entry::none, view_.run(ref), 0};
        return {view_.box(ref), ref, 0, {0, 0}, 0};
    }

    void plan_leaf(std::size_t k) {
        const float area = relative_area(entries_[k].box);
        plans_[k].cost.fill(leaf_cost(area, entries_[k].run.count));
        plans_[k].choices = 1;
        entries_[k].hits = hits_of_leaf(area);
    }

    [[nodiscard]] float relative_area(const Aabb& box) const {
        return static_cast<float>(std::max(half_area(box), 0.0) * per_area_);
    }
    [[nodiscard]] float leaf_cost(float area, std::uint32_t count) const {
        const std::uint32_t blocks = (count + options_.block - 1) / options_.block;
        return area * static_cast<float>(blocks) * static_cast<float>(options_.primitive_cost);
    }

    void make_plan(std::size_t k) {
        Entry& entry = entries_[k];
        entry.run = view_.join(entries_[entry.children].run, entries_[entry.children + 1].run);
        const float area = relative_area(entry.box);
        // The root is a node in any case: nothing is saved by making it a leaf, its only child.
        const double node_cost = entry.ref == view_.root() ? 0.0 : options_.node_cost;
        const bool may_be_leaf =
            entry.run.first != PrimitiveRun::several && entry.run.count <= options_.max_leaf;
        raydix::make_plan<width>(divide(plans_[entry.children], plans_[entry.children + 1]),
                                 area * static_cast<float>(node_cost),
                                 may_be_leaf ? leaf_cost(area, entry.run.count) : infinity,
                                 plans_[k]);
        entry.hits = plans_[k].is_leaf() ? hits_of_leaf(area)
                                         : joined_hits(entries_[entry.children].hits,
                                                       entries_[entry.children + 1].hits, area);
    }

    /// Plans begin with their costs, and end with another word.
    [[nodiscard]] SubtreeShares<width> divide(const Plan& a, const Plan& b) const {
#if defined(RAYDIX_X86_INTRINSICS)
        static_assert(sizeof(Plan) == width * sizeof(float));
        if constexpr (width == 8)
            if (with_avx2_) return cheapest_shares_avx2(a.cost.data(), b.cost.data());
#endif
        return cheapest_shares<width>(a.cost.data(), b.cost.data());
    }

    const View& view_;
    WideOptions options_;
    double per_area_ = 0;
#if defined(RAYDIX_X86_INTRINSICS)
    const bool with_avx2_ = __builtin_cpu_supports("avx2");
#endif
    std::vector<Entry> entries_;
    std::vector<Plan> plans_;
};

}  // namespace raydix
