#include "layout/wide_check.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <string>
#include <type_traits>
#include <vector>

#include "base/same_bits.h"
#include "exec/search.h"
#include "layout/about_middle.h"
#include "layout/child_words.h"
#include "primitives/sources.h"
#include "primitives/zero_area.h"

namespace raydix {
namespace {

using namespace child_words;

std::string node_name(std::size_t w) { return "nodes: node " + std::to_string(w); }

/// Triangles of several meshes, counted through.
class MeshRow {
public:
    explicit MeshRow(std::span<const MeshView> meshes) {
        for (const MeshView& mesh : meshes) {
            sources_.push_back({mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()});
            first_.push_back(count_);
            count_ += mesh.triangles.size();
        }
    }
    [[nodiscard]] std::uint64_t count() const { return count_; }
    /// False if it is to be left out, or has no area.
    [[nodiscard]] bool triangle(std::uint64_t i, LeafTriangle& corners, bool& left_out) const {
        const auto mesh = static_cast<std::size_t>(
            std::upper_bound(first_.begin(), first_.end(), i) - first_.begin() - 1);
        const auto local = static_cast<std::uint32_t>(i - first_[mesh]);
        Aabb box;
        left_out = !sources_[mesh].box(local, box);
        corners = sources_[mesh].corners(local);
        return !left_out && !has_zero_area(corners);
    }

private:
    std::vector<TriangleSource> sources_;
    std::vector<std::uint64_t> first_;
    std::uint64_t count_ = 0;
};

Aabb box_of_triangle(const LeafTriangle& t) { return box_of(t.v0, t.v1, t.v2); }

/// Boxes as one kind of nodes has them.
template <class Node>
struct Boxes;

template <>
struct Boxes<WideNode> {
    Vec3 middle;

    [[nodiscard]] bool is_sound(const WideNode& node, std::size_t s) const {
        const bool used = node.child[s] != wide_no_child;
        for (int axis = 0; axis < 3; ++axis) {
            const float lo = node.lo[axis][s], hi = node.hi[axis][s];
            if (used ? !(lo <= hi && std::isfinite(lo) && std::isfinite(hi))
                     : !(lo == infinity && hi == -infinity))
                return false;
        }
        return true;
    }
    [[nodiscard]] bool contains(const WideNode& node, std::size_t s, const Aabb& box) const {
        SlotBoxes exact{};
        exact.set(static_cast<int>(s), box);
        WideNode rounded;
        set_boxes_about(middle, exact, rounded);
        bool inside = true;
        for (int axis = 0; axis < 3; ++axis)
            inside = inside && node.lo[axis][s] <= rounded.lo[axis][s] &&
                     rounded.hi[axis][s] <= node.hi[axis][s];
        return inside;
    }
};

template <>
struct Boxes<CompactNode> {
    explicit Boxes(Vec3) {}

    /// No larger than twice what coordinates may be: nothing that rays compute overflows.
    [[nodiscard]] bool is_sound(const CompactNode& node, std::size_t s) const {
        const bool used = node.child[s] != wide_no_child;
        if (((node.used >> s & 1) != 0) != used) return false;
        for (int axis = 0; used && axis < 3; ++axis)
            if (!(std::fabs(node.origin[axis]) <= max_coordinate) ||
                node.exponent[axis] < min_step_exponent ||
                quantised_step(node.exponent[axis]) > double{max_coordinate} ||
                node.lo[axis][s] > node.hi[axis][s])
                return false;
        return true;
    }
    [[nodiscard]] bool contains(const CompactNode& node, std::size_t s, const Aabb& box) const {
        return contains_exactly(node, static_cast<int>(s), box);
    }
};

/// One tree, step by step: each step relies on those before it.
template <class Node, class Block>
class WideCheck {
public:
    WideCheck(std::span<const Node> nodes, std::span<const Block> blocks,
              const WideBvh::Arrays& arrays, std::span<const MeshView> meshes)
        : nodes_(nodes), blocks_(blocks), arrays_(arrays), row_(meshes), boxes_{arrays.middle} {}

