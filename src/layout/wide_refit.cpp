#include "layout/wide_refit.h"

#include <algorithm>
#include <atomic>
#include <memory>
#include <utility>
#include <vector>

#include "exec/large_pages.h"
#include "exec/parallel.h"
#include "layout/about_middle.h"
#include "layout/wide_bvh.h"
#include "primitives/bounds.h"
#include "primitives/sources.h"
#include "primitives/zero_area.h"

namespace raydix {
namespace {

bool is_leaf(std::uint32_t word) { return word != wide_no_child && (word & wide_leaf_bit) != 0; }
bool is_inner(std::uint32_t word) { return word != wide_no_child && (word & wide_leaf_bit) == 0; }

class WideRefit {
public:
    WideRefit(const WideBvh::Arrays& from, const MeshView& mesh)
        : from_(from),
          source_{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()},
          triangles_(static_cast<std::uint32_t>(mesh.triangles.size())) {}

    /// Null where the tree cannot be kept.
    std::unique_ptr<WideBvh::Arrays> run() {
        if (!order_by_depth()) return nullptr;
        auto out = std::make_unique<WideBvh::Arrays>();
        out->stats = from_.stats;
        out->nodes.reset(from_.nodes.size());
        out->blocks.reset(from_.blocks.size());
        prefer_large_pages(out->nodes);
        prefer_large_pages(out->blocks);
        std::copy(from_.blocks.view().begin(), from_.blocks.view().end(), out->blocks.data());
        boxes_.resize(from_.nodes.size());
        around_.resize(from_.nodes.size());
        leaf_area_.resize(from_.nodes.size());
        in_tree_.resize(triangles_);
        if (!fill_leaves(*out) || !others_stay_out()) return nullptr;
        fill_inner();
        // With those that are never hit, as in a new tree.
        const auto scene = scene_bounds(source_, triangles_);
        out->set_bounds(scene.box);
        out->stats.left_out = scene.left_out;
        for_each_index(
            from_.nodes.size(),
            [&](std::size_t w) {
                set_boxes_about(out->middle, boxes_[w], out->nodes[w]);
                std::copy_n(from_.nodes[w].child, quantised_width, out->nodes[w].child);
            },
            grain);
        double nodes = 0, leaves = 0;
        for (std::size_t w = 0; w < from_.nodes.size(); ++w)
            nodes += half_area(around_[w]), leaves += leaf_area_[w];
        const double root = half_area(out->bounds);
        out->stats.sah = root > 0 ? (nodes + wide_primitive_cost * leaves) / root : 0;
        return out;
    }

private:
    static constexpr std::size_t grain = 512;

    /// by_depth_: nodes, the deepest first; level_: where each depth begins. False if a node
    /// comes before its parent.
    bool order_by_depth() {
        const std::size_t count = from_.nodes.size();
        std::vector<std::uint32_t> depth(count, 0);
        std::uint32_t deepest = 0;
        for (std::size_t w = 0; w < count; ++w) {
            deepest = std::max(deepest, depth[w]);
            for (const std::uint32_t word : from_.nodes[w].child) {
                if (!is_inner(word)) continue;
                if (word <= w) return false;
                depth[word] = depth[w] + 1;
            }
        }
        level_.assign(std::size_t{deepest} + 2, 0);
        for (const std::uint32_t d : depth) ++level_[deepest - d + 1];
        for (std::size_t k = 1; k < level_.size(); ++k) level_[k] += level_[k - 1];
        by_depth_.resize(count);
        std::vector<std::size_t> next(level_.begin(), level_.end() - 1);
        for (std::size_t w = 0; w < count; ++w)
            by_depth_[next[deepest - depth[w]]++] = static_cast<std::uint32_t>(w);
        return true;
    }

