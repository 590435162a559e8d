// Pairs of triangles of trees in double.
#include <raydix/double.h>

#include <optional>

#include "proximity/pair_search.h"
#include "proximity/unsplit_tree.h"
#include "trace/double_tree.h"
#include "tree/around_center.h"
#include "tree/walk.h"

namespace raydix {
namespace {

/// A tree in double, with nodes where those of another tree are: two scenes need not have the same
/// center.
class PairSideD {
public:
    PairSideD(const BvhD& given, const BvhD& where) {
        if (has_parts(given)) whole_ = make_unsplit_tree(given);
        const BvhD& bvh = whole_ ? *whole_ : given;
        boxes_.reset(bvh.order().size());
        keys_.reset(bvh.order().size());
        nodes_.reset(bvh.tree().nodes().size());
        const TreeSpace space{where.center(), where.scale()};
        for_each_index(boxes_.size(), [&](std::size_t k) {
            const LeafTriangleD& t = bvh.triangles()[k];
            const Aabb box = box_around_center(box_of(t.v0, t.v1, t.v2), space.center, space.scale);
            boxes_[k] = {box.lo, bvh.order()[k], box.hi, 0};
            keys_[k] = corner_keys(t);
        });
        fit_nodes(bvh);
        tree = {nodes_.data(), boxes_.data(), bvh.triangles().data(), keys_.data(),
                bvh.max_depth()};
    }

    PairTreeD tree;

    /// At most, what a side holds while it is made.
    static std::uint64_t bytes_for(const BvhD& bvh) {
        const std::size_t nodes = bvh.tree().nodes().size();
        const std::uint64_t own = bvh.order().size() * (sizeof(PairBox) + sizeof(CornerKeys)) +
                                  nodes * (sizeof(BvhNode) + sizeof(std::uint32_t));
        return own + (has_parts(bvh) ? unsplit_tree_bytes(bvh) : 0);
    }

private:
    void fit_nodes(const BvhD& bvh) {
        std::vector<std::uint32_t> slots;
        slots.reserve(nodes_.size());
        const auto given = bvh.tree().nodes();
        walk_preorder(given, bvh.max_depth(), [&](std::uint32_t slot) { slots.push_back(slot); });
        for (auto at = slots.rbegin(); at != slots.rend(); ++at) {  // children before parents
            const BvhNode& old = given[*at];
            Aabb box = empty_box();
            if (old.is_leaf())
                for (std::uint32_t k = old.first; k < old.first + old.count; ++k)
                    box = unite(box, {boxes_[k].lo, boxes_[k].hi});
            else
                for (const std::uint32_t k : {old.first, old.first + 1})
                    box = unite(box, {nodes_[k].lo, nodes_[k].hi});
            nodes_[*at] = {box.lo, old.first, box.hi, old.count};
        }
    }

    std::optional<BvhD> whole_;
    Buffer<PairBox> boxes_;
    Buffer<CornerKeys> keys_;
    Buffer<BvhNode> nodes_;
};

}  // namespace

std::vector<PrimitivePair> overlapping_pairs(const BvhD& bvh, const PairOptions& options) {
    return all_pairs<PairSideD, BvhD>(bvh, nullptr, options);
}

std::vector<PrimitivePair> overlapping_pairs(const BvhD& a, const BvhD& b,
                                             const PairOptions& options) {
    return all_pairs<PairSideD>(a, &b, options);
}

std::uint64_t count_overlapping_pairs(const BvhD& bvh, const PairOptions& options) {
    return run_pairs<PairSideD, BvhD>(bvh, nullptr, options, nullptr);
}

std::uint64_t count_overlapping_pairs(const BvhD& a, const BvhD& b, const PairOptions& options) {
    return run_pairs<PairSideD>(a, &b, options, nullptr);
}

}  // namespace raydix