    Fault run(WideBvhStats& stats) {
        if (Fault fault = check_bounds()) return fault;
        if (nodes_.empty() && !blocks_.empty()) return "nodes: none, but there are blocks";
        if (Fault fault = check_links()) return fault;
        if (Fault fault = check_leaves()) return fault;
        if (Fault fault = check_triangles()) return fault;
        if (Fault fault = check_boxes()) return fault;
        fill(stats);
        return {};
    }

private:
    [[nodiscard]] Fault check_bounds() const {
        const Aabb& all = arrays_.bounds;
        if (!in_range(all.lo) || !in_range(all.hi) || is_empty(all))
            return "trees: bounds that are empty or out of range";
        return {};
    }

    /// Parents come first, so that there are no cycles.
    Fault check_links() {
        std::vector<std::uint8_t> named(nodes_.size());
        std::vector<std::uint32_t> depth(nodes_.size());
        for (std::size_t w = 0; w < nodes_.size(); ++w) {
            if (w != 0 && named[w] == 0) return node_name(w) + " is nobody's child";
            deepest_ = std::max(deepest_, depth[w]);
            for (std::size_t s = 0; s < quantised_width; ++s) {
                const std::uint32_t word = nodes_[w].child[s];
                if (!boxes_.is_sound(nodes_[w], s))
                    return node_name(w) + " has no proper box in slot " + std::to_string(s);
                if (word == wide_no_child) continue;
                ++children_;
                if (!is_inner(word)) continue;
                if (word <= w || word >= nodes_.size())
                    return node_name(w) + " has node " + std::to_string(word) + " of " +
                           std::to_string(nodes_.size()) + " as a child";
                if (named[word]++ != 0) return node_name(word) + " is a child of two";
                depth[word] = depth[w] + 1;
            }
        }
        return {};
    }

    /// Leaves' places, and that every lane that no leaf has is harmless.
    Fault check_leaves() {
        std::vector<std::uint8_t> lanes(blocks_.size());
        for (std::size_t w = 0; w < nodes_.size(); ++w)
            for (const std::uint32_t word : nodes_[w].child) {
                if (!is_leaf(word)) continue;
                const std::uint32_t place = first_place(word), count = leaf_size(word),
                                    lane = place % block_lanes;
                const std::size_t block = place / block_lanes;
                if (block >= blocks_.size() || lane + count > block_lanes)
                    return node_name(w) + " has a leaf of " + std::to_string(count) +
                           " triangles at place " + std::to_string(place) + " of " +
                           std::to_string(blocks_.size() * block_lanes);
                const std::uint32_t mine = ((1u << count) - 1) << lane;
                if ((lanes[block] & mine) != 0)
                    return "blocks: two leaves share a lane of block " + std::to_string(block);
                lanes[block] = static_cast<std::uint8_t>(lanes[block] | mine);
                ++leaves_;
                references_ += count;
            }
        for (std::size_t b = 0; b < blocks_.size(); ++b) {
            if (lanes[b] == 0) return "blocks: no leaf is in block " + std::to_string(b);
            if (!corners_in_range(blocks_[b]))
                return "blocks: block " + std::to_string(b) + " names a corner past the " +
                       std::to_string(arrays_.vertices.size());
        }
        return {};
    }
    /// Of all lanes: rays read them all.
    [[nodiscard]] bool corners_in_range(const CompactBlock& block) const {
        return std::ranges::all_of(block.vertex, [&](const auto& corners) {
            return std::ranges::all_of(
                corners, [&](std::uint32_t c) { return c < arrays_.vertices.size(); });
        });
    }
    [[nodiscard]] bool corners_in_range(const TriangleBlock&) const { return true; }