    /// Corners and boxes of leaves. False if a triangle cannot stay where it is.
    bool fill_leaves(WideBvh::Arrays& out) {
        std::atomic<bool> good = true;
        for_each_index(
            from_.nodes.size(),
            [&](std::size_t w) {
                for (int slot = 0; slot < quantised_width; ++slot) {
                    const std::uint32_t word = from_.nodes[w].child[slot];
                    if (word == wide_no_child) continue;
                    boxes_[w].used |= 1u << slot;
                    if (!is_leaf(word)) continue;
                    Aabb box = empty_box();
                    if (!fill_leaf(word, out, box)) good = false;
                    boxes_[w].set(slot, box);
                    leaf_area_[w] += half_area(box) * ((word & 7) + 1);
                }
            },
            grain);
        return good;
    }

    bool fill_leaf(std::uint32_t word, WideBvh::Arrays& out, Aabb& box) {
        const std::uint32_t place = (word & ~wide_leaf_bit) >> 3, count = (word & 7) + 1;
        for (std::uint32_t p = place; p < place + count; ++p) {
            TriangleBlock& block = out.blocks[p / block_lanes];
            const std::uint32_t prim = block.prim[p % block_lanes];
            Aabb own;
            if (prim >= triangles_ || !source_.box(prim, own)) return false;
            const LeafTriangle corners = source_.corners(prim);
            if (has_zero_area(corners)) return false;
            // A part of a triangle is not the only one.
            if (std::atomic_ref(in_tree_[prim]).exchange(1) != 0) return false;
            block.set(p % block_lanes, corners, prim);
            box = unite(box, own);
        }
        return true;
    }

    /// Triangles that are not in the tree: as they could not be hit then, so now.
    [[nodiscard]] bool others_stay_out() const {
        std::atomic<bool> good = true;
        for_each_index(
            triangles_,
            [&](std::size_t i) {
                if (in_tree_[i] != 0) return;
                const auto prim = static_cast<std::uint32_t>(i);
                Aabb box;
                if (source_.box(prim, box) && !has_zero_area(source_.corners(prim))) good = false;
            },
            grain * 16);
        return good;
    }

    void fill_inner() {
        for (std::size_t k = 0; k + 1 < level_.size(); ++k)
            for_each_index(
                level_[k + 1] - level_[k],
                [&](std::size_t i) { fill_node(by_depth_[level_[k] + i]); }, grain);
    }

    /// When those of its children are known.
    void fill_node(std::uint32_t w) {
        SlotBoxes& boxes = boxes_[w];
        Aabb all = empty_box();
        for (int slot = 0; slot < quantised_width; ++slot) {
            const std::uint32_t word = from_.nodes[w].child[slot];
            if (word == wide_no_child) continue;
            if (is_inner(word)) boxes.set(slot, around_[word]);
            all = unite(all, {{boxes.lo[0][slot], boxes.lo[1][slot], boxes.lo[2][slot]},
                              {boxes.hi[0][slot], boxes.hi[1][slot], boxes.hi[2][slot]}});
        }
        around_[w] = all;
    }

    const WideBvh::Arrays& from_;
    const TriangleSource source_;
    const std::uint32_t triangles_;
    std::vector<std::uint32_t> by_depth_;
    std::vector<std::size_t> level_;
    std::vector<SlotBoxes> boxes_;       // [nodes]
    std::vector<Aabb> around_;           // [nodes]
    std::vector<double> leaf_area_;      // [nodes], times the triangles
    std::vector<std::uint8_t> in_tree_;  // [triangles]
};

}  // namespace

std::optional<WideBvh> refit_wide(const WideBvh& tree, const MeshView& mesh) {
    const WideBvhStats& stats = tree.stats();
    if (stats.compact || tree.empty() || stats.input_count != mesh.triangles.size()) return {};
    std::unique_ptr<WideBvh::Arrays> arrays = WideRefit(tree.arrays(), mesh).run();
    if (arrays == nullptr) return {};
    return WideBvhInternals::tree_of(std::move(arrays));
}

}  // namespace raydix
