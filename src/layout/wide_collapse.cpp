#include "layout/wide_collapse.h"

#include <raydix/error.h>

#include <algorithm>
#include <array>
#include <span>
#include <string>
#include <vector>

#include "base/math.h"
#include "exec/parallel.h"
#include "layout/collapse_plan.h"

namespace raydix {
namespace {

template <int width>
class WholeCollapse {
public:
    WholeCollapse(const BinaryView& view, const WideOptions& options) : collapse_(view, options) {
        collapse_.plan(view.root());
    }

    WideTree run() {
        WideTree tree;
        tree.width = width;
        tree.max_depth = place_nodes();
        tree.children.reset(roots_.size() * width);
        for_each_range(roots_.size(), 512, [&](std::size_t begin, std::size_t end) {
            for (std::size_t w = begin; w < end; ++w) emit(w, &tree.children[w * width]);
        });
        return tree;
    }

private:
    /// Numbers the wide nodes level by level; returns how many levels there are.
    std::uint32_t place_nodes() {
        roots_ = {0};
        std::uint32_t levels = 0;
        std::array<std::uint32_t, width> chosen;
        for (std::size_t begin = 0; begin < roots_.size(); ++levels)
            for (const std::size_t end = roots_.size(); begin < end; ++begin) {
                base_.push_back(static_cast<std::uint32_t>(roots_.size()));
                const std::size_t count = children(roots_[begin], chosen);
                for (std::size_t k = 0; k < count; ++k)
                    if (!collapse_.is_leaf(chosen[k])) roots_.push_back(chosen[k]);
            }
        return levels;
    }

    /// By ascending search_rank; those of equal rank from left to right.
    std::size_t children(std::uint32_t root, std::array<std::uint32_t, width>& chosen) const {
        const auto count = static_cast<std::size_t>(collapse_.children(root, chosen));
        order_for_search(std::span(chosen).first(count),
                         [&](std::uint32_t k) { return collapse_.odds(k); });
        return count;
    }

    void emit(std::size_t w, BvhNode* out) const {
        std::array<std::uint32_t, width> chosen;
        const std::size_t count = children(roots_[w], chosen);
        std::uint32_t next = base_[w];
        for (std::size_t k = 0; k < count; ++k) {
            const auto& entry = collapse_.entry(chosen[k]);
            if (collapse_.is_leaf(chosen[k]))
                out[k] = {entry.box.lo, entry.run.first, entry.box.hi, entry.run.count};
            else
                out[k] = {entry.box.lo, next++, entry.box.hi, 0};
        }
        const Aabb none = empty_box();
        std::fill(out + count, out + width, BvhNode{none.lo, WideTree::no_child, none.hi, 0});
    }

    Collapse<width, BinaryView> collapse_;
    std::vector<std::uint32_t> roots_, base_;  // [wide nodes]: entry; first inner child
};

}  // namespace

void check_wide_options(const WideOptions& options) {
    if (options.width != 4 && options.width != 8)
        throw InputError("wide trees have 4 or 8 children a node, not " +
                         std::to_string(options.width));
    if (options.block == 0) throw InputError("a block must hold one primitive at least");
    if (options.max_leaf == 0) throw InputError("a leaf must hold one primitive at least");
}

WideTree collapse_to_wide(const Bvh& bvh, const WideOptions& options) {
    check_wide_options(options);
    WideTree none;
    none.width = options.width;
    if (bvh.empty()) return none;
    const BinaryView view(bvh, options.max_leaf);
    return options.width == 4 ? WholeCollapse<4>(view, options).run()
                              : WholeCollapse<8>(view, options).run();
}

double wide_cost(const WideTree& tree, const WideOptions& options) {
    double sum = 0, root_area = 0;
    for (std::uint32_t w = 0; w < tree.node_count(); ++w) {
        Aabb box = empty_box();
        for (const BvhNode& child : tree.node(w)) {
            if (WideTree::is_unused(child)) continue;
            box = unite(box, {child.lo, child.hi});
            const std::uint32_t blocks = (child.count + options.block - 1) / options.block;
            sum += blocks * options.primitive_cost * half_area({child.lo, child.hi});
        }
        if (w == 0) root_area = half_area(box);
        sum += options.node_cost * half_area(box);
    }
    return root_area > 0 ? sum / (root_area * options.node_cost) : 0.0;
}

}  // namespace raydix