    [[nodiscard]] LeafTriangle corners(const TriangleBlock& block, std::uint32_t lane) const {
        const auto corner = [&](int v) {
            return Vec3{block.corner[3 * v][lane], block.corner[3 * v + 1][lane],
                        block.corner[3 * v + 2][lane]};
        };
        return {corner(0), corner(1), corner(2)};
    }
    [[nodiscard]] LeafTriangle corners(const CompactBlock& block, std::uint32_t lane) const {
        const auto corner = [&](int v) { return arrays_.vertices[block.vertex[v][lane]]; };
        return {corner(0), corner(1), corner(2)};
    }

    /// Calls visit(slot, place) for each triangle of a node's leaves, while it returns true.
    template <class Visit>
    static bool for_each_place(const Node& node, const Visit& visit) {
        for (std::size_t s = 0; s < quantised_width; ++s) {
            const std::uint32_t word = node.child[s];
            if (!is_leaf(word)) continue;
            for (std::uint32_t k = 0; k < leaf_size(word); ++k)
                if (!visit(s, first_place(word) + k)) return false;
        }
        return true;
    }

    /// Whether the triangle at a place is the mesh's.
    [[nodiscard]] bool is_copy(std::uint32_t place) const {
        const Block& block = blocks_[place / block_lanes];
        const std::uint32_t lane = place % block_lanes, prim = block.prim[lane];
        LeafTriangle there;
        bool left_out = false;
        if (prim >= row_.count() || !row_.triangle(prim, there, left_out)) return false;
        const LeafTriangle here = corners(block, lane);
        return same_bits(here.v0, there.v0) && same_bits(here.v1, there.v1) &&
               same_bits(here.v2, there.v2);
    }

    Fault check_triangles() {
        std::vector<std::uint8_t> uses(row_.count());
        const std::size_t bad = first_index_where(nodes_.size(), [&](std::size_t w) {
            return !for_each_place(
                nodes_[w], [&](std::size_t, std::uint32_t place) { return is_copy(place); });
        });
        if (bad < nodes_.size())
            return "blocks: a leaf of node " + std::to_string(bad) +
                   " holds what is no triangle of the meshes, or one that rays cannot hit";
        for (const Node& node : nodes_)
            for_each_place(node, [&](std::size_t, std::uint32_t place) {
                std::uint8_t& use = uses[blocks_[place / block_lanes].prim[place % block_lanes]];
                split_ = split_ || use != 0;
                use = 1;
                return true;
            });
        std::atomic<std::uint64_t> left_out = 0;
        const std::size_t missing = first_index_where(row_.count(), [&](std::size_t i) {
            LeafTriangle corners;
            bool invalid = false;
            const bool wanted = row_.triangle(i, corners, invalid);
            if (invalid) left_out.fetch_add(1, std::memory_order_relaxed);
            return wanted && uses[i] == 0;
        });
        if (missing < row_.count())
            return "blocks: triangle " + std::to_string(missing) + " is in no leaf";
        left_out_ = left_out;
        return {};
    }

    Fault check_boxes() {
        const std::size_t beside = first_index_where(nodes_.size(), [&](std::size_t w) {
            return !for_each_place(nodes_[w], [&](std::size_t s, std::uint32_t place) {
                const Aabb box =
                    box_of_triangle(corners(blocks_[place / block_lanes], place % block_lanes));
                return is_within(box, arrays_.bounds) &&
                       (split_ || boxes_.contains(nodes_[w], s, box));
            });
        });
        if (beside < nodes_.size())
            return node_name(beside) + " has a leaf with a triangle beside its box";
        const std::size_t bad = first_outer();
        if (bad < nodes_.size()) return node_name(bad) + " has a child that reaches beyond its box";
        return {};
    }
    static bool is_within(const Aabb& box, const Aabb& all) {
        return all.lo.x <= box.lo.x && all.lo.y <= box.lo.y && all.lo.z <= box.lo.z &&
               box.hi.x <= all.hi.x && box.hi.y <= all.hi.y && box.hi.z <= all.hi.z;
    }

