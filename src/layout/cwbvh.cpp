#include "layout/cwbvh.h"

#include <array>
#include <span>
#include <vector>

#include "base/math.h"
#include "exec/parallel.h"

namespace raydix {
namespace {

Aabb box_of(const BvhNode& node) { return {node.lo, node.hi}; }

std::size_t used_children(std::span<const BvhNode> children) {
    std::size_t count = 0;
    while (count < children.size() && !WideTree::is_unused(children[count])) ++count;
    return count;
}

using ChildSlots = std::array<const BvhNode*, cwbvh_width>;

ChildSlots children_by_slot(std::span<const BvhNode> children) {
    std::array<Aabb, cwbvh_width> boxes;
    std::array<int, cwbvh_width> places{};
    const std::size_t count = used_children(children);
    for (std::size_t k = 0; k < count; ++k) boxes[k] = box_of(children[k]);
    assign_octant_slots(std::span(boxes).first(count), places.data());
    ChildSlots slots{};
    for (std::size_t k = 0; k < count; ++k)
        slots[static_cast<std::size_t>(places[k])] = &children[k];
    return slots;
}

class Compression {
public:
    Compression(const WideTree& wide, const Bvh& bvh, Cwbvh::Arrays& out)
        : wide_(wide), bvh_(bvh), out_(out) {}

    void run() {
        const std::uint32_t n = wide_.node_count();
        out_.nodes.reset(n);
        out_.triangles.reset(count_triangles());
        out_.bounds = bvh_.bounds();
        place_.resize(n);
        if (n > 0) place_[0] = 0;
        order_.resize(n);
        for_each_index(
            n, [&](std::size_t w) { place_children(w); }, 256);
        for_each_index(
            n, [&](std::size_t w) { write_node(w); }, 256);
    }

private:
    /// Where each node's triangles and child nodes begin; returns how many triangles there are.
    std::size_t count_triangles() {
        std::uint32_t triangles = 0, nodes = 1;
        for (std::uint32_t w = 0; w < wide_.node_count(); ++w) {
            bases_.push_back({nodes, triangles});
            for (const BvhNode& child : wide_.node(w)) {
                nodes += WideTree::is_inner(child) ? 1 : 0;
                triangles += child.count;
            }
        }
        return triangles;
    }

    /// Siblings take the places that they had together, in the order of their slots.
    void place_children(std::size_t w) {
        const auto children = wide_.node(static_cast<std::uint32_t>(w));
        order_[w] = children_by_slot(children);
        std::uint32_t next = bases_[w].node;
        for (const BvhNode* child : order_[w])
            if (child != nullptr && WideTree::is_inner(*child)) place_[child->first] = next++;
    }

    void write_node(std::size_t w) {
        CwbvhNode node{};
        SlotBoxes boxes;
        Aabb all = empty_box();
        for (std::size_t s = 0; s < cwbvh_width; ++s)
            if (const BvhNode* child = order_[w][s]; child != nullptr) {
                boxes.set(static_cast<int>(s), box_of(*child));
                all = unite(all, box_of(*child));
            }
        set_boxes(node, quantise(boxes, all));
        node.child_base = bases_[w].node;
        node.triangle_base = bases_[w].triangle;
        std::uint32_t position = 0;
        for (std::uint32_t s = 0; s < cwbvh_width; ++s) {
            const BvhNode* child = order_[w][s];
            if (child == nullptr) continue;
            if (WideTree::is_inner(*child)) {
                node.inner_mask |= static_cast<std::uint8_t>(1u << s);
                node.meta[s] = static_cast<std::uint8_t>(1u << 5 | (cwbvh_first_child_bit + s));
            } else {
                const std::uint32_t ones = (1u << child->count) - 1;
                node.meta[s] = static_cast<std::uint8_t>(ones << 5 | position);
                for (std::uint32_t k = 0; k < child->count; ++k, ++position)
                    out_.triangles[node.triangle_base + position] = triangle(child->first + k);
            }
        }
        out_.nodes[place_[w]] = node;
    }

    [[nodiscard]] CwbvhTriangle triangle(std::uint32_t position) const {
        const LeafTriangle& t = bvh_.triangles()[position];
        return {t.v0, bvh_.order()[position], t.v1, 0, t.v2, 0};
    }

    struct Bases {
        std::uint32_t node, triangle;
    };
    const WideTree& wide_;
    const Bvh& bvh_;
    Cwbvh::Arrays& out_;
    std::vector<Bases> bases_;          // [wide nodes]
    std::vector<std::uint32_t> place_;  // wide node -> its place
    std::vector<ChildSlots> order_;     // [wide nodes]
};

}  // namespace

void compress_wide_tree(const WideTree& wide, const Bvh& bvh, Cwbvh::Arrays& out) {
    Compression(wide, bvh, out).run();
}

}  // namespace raydix
