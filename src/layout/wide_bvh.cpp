#include "layout/wide_bvh.h"

#include <raydix/error.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "exec/parallel.h"
#include "primitives/zero_area.h"

namespace raydix {
namespace {

constexpr std::uint32_t lanes = 8;
/// Beyond, a leaf's word would be a NaN as a float: kernels take that for a missing child.
constexpr std::uint32_t max_places = (1u << 28) - (1u << 20);

/// Where leaves go: into the block that they fill best of a few that are not full.
class BlockFiller {
public:
    /// The place of the first of `count` triangles, 1 to 8.
    std::uint32_t place(std::uint32_t count) {
        std::size_t best = open_.size();
        for (std::size_t k = 0; k < open_.size(); ++k)
            if (room(open_[k]) >= count &&
                (best == open_.size() || room(open_[k]) < room(open_[best])))
                best = k;
        if (best == open_.size()) {
            // The fullest of those before makes way.
            best = 0;
            for (std::size_t k = 1; k < open_.size(); ++k)
                if (room(open_[k]) < room(open_[best])) best = k;
            open_[best] = lanes * blocks_++;
        }
        const std::uint32_t first = open_[best];
        open_[best] += count;
        if (open_[best] % lanes == 0) open_[best] = full;
        return first;
    }
    [[nodiscard]] std::uint32_t blocks() const { return blocks_; }

private:
    static constexpr std::uint32_t full = ~std::uint32_t{0};
    static std::uint32_t room(std::uint32_t next) {
        return next == full ? 0 : lanes - next % lanes;
    }
    std::array<std::uint32_t, 4> open_{full, full, full, full};  // next places
    std::uint32_t blocks_ = 0;
};

class Layout {
public:
    Layout(const WideTree& wide, const Bvh& bvh, WideBvh::Arrays& out)
        : wide_(wide), bvh_(bvh), out_(out) {}

    double run() {
        find_flat();
        place_nodes();
        words_.resize(wide_.children.size());
        place_leaves();
        out_.bounds = bvh_.bounds();
        out_.nodes.reset(wide_.node_count());
        out_.blocks.reset(filler_.blocks());
        std::fill_n(out_.blocks.data(), filler_.blocks(), TriangleBlock{});
        for_each_index(
            wide_.node_count(), [&](std::size_t w) { write_node(w); }, 128);
        double area = 0;
        for (std::size_t c = 0; c < words_.size(); ++c)
            if (words_[c] != wide_no_child)
                area += half_area({wide_.children[c].lo, wide_.children[c].hi});
        return area;
    }

private:
    void find_flat() {
        flat_.resize(bvh_.order().size());
        for_each_index(flat_.size(),
                       [&](std::size_t k) { flat_[k] = has_zero_area(bvh_.triangles()[k]); });
    }

    /// Depth first: what rays visit together lies together, at every size of page and cache.
    void place_nodes() {
        std::vector<std::uint32_t> waiting{0};
        place_.resize(wide_.node_count());
        by_place_.reserve(wide_.node_count());
        while (!waiting.empty() && wide_.node_count() > 0) {
            const std::uint32_t w = waiting.back();
            waiting.pop_back();
            place_[w] = static_cast<std::uint32_t>(by_place_.size());
            by_place_.push_back(w);
            const auto children = wide_.node(w);
            for (std::size_t k = children.size(); k-- > 0;)
                if (WideTree::is_inner(children[k])) waiting.push_back(children[k].first);
        }
    }

    void place_leaves() {
        for (const std::uint32_t w : by_place_) {
            const std::size_t base = w * static_cast<std::size_t>(wide_.width);
            for (std::size_t c = base; c < base + static_cast<std::size_t>(wide_.width); ++c)
                words_[c] = word_of(wide_.children[c]);
        }
    }

    std::uint32_t word_of(const BvhNode& child) {
        if (WideTree::is_unused(child)) return wide_no_child;
        if (WideTree::is_inner(child)) return place_[child.first];
        std::uint32_t kept = 0;
        for (std::uint32_t k = 0; k < child.count; ++k) kept += flat_[child.first + k] == 0;
        if (kept == 0) return wide_no_child;
        const std::uint32_t place = filler_.place(kept);
        if (place >= max_places)
            throw InputError("a wide tree holds " + std::to_string(max_places) +
                             " triangle references at most");
        return wide_leaf_bit | place << 3 | (kept - 1);
    }

    void write_node(std::size_t w) {
        const std::size_t base = w * static_cast<std::size_t>(wide_.width);
        std::array<Aabb, quantised_width> boxes;
        std::array<std::size_t, quantised_width> from{};
        std::array<int, quantised_width> slots{};
        std::size_t count = 0;
        for (std::size_t k = base; k < base + static_cast<std::size_t>(wide_.width); ++k) {
            if (words_[k] == wide_no_child) continue;
            boxes[count] = {wide_.children[k].lo, wide_.children[k].hi};
            from[count++] = k;
        }
        assign_octant_slots_greedily(std::span(boxes).first(count), slots.data());
        WideNode& node = out_.nodes[place_[w]];
        node = {};
        std::fill_n(node.child, quantised_width, wide_no_child);
        ChildSlots children{};
        for (std::size_t k = 0; k < count; ++k) {
            const auto s = static_cast<std::size_t>(slots[k]);
            children[s] = &wide_.children[from[k]];
            node.used |= static_cast<std::uint8_t>(1u << s);
            node.child[s] = words_[from[k]];
            if ((words_[from[k]] & wide_leaf_bit) != 0)
                copy_leaf(wide_.children[from[k]], (words_[from[k]] & ~wide_leaf_bit) >> 3);
        }
        if (count > 0) quantise_children(children, node);
    }

    void copy_leaf(const BvhNode& leaf, std::uint32_t place) {
        for (std::uint32_t k = leaf.first; k < leaf.first + leaf.count; ++k) {
            if (flat_[k] != 0) continue;
            TriangleBlock& block = out_.blocks[place / lanes];
            const std::uint32_t lane = place++ % lanes;
            const LeafTriangle& t = bvh_.triangles()[k];
            const Vec3 corners[3] = {t.v0, t.v1, t.v2};
            for (int v = 0; v < 3; ++v)
                for (int axis = 0; axis < 3; ++axis)
                    block.corner[3 * v + axis][lane] = coordinate(corners[v], axis);
            block.prim[lane] = bvh_.order()[k];
        }
    }

    const WideTree& wide_;
    const Bvh& bvh_;
    WideBvh::Arrays& out_;
    BlockFiller filler_;
    std::vector<std::uint8_t> flat_;               // [references] 1: no area
    std::vector<std::uint32_t> words_;             // [children]
    std::vector<std::uint32_t> place_, by_place_;  // [nodes] and its inverse
};

}  // namespace

double make_wide_layout(const WideTree& wide, const Bvh& bvh, WideBvh::Arrays& out) {
    return Layout(wide, bvh, out).run();
}

}  // namespace raydix