    /// The first node whose inner children do not lie in their boxes.
    [[nodiscard]] std::size_t first_outer() const {
        if constexpr (std::is_same_v<Node, WideNode>) {
            return first_index_where(nodes_.size(), [&](std::size_t w) {
                for (std::size_t s = 0; s < quantised_width; ++s)
                    if (is_inner(nodes_[w].child[s]) && !holds(nodes_[w], s)) return true;
                return false;
            });
        } else {
            return split_ ? nodes_.size() : last_outer();
        }
    }
    /// Planes of plain nodes are all about the same point.
    [[nodiscard]] bool holds(const WideNode& node, std::size_t s) const {
        const WideNode& child = nodes_[node.child[s]];
        for (std::size_t k = 0; k < quantised_width; ++k) {
            if (child.child[k] == wide_no_child) continue;
            for (int axis = 0; axis < 3; ++axis)
                if (child.lo[axis][k] < node.lo[axis][s] || child.hi[axis][k] > node.hi[axis][s])
                    return false;
        }
        return true;
    }
    /// Each quantises for itself: what lies below is compared, children before their parents.
    [[nodiscard]] std::size_t last_outer() const {
        std::vector<Aabb> around(nodes_.size(), empty_box());
        for (std::size_t w = nodes_.size(); w-- > 0;) {
            for_each_place(nodes_[w], [&](std::size_t, std::uint32_t place) {
                around[w] = unite(around[w], box_of_triangle(corners(blocks_[place / block_lanes],
                                                                     place % block_lanes)));
                return true;
            });
            for (std::size_t s = 0; s < quantised_width; ++s) {
                const std::uint32_t word = nodes_[w].child[s];
                if (!is_inner(word) || is_empty(around[word])) continue;
                if (!boxes_.contains(nodes_[w], s, around[word])) return w;
                around[w] = unite(around[w], around[word]);
            }
        }
        return nodes_.size();
    }

    void fill(WideBvhStats& stats) const {
        stats.width = quantised_width;
        stats.nodes = nodes_.size();
        stats.leaves = leaves_;
        stats.references = references_;
        stats.max_depth = nodes_.empty() ? 0 : deepest_ + 1;
        stats.children_per_node =
            nodes_.empty() ? 0
                           : static_cast<double>(children_) / static_cast<double>(nodes_.size());
        stats.node_bytes = nodes_.size_bytes();
        stats.triangle_bytes = blocks_.size_bytes() + arrays_.vertices.size() * sizeof(Vec3);
        stats.bytes = stats.node_bytes + stats.triangle_bytes;
        stats.input_count = row_.count();
        stats.left_out = left_out_;
    }

    std::span<const Node> nodes_;
    std::span<const Block> blocks_;
    const WideBvh::Arrays& arrays_;
    MeshRow row_;
    Boxes<Node> boxes_;
    std::uint32_t deepest_ = 0;
    std::uint64_t children_ = 0, leaves_ = 0, references_ = 0, left_out_ = 0;
    bool split_ = false;  // some triangle is in several leaves
};

}  // namespace

Fault wide_fault(const WideBvh::Arrays& arrays, std::span<const MeshView> meshes,
                 WideBvhStats& stats) {
    stats.compact = arrays.stats.compact;
    if (stats.compact) {
        if (!std::ranges::all_of(arrays.vertices.view(), [](Vec3 v) { return in_range(v); }))
            return "corners: one is not finite or beyond 1e12";
        return WideCheck<CompactNode, CompactBlock>(arrays.compact_nodes.view(),
                                                    arrays.compact_blocks.view(), arrays, meshes)
            .run(stats);
    }
    return WideCheck<WideNode, TriangleBlock>(arrays.nodes.view(), arrays.blocks.view(), arrays,
                                              meshes)
        .run(stats);
}

}  // namespace raydix
