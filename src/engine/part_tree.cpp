#include "engine/part_tree.h"

#include <algorithm>

#include "exec/parallel.h"
#include "layout/about_middle.h"
#include "layout/wide_collapse.h"
#include "primitives/sources.h"
#include "tree/around_center.h"
#include "tree/median_center.h"

namespace raydix {
namespace {

/// Where a line is as floats have it: their roundings are 2^-24 of its origin and of the way to the
/// part, twice as much with what is to spare.
constexpr double float_rounding = 0x1p-22;

/// Builders leave out boxes beyond the range of coordinates. Extents of meshes at its edge reach
/// less than 2^-21 of it farther: they are built to the edge, and nodes there reach farther again.
Aabb built_box(const Extent& extent) {
    constexpr Vec3 edge{max_coordinate, max_coordinate, max_coordinate};
    return {max_of(extent.box.lo, edge * -1.0f), min_of(extent.box.hi, edge)};
}
/// They leave out boxes smaller than they count too, which points near the center have.
Aabb built_box(const Aabb& box) {
    constexpr Vec3 side{min_diagonal, min_diagonal, min_diagonal};
    return {box.lo - side, box.hi + side};
}
Aabb reach_of(const Aabb& built) {
    constexpr float far = max_coordinate * (1.0f + 0x1p-20f);
    const auto low = [](float x) { return x <= -max_coordinate ? -far : x; };
    const auto high = [](float x) { return x >= max_coordinate ? far : x; };
    return {{low(built.lo.x), low(built.lo.y), low(built.lo.z)},
            {high(built.hi.x), high(built.hi.y), high(built.hi.z)}};
}

std::uint32_t word_of(const BvhNode& child) {
    if (WideTree::is_inner(child)) return child.first;
    return wide_leaf_bit | child.first << 3 | (child.count - 1);
}

void set_node(std::span<const BvhNode> slots, const Vec3& middle, WideNode& node) {
    SlotBoxes boxes;
    std::fill_n(node.child, quantised_width, wide_no_child);
    for (std::size_t s = 0; s < slots.size() && !WideTree::is_unused(slots[s]); ++s) {
        boxes.set(static_cast<int>(s), reach_of({slots[s].lo, slots[s].hi}));
        node.child[s] = word_of(slots[s]);
    }
    set_boxes_about(middle, boxes, node);
}

/// Areas of all children's boxes in those of the root's.
double cost_of(std::span<const double> areas, const Aabb& bounds) {
    double sum = 0;
    for (const double area : areas) sum += area;
    const double root = half_area(bounds);
    return root > 0 ? sum / root : 0.0;
}

double area_of(std::span<const BvhNode> slots) {
    double sum = 0;
    for (const BvhNode& child : slots)
        if (!WideTree::is_unused(child)) sum += half_area({child.lo, child.hi});
    return sum;
}

void set_view(PartTree& out) { out.view = view_of(out.arrays); }

/// `error`: the largest of all parts. Planes about another point than the middle of the bounds are
/// farther from it, which rounds more (docs/algorithms/scenes.md).
void set_growth(double error, PartTree& out) {
    out.growth.rate = std::nextafterf(static_cast<float>(error + float_rounding), infinity);
    const Vec3 off = out.arrays.middle - center_of(out.arrays.bounds);
    out.growth.least = static_cast<float>(float_rounding * (largest_coordinate(out.arrays.bounds) +
                                                            2 * largest_coordinate({off, off})));
}

Extent extent_of_all(std::span<const std::uint32_t> parts, std::span<const Extent> extents) {
    Extent all;
    for (const std::uint32_t part : parts) all = unite(all, extents[part]);
    return all;
}

/// Whether a tree holds these parts, and no others.
bool holds(const PartTree& tree, std::span<const std::uint32_t> parts) {
    if (tree.part.size() != parts.size()) return false;
    std::vector<bool> held(std::size_t{parts.back()} + 1);
    for (const std::uint32_t part : tree.part) {
        if (part > parts.back()) return false;
        held[part] = true;
    }
    return std::ranges::all_of(parts, [&](std::uint32_t part) { return held[part]; });
}

/// The same for all boxes that builders take.
bool holds_all_valid(const PartTree& tree, std::span<const Aabb> boxes) {
    std::vector<std::uint32_t> valid;
    Aabb box;
    for (std::uint32_t k = 0; k < boxes.size(); ++k)
        if (BoxSource{boxes.data()}.box(k, box)) valid.push_back(k);
    return !valid.empty() && holds(tree, valid);
}

/// The children of a node of `old` around where the parts are now; `boxes` [nodes] has those of
/// inner children.
template <class BoxOf>
std::array<BvhNode, quantised_width> slots_of(const PartTree& old, std::size_t w,
                                              const BoxOf& box_of, const std::vector<Aabb>& boxes) {
    std::array<BvhNode, quantised_width> slots;
    for (std::size_t s = 0; s < quantised_width; ++s) {
        const std::uint32_t word = old.arrays.nodes[w].child[s];
        if (word == wide_no_child) {
            const Aabb none = empty_box();
            slots[s] = {none.lo, WideTree::no_child, none.hi, 0};
        } else if ((word & wide_leaf_bit) != 0) {
            const std::uint32_t place = (word & ~wide_leaf_bit) >> 3, count = (word & 7) + 1;
            Aabb box = empty_box();
            for (std::uint32_t k = place; k < place + count; ++k)
                box = unite(box, box_of(old.named(k)));
            slots[s] = {box.lo, place, box.hi, count};
        } else {
            slots[s] = {boxes[word].lo, word, boxes[word].hi, 0};
        }
    }
    return slots;
}

/// Where the levels of a tree begin: its nodes are numbered level by level.
std::vector<std::size_t> levels_of(const PartTree& tree) {
    std::vector<std::size_t> begins{0, 1};
    const std::size_t count = tree.arrays.nodes.size();
    while (begins.back() < count) {
        std::size_t end = begins.back();
        for (std::size_t w = begins[begins.size() - 2]; w < begins.back(); ++w)
            for (const std::uint32_t word : tree.arrays.nodes[w].child)
                if ((word & wide_leaf_bit) == 0) end = std::max<std::size_t>(end, word + 1);
        begins.push_back(end);
    }
    return begins;
}

bool are_same(const Aabb& a, const Aabb& b) { return a.lo == b.lo && a.hi == b.hi; }
bool holds(const Aabb& box, Vec3 p) { return are_same(unite(box, {p, p}), box); }

/// Around the children of a node, and their areas.
struct Around {
    Aabb box = empty_box();
    double area;

