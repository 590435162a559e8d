#include "layout/local_pads.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/math.h"
#include "layout/about_middle.h"
#include "layout/child_words.h"
#include "tree/median_center.h"

namespace raydix {
namespace {

/// What a ray from within the root's box adds to a box on each side, in parts of the root's longest
/// side: 10 roundings for each of two axes (trace/simd/wide_ray.h).
constexpr float pad_a_side = 20 * 0x1p-24f;
/// From so many times the area on, most visits of boxes are for nothing.
constexpr double much_larger = 32;
constexpr std::size_t nodes_to_look_at = 256;

using namespace child_words;

/// Calls take(block, lane) for the triangles of a leaf.
template <class Block, class Take>
void for_each_triangle(const Buffer<Block>& blocks, std::uint32_t word, const Take& take) {
    const std::uint32_t place = first_place(word);
    for (std::uint32_t k = place; k < place + leaf_size(word); ++k)
        take(blocks[k / block_lanes], k % block_lanes);
}

struct Corners {
    const Vec3* vertices;  // of compact blocks

    [[nodiscard]] Vec3 operator()(const TriangleBlock& block, std::uint32_t lane, int v) const {
        const auto at = [&](int axis) { return block.corner[3 * v + axis][lane]; };
        return {at(0), at(1), at(2)};
    }
    [[nodiscard]] Vec3 operator()(const CompactBlock& block, std::uint32_t lane, int v) const {
        return vertices[block.vertex[v][lane]];
    }
};

template <class Node, class Block>
class LocalPads {
public:
    LocalPads(const Buffer<Node>& nodes, const Buffer<Block>& blocks, const WideBvh::Arrays& arrays)
        : nodes_(nodes), blocks_(blocks), arrays_(arrays), corner_{arrays.vertices.data()} {}

    [[nodiscard]] bool are_wanted() const {
        const Vec3 size = arrays_.bounds.hi - arrays_.bounds.lo;
        const float pad = pad_a_side * max_of(max_of(size.x, size.y), size.z);
        return most_leaves_grow(pad) && holds_each_once();
    }

    /// Of plain nodes.
    [[nodiscard]] Vec3 median() const {
        const Vec3d median = median_center(
            nodes_.size(),
            [&](std::size_t k, AabbD& box) {
                for (const std::uint32_t word : nodes_[k].child) {
                    if (!is_leaf(word)) continue;
                    const Aabb leaf = box_of_leaf(word);
                    box = {{leaf.lo.x, leaf.lo.y, leaf.lo.z}, {leaf.hi.x, leaf.hi.y, leaf.hi.z}};
                    return true;
                }
                return false;
            },
            {});
        return {static_cast<float>(median.x), static_cast<float>(median.y),
                static_cast<float>(median.z)};
    }
    /// New nodes: those of a tree may lie in a file.
    [[nodiscard]] Buffer<Node> nodes_about(Vec3 middle) const {
        Buffer<Node> nodes(nodes_.size());
        std::copy_n(nodes_.data(), nodes.size(), nodes.data());
        std::vector<Aabb> boxes(nodes.size());
        for (std::size_t k = nodes.size(); k-- > 0;) {  // children before parents
            SlotBoxes slots;
            boxes[k] = empty_box();
            for (int s = 0; s < quantised_width; ++s) {
                const std::uint32_t word = nodes[k].child[s];
                if (word == wide_no_child) continue;
                const Aabb box = is_leaf(word) ? box_of_leaf(word) : boxes[word];
                slots.set(s, box);
                boxes[k] = unite(boxes[k], box);
            }
            set_boxes_about(middle, slots, nodes[k]);
        }
        return nodes;
    }

private:
    [[nodiscard]] Aabb box_of_leaf(std::uint32_t word) const {
        Aabb box = empty_box();
        for_each_triangle(blocks_, word, [&](const Block& block, std::uint32_t lane) {
            for (int v = 0; v < 3; ++v) {
                const Vec3 corner = corner_(block, lane, v);
                box = unite(box, {corner, corner});
            }
        });
        return box;
    }

    [[nodiscard]] bool most_leaves_grow(float pad) const {
        const std::size_t count = std::min(nodes_.size(), nodes_to_look_at);
        std::size_t leaves = 0, growing = 0;
        for (std::size_t k = 0; k < count; ++k)
            for (const std::uint32_t word : nodes_[k * nodes_.size() / count].child) {
                if (!is_leaf(word)) continue;
                const Aabb box = box_of_leaf(word);
                const Vec3 size = box.hi - box.lo;
                const auto area = [&](double by) {
                    const double x = size.x + by, y = size.y + by, z = size.z + by;
                    return x * y + y * z + z * x;
                };
                ++leaves;
                growing += area(2.0 * pad) > much_larger * area(0);
            }
        return 2 * growing > leaves;
    }

    [[nodiscard]] bool holds_each_once() const {
        std::vector<bool> seen(arrays_.stats.input_count);
        bool once = true;
        for (const Node& node : nodes_.view())
            for (const std::uint32_t word : node.child) {
                if (!is_leaf(word)) continue;
                for_each_triangle(blocks_, word, [&](const Block& block, std::uint32_t lane) {
                    once = once && !seen[block.prim[lane]];
                    seen[block.prim[lane]] = true;
                });
            }
        return once;
    }

    const Buffer<Node>& nodes_;
    const Buffer<Block>& blocks_;
    const WideBvh::Arrays& arrays_;
    Corners corner_;
};

}  // namespace

void settle_local_pads(WideBvh::Arrays& arrays) {
    if (arrays.stats.compact) {
        arrays.local_pads =
            LocalPads(arrays.compact_nodes, arrays.compact_blocks, arrays).are_wanted();
        return;
    }
    const LocalPads plain(arrays.nodes, arrays.blocks, arrays);
    arrays.local_pads = plain.are_wanted();
    if (!arrays.local_pads) return;
    const Vec3 median = plain.median();
    arrays.nodes = plain.nodes_about(median);
    arrays.set_bounds(arrays.bounds, median);
}

Buffer<WideNode> nodes_about_center(const WideBvh::Arrays& arrays) {
    return LocalPads(arrays.nodes, arrays.blocks, arrays).nodes_about(center_of(arrays.bounds));
}

}  // namespace raydix
