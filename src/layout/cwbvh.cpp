#include "layout/cwbvh.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <span>
#include <vector>

#include "base/math.h"
#include "exec/parallel.h"

namespace raydix {
namespace {

constexpr int min_exponent = 1, max_exponent = 254;  // of normal floats
constexpr int max_steps = 255;

float coordinate(Vec3 v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

double step_of(int exponent) { return std::ldexp(1.0, exponent - 127); }

/// b - a without rounding: `value` is the nearest double, `rest` what it lacks (Knuth's two-sum;
/// two floats can be 2^149 apart in size).
struct ExactDifference {
    double value, rest;
    ExactDifference(double a, double b) : value(b - a) {
        const double b_part = value + a, a_part = b_part - value;
        rest = (b - b_part) - (a - a_part);
    }
    /// Whether the difference is at least / at most x. x and `value` are doubles, hence the rest
    /// matters only if they are equal.
    [[nodiscard]] bool at_least(double x) const { return value > x || (value == x && rest >= 0); }
    [[nodiscard]] bool at_most(double x) const { return value < x || (value == x && rest <= 0); }
};

}  // namespace

int step_exponent(float lo, float hi) {
    const ExactDifference extent(lo, hi);
    if (extent.at_most(0.0)) return min_exponent;
    int exponent;
    std::frexp(extent.value / max_steps, &exponent);  // at most 2^exponent
    int biased = std::clamp(exponent - 2 + 127, min_exponent, max_exponent);
    while (!extent.at_most(max_steps * step_of(biased))) ++biased;
    return biased;
}

int steps_below(float origin, int exponent, float at) {
    const ExactDifference distance(origin, at);
    const double step = step_of(exponent);
    int q = static_cast<int>(std::clamp(distance.value / step, 0.0, double(max_steps)));
    while (q < max_steps && distance.at_least((q + 1) * step)) ++q;
    while (q > 0 && !distance.at_least(q * step)) --q;
    return q;
}

int steps_above(float origin, int exponent, float at) {
    const ExactDifference distance(origin, at);
    const double step = step_of(exponent);
    int q = static_cast<int>(std::clamp(distance.value / step, 0.0, double(max_steps)));
    while (q > 0 && distance.at_most((q - 1) * step)) --q;
    while (q < max_steps && !distance.at_most(q * step)) ++q;
    return q;
}

bool contains_exactly(const CwbvhNode& node, int slot, const Aabb& box) {
    bool inside = true;
    for (int axis = 0; axis < 3; ++axis) {
        const double step = step_of(node.exponent[axis]);
        inside = inside &&
                 ExactDifference(node.origin[axis], coordinate(box.lo, axis))
                     .at_least(node.lo[axis][slot] * step) &&
                 ExactDifference(node.origin[axis], coordinate(box.hi, axis))
                     .at_most(node.hi[axis][slot] * step);
    }
    return inside;
}

void assign_octant_slots(std::span<const Aabb> children, int* slots) {
    const int count = static_cast<int>(children.size());
    Aabb all = empty_box();
    for (const Aabb& box : children) all = unite(all, box);
    const Vec3 middle = center_of(all);
    std::array<std::array<float, cwbvh_width>, cwbvh_width> gain{};
    for (int k = 0; k < count; ++k) {
        const Vec3 d = center_of(children[static_cast<std::size_t>(k)]) - middle;
        for (int s = 0; s < cwbvh_width; ++s)
            gain[static_cast<std::size_t>(k)][static_cast<std::size_t>(s)] =
                ((s & 1 ? d.x : -d.x) + (s & 2 ? d.y : -d.y)) + (s & 4 ? d.z : -d.z);
    }
    // best[set]: the largest sum with the first |set| children in the slots of `set`.
    constexpr std::size_t sets = 1 << cwbvh_width;
    std::array<float, sets> best;
    std::array<std::uint8_t, sets> last{};  // the slot of the last of them
    best.fill(-infinity);
    best[0] = 0.0f;
    std::size_t best_set = 0;
    for (std::size_t set = 1; set < sets; ++set) {
        const int placed = std::popcount(set);
        if (placed > count) continue;
        for (std::size_t s = 0; s < cwbvh_width; ++s) {
            if ((set >> s & 1) == 0) continue;
            const float sum =
                best[set ^ std::size_t{1} << s] + gain[static_cast<std::size_t>(placed - 1)][s];
            if (sum > best[set] || best[set] == -infinity) {
                best[set] = sum;
                last[set] = static_cast<std::uint8_t>(s);
            }
        }
        if (placed == count && (std::popcount(best_set) != count || best[set] > best[best_set]))
            best_set = set;
    }
    for (int k = count - 1; k >= 0; --k) {
        slots[k] = last[best_set];
        best_set ^= std::size_t{1} << slots[k];
    }
}

namespace {

Aabb box_of(const BvhNode& node) { return {node.lo, node.hi}; }

std::size_t used_children(std::span<const BvhNode> children) {
    std::size_t count = 0;
    while (count < children.size() && !WideTree::is_unused(children[count])) ++count;
    return count;
}

/// The children of a wide node by slot; null where there is none.
using Slots = std::array<const BvhNode*, cwbvh_width>;

Slots children_by_slot(std::span<const BvhNode> children) {
    std::array<Aabb, cwbvh_width> boxes;
    std::array<int, cwbvh_width> places{};
    const std::size_t count = used_children(children);
    for (std::size_t k = 0; k < count; ++k) boxes[k] = box_of(children[k]);
    assign_octant_slots(std::span(boxes).first(count), places.data());
    Slots slots{};
    for (std::size_t k = 0; k < count; ++k)
        slots[static_cast<std::size_t>(places[k])] = &children[k];
    return slots;
}

/// Frame of the quantised boxes: from the lowest corner, steps that reach the highest.
void set_frame(const Slots& slots, CwbvhNode& node) {
    Aabb box = empty_box();
    for (const BvhNode* child : slots)
        if (child != nullptr) box = unite(box, box_of(*child));
    for (int axis = 0; axis < 3; ++axis) {
        node.origin[axis] = coordinate(box.lo, axis);
        node.exponent[axis] =
            static_cast<std::uint8_t>(step_exponent(node.origin[axis], coordinate(box.hi, axis)));
    }
}

void set_box(const Aabb& box, int slot, CwbvhNode& node) {
    for (int axis = 0; axis < 3; ++axis) {
        const int exponent = node.exponent[axis];
        node.lo[axis][slot] = static_cast<std::uint8_t>(
            steps_below(node.origin[axis], exponent, coordinate(box.lo, axis)));
        node.hi[axis][slot] = static_cast<std::uint8_t>(
            steps_above(node.origin[axis], exponent, coordinate(box.hi, axis)));
    }
}

/// What a ray can never miss by rounding is what contains_exactly said yes to: coarser steps until
/// it does.
void quantise(const Slots& slots, CwbvhNode& node) {
    set_frame(slots, node);
    for (;;) {
        bool contained = true;
        for (int s = 0; s < cwbvh_width; ++s) {
            const BvhNode* child = slots[static_cast<std::size_t>(s)];
            if (child == nullptr) {  // an inverted box; meta says that it is none
                for (int axis = 0; axis < 3; ++axis)
                    node.lo[axis][s] = max_steps, node.hi[axis][s] = 0;
                continue;
            }
            set_box(box_of(*child), s, node);
            contained = contained && contains_exactly(node, s, box_of(*child));
        }
        if (contained) return;
        for (std::uint8_t& exponent : node.exponent)
            exponent = static_cast<std::uint8_t>(std::min(exponent + 1, max_exponent));
    }
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
        quantise(order_[w], node);
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
    std::vector<Slots> order_;          // [wide nodes]
};

}  // namespace

void compress_wide_tree(const WideTree& wide, const Bvh& bvh, Cwbvh::Arrays& out) {
    Compression(wide, bvh, out).run();
}

}  // namespace raydix