    explicit Around(std::span<const BvhNode> slots) : area(area_of(slots)) {
        for (const BvhNode& child : slots) box = unite(box, {child.lo, child.hi});
    }
};

/// box_of(part): where it is now.
template <class BoxOf>
bool refit_nodes(const PartTree& old, const BoxOf& box_of, double limit, PartTree& out) {
    const std::size_t count = old.arrays.nodes.size();
    Aabb bounds = empty_box();
    for (const std::uint32_t part : old.part) bounds = unite(bounds, box_of(part));
    out.arrays.set_bounds(bounds);
    out.arrays.nodes.reset(count);
    std::vector<Aabb> boxes(count);
    std::vector<double> areas(count);
    const std::vector<std::size_t> levels = levels_of(old);
    for (std::size_t level = levels.size() - 1; level-- > 0;) {
        const std::size_t begin = levels[level];
        for_each_index(
            levels[level + 1] - begin,
            [&](std::size_t k) {
                const std::size_t w = begin + k;
                const auto slots = slots_of(old, w, box_of, boxes);
                const Around around(slots);
                boxes[w] = around.box;
                areas[w] = around.area;
                set_node(slots, out.arrays.middle, out.arrays.nodes[w]);
            },
            64);
    }
    const double cost = cost_of(areas, bounds);
    if (!(cost <= limit * old.cost_at_build)) return false;
    out.cost_at_build = old.cost_at_build;
    out.arrays.stats.max_depth = old.arrays.stats.max_depth;
    out.part = old.part;
    out.leaves_name_parts = old.leaves_name_parts;
    out.was_refitted = true;
    set_view(out);
    return true;
}

std::unique_ptr<PartLinks> links_of(const PartTree& tree, std::span<const Extent> extents) {
    const std::size_t count = tree.arrays.nodes.size();
    auto links = std::make_unique<PartLinks>();
    links->node_of.resize(extents.size());
    links->parent.resize(count);
    links->boxes.resize(count);
    links->areas.resize(count);
    const auto box_of = [&](std::uint32_t part) { return extents[part].box; };
    for (std::size_t w = count; w-- > 0;) {  // children have higher numbers
        const auto slots = slots_of(tree, w, box_of, links->boxes);
        const Around around(slots);
        links->boxes[w] = around.box;
        links->areas[w] = around.area;
        for (const BvhNode& child : slots) {
            if (WideTree::is_unused(child)) continue;
            if (WideTree::is_inner(child)) {
                links->parent[child.first] = static_cast<std::uint32_t>(w);
            } else {
                for (std::uint32_t k = child.first; k < child.first + child.count; ++k)
                    links->node_of[tree.named(k)] = static_cast<std::uint32_t>(w);
            }
        }
    }
    links->around = extent_of_all(tree.part, extents);
    return links;
}

/// `middle`: what planes are about, or null for the middle of the bounds.
void make_box_tree(std::span<const Aabb> boxes, BuildOptions build, const WideOptions& leaves,
                   const Vec3* middle, PartTree& out) {
    out.part.clear();
    if (boxes.empty()) return;
    build.max_leaf = 1;  // leaves are made on the way to the wide tree
    const Bvh bvh = build_bvh(boxes, build);
    if (bvh.empty()) return;
    const WideTree wide = collapse_to_wide(bvh, leaves);
    const Aabb bounds = reach_of(bvh.bounds());
    out.arrays.set_bounds(bounds, middle == nullptr ? center_of(bounds) : *middle);
    out.arrays.nodes.reset(wide.node_count());
    std::vector<double> areas(wide.node_count());
    for_each_index(
        wide.node_count(),
        [&](std::size_t w) {
            const auto slots = wide.node(static_cast<std::uint32_t>(w));
            set_node(slots, out.arrays.middle, out.arrays.nodes[w]);
            areas[w] = area_of(slots);
        },
        256);
    out.arrays.stats.max_depth = wide.max_depth;
    out.cost_at_build = cost_of(areas, out.arrays.bounds);
    out.part.assign(bvh.order().begin(), bvh.order().end());
    set_view(out);
}

/// Boxes cannot be split.
BuildOptions build_of_parts(Quality quality) {
    return build_options_for(quality == Quality::fast ? Quality::fast : Quality::balanced);
}
constexpr WideOptions leaves_of_parts{.width = quantised_width, .max_leaf = 1};

}  // namespace

void build_part_tree(std::span<const std::uint32_t> parts, std::span<const Extent> extents,
                     Quality quality, PartTree& out) {
    std::vector<Aabb> boxes(parts.size());
    for (std::size_t k = 0; k < parts.size(); ++k) boxes[k] = built_box(extents[parts[k]]);
    build_box_tree(boxes, build_of_parts(quality), leaves_of_parts, out);
    for (std::uint32_t& part : out.part) part = parts[part];
    if (!parts.empty()) set_growth(extent_of_all(parts, extents).error, out);
}

void build_part_tree(std::span<const ExtentD> extents, Quality quality, PartTreeD& out) {
    build_box_tree(extents, build_of_parts(quality), out);
}

void build_box_tree(std::span<const ExtentD> extents, const BuildOptions& build, PartTreeD& out) {
    out.around = {nothing_d, 0.0};
    for (const ExtentD& extent : extents) {
        if (is_empty(extent)) continue;
        out.around.box = {min_of(out.around.box.lo, extent.box.lo),
                          max_of(out.around.box.hi, extent.box.hi)};
        out.around.error = std::max(out.around.error, extent.error);
    }
    const auto box_at = [&](std::size_t i, AabbD& box) {
        box = extents[i].box;
        return !is_empty(extents[i]);
    };
    const Vec3d center = median_center(extents.size(), box_at, out.around.box);
    out.space = {center, scale_around(center, out.around.box)};
    std::vector<Aabb> boxes(extents.size());
    for_each_index(boxes.size(), [&](std::size_t i) {
        AabbD box;
        boxes[i] =
            box_at(i, box)
                ? built_box(grown_planes(box_around_center(box, out.space.center, out.space.scale)))
                : empty_box();
    });
    PartTree tree;
    const Vec3 middle{};
    make_box_tree(boxes, build, leaves_of_parts, &middle, tree);
    out.arrays = std::move(tree.arrays);
    out.part = std::move(tree.part);
    out.set_view();
}

void build_box_tree(std::span<const Aabb> boxes, BuildOptions build, const WideOptions& leaves,
                    PartTree& out) {
    make_box_tree(boxes, build, leaves, nullptr, out);
}

void name_parts_in_leaves(PartTree& tree) {
    for_each_index(
        tree.arrays.nodes.size(),
        [&](std::size_t w) {
            for (std::uint32_t& word : tree.arrays.nodes[w].child)
                if (word != wide_no_child && (word & wide_leaf_bit) != 0)
                    word = wide_leaf_bit | tree.part[(word & ~wide_leaf_bit) >> 3] << 3;
        },
        256);
    tree.leaves_name_parts = true;
}

bool refit_part_tree(const PartTree& old, std::span<const std::uint32_t> parts,
                     std::span<const Extent> extents, double limit, PartTree& out) {
    if (parts.empty() || !holds(old, parts)) return false;
    const auto box_of = [&](std::uint32_t part) { return extents[part].box; };
    if (!refit_nodes(old, box_of, limit, out)) return false;
    set_growth(extent_of_all(parts, extents).error, out);
    return true;
}

PartMoves::PartMoves(std::span<MovedPart> moved, std::span<Extent> extents, PartTree& tree)
    : moved_(moved), extents_(extents), tree_(tree) {
    if (moved.empty()) return;
    if (tree.links == nullptr) tree.links = links_of(tree, extents);
    waiting_.reserve(moved.size());
    nodes_.reserve(std::min(tree.arrays.nodes.size(),
                            moved.size() * (std::size_t{tree.arrays.stats.max_depth} + 1)));
    for (const MovedPart& m : moved) waiting_.push_back(tree.links->node_of[m.part]);
    std::ranges::make_heap(waiting_);
}

bool PartMoves::plan(double limit) noexcept {
    if (moved_.empty()) return true;
    const PartLinks& links = *tree_.links;
    around_ = links.around;
    bool less = false;
    for (const MovedPart& m : moved_) {
        less = less || may_shrink(links.around, extents_[m.part], m.extent);
        around_ = unite(around_, m.extent);
    }
    exchange_extents();
    if (less) around_ = extent_of_all(tree_.part, extents_);
    refit();
    const bool good = holds(around_.box, tree_.arrays.middle) &&
                      cost_of(links.areas, around_.box) <= limit * tree_.cost_at_build;
    exchange_nodes();
    exchange_extents();
    return good;
}

void PartMoves::apply() noexcept {
    if (moved_.empty()) return;
    exchange_extents();
    exchange_nodes();
    if (!are_same(around_.box, tree_.links->around.box)) {
        tree_.arrays.set_bounds(around_.box, tree_.arrays.middle);
        set_view(tree_);
    }
    set_growth(around_.error, tree_);
    tree_.links->around = around_;
}

/// Takes no memory: for each node that is taken out at most its parent comes in.
void PartMoves::refit() noexcept {
    PartLinks& links = *tree_.links;
    const auto box_of = [&](std::uint32_t part) { return extents_[part].box; };
    while (!waiting_.empty()) {
        const std::uint32_t w = take_last();
        const auto slots = slots_of(tree_, w, box_of, links.boxes);
        const Around around(slots);
        nodes_.push_back({w, links.boxes[w], links.areas[w], tree_.arrays.nodes[w]});
        set_node(slots, tree_.arrays.middle, tree_.arrays.nodes[w]);
        links.areas[w] = around.area;
        if (w != 0 && !are_same(around.box, links.boxes[w])) {
            waiting_.push_back(links.parent[w]);
            std::ranges::push_heap(waiting_);
        }
        links.boxes[w] = around.box;
    }
}

/// The deepest that waits, once.
std::uint32_t PartMoves::take_last() noexcept {
    const std::uint32_t w = waiting_.front();
    while (!waiting_.empty() && waiting_.front() == w) {
        std::ranges::pop_heap(waiting_);
        waiting_.pop_back();
    }
    return w;
}

void PartMoves::exchange_extents() noexcept {
    for (MovedPart& m : moved_) std::swap(m.extent, extents_[m.part]);
}

void PartMoves::exchange_nodes() noexcept {
    PartLinks& links = *tree_.links;
    for (Node& node : nodes_) {
        std::swap(node.box, links.boxes[node.number]);
        std::swap(node.area, links.areas[node.number]);
        std::swap(node.node, tree_.arrays.nodes[node.number]);
    }
}

bool refit_box_tree(const PartTree& old, std::span<const Aabb> boxes, double limit, PartTree& out) {
    if (old.empty() || !holds_all_valid(old, boxes)) return false;
    return refit_nodes(
        old, [&](std::uint32_t k) { return boxes[k]; }, limit, out);
}

}  // namespace raydix
