#include "layout/wide_refit.h"

#include <algorithm>
#include <array>
#include <bit>
#include <mutex>
#include <optional>
#include <span>
#include <utility>

#include "base/float4.h"
#include "base/prefetch.h"
#include "base/x86_intrinsics.h"
#include "exec/large_pages.h"
#include "exec/parallel.h"
#include "layout/about_middle.h"
#include "layout/child_words.h"
#include "layout/leaf_order.h"
#include "layout/local_pads.h"
#include "primitives/bounds.h"
#include "primitives/sources.h"
#include "primitives/zero_area.h"

namespace raydix {
namespace {

using namespace child_words;

/// What SAH is made of: half areas of nodes, and of leaves times their triangles by slot.
struct Areas {
    double nodes = 0;
    std::array<double, quantised_width> leaves{};
};

/// The exact boxes of a node's slots -> the box around them, and planes about the middle.
[[gnu::always_inline]] inline Aabb fit_node(Vec3 middle, WideNode& node, Areas& areas) {
    constexpr std::size_t width = quantised_width;
    SlotBoxes boxes;
    std::array<float, 6> all;
    for (int axis = 0; axis < 3; ++axis) {
        std::array<float, width> lo, hi;
        for (std::size_t s = 0; s < width; ++s) {
            lo[s] = boxes.lo[axis][s] = node.lo[axis][s];
            hi[s] = boxes.hi[axis][s] = node.hi[axis][s];
        }
        for (std::size_t half = width / 2; half > 0; half /= 2)
            for (std::size_t s = 0; s < half; ++s) {
                lo[s] = lo[s] < lo[s + half] ? lo[s] : lo[s + half];
                hi[s] = hi[s] > hi[s + half] ? hi[s] : hi[s + half];
            }
        all[static_cast<std::size_t>(axis)] = lo[0];
        all[static_cast<std::size_t>(axis) + 3] = hi[0];
    }
    for (std::size_t s = 0; s < width; ++s) {
        const std::uint32_t word = node.child[s];
        const double x = double(boxes.hi[0][s]) - boxes.lo[0][s],
                     y = double(boxes.hi[1][s]) - boxes.lo[1][s],
                     z = double(boxes.hi[2][s]) - boxes.lo[2][s];
        const double area = (x * y + y * z + z * x) * static_cast<std::int32_t>(leaf_size(word));
        areas.leaves[s] += is_leaf(word) ? area : 0.0;
        boxes.used |= (word != wide_no_child ? 1u : 0u) << s;
    }
    set_boxes_about(middle, boxes, node);
    const Aabb box{{all[0], all[1], all[2]}, {all[3], all[4], all[5]}};
    areas.nodes += half_area(box);
    return box;
}
using FitNode = Aabb (*)(Vec3 middle, WideNode& node, Areas& areas);

Aabb fit_node_plainly(Vec3 middle, WideNode& node, Areas& areas) {
    return fit_node(middle, node, areas);
}
#if defined(RAYDIX_X86_INTRINSICS)
__attribute__((target("avx2"))) Aabb fit_node_avx2(Vec3 middle, WideNode& node, Areas& areas) {
    return fit_node(middle, node, areas);
}
FitNode best_fit_node() {
    return __builtin_cpu_supports("avx2") ? fit_node_avx2 : fit_node_plainly;
}
#else
FitNode best_fit_node() { return fit_node_plainly; }
#endif

/// One corner of four triangles.
struct Corners4 {
    Float4 x, y, z;

    static Corners4 load(const TriangleSource& source, const std::uint32_t* prims, std::size_t v) {
        const auto at = [&](std::size_t lane) {
            return Float4::load(source.vertices[source.triangles[prims[lane]][v]]);
        };
        Float4 a = at(0), b = at(1), c = at(2), d = at(3);
        transpose(a, b, c, d);
        const Float4 zero = Float4::all(0.0f);  // without -0
        return {a + zero, b + zero, c + zero};
    }
    void store(TriangleBlock& block, std::size_t v, Mask4 used) const {
        const Float4 zero = Float4::all(0.0f);
        select(used, x, zero).store(block.corner[3 * v]);
        select(used, y, zero).store(block.corner[3 * v + 1]);
        select(used, z, zero).store(block.corner[3 * v + 2]);
    }
};
Corners4 operator-(const Corners4& a, const Corners4& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
Corners4 min_of(const Corners4& a, const Corners4& b) {
    return {min_of(a.x, b.x), min_of(a.y, b.y), min_of(a.z, b.z)};
}
Corners4 max_of(const Corners4& a, const Corners4& b) {
    return {max_of(a.x, b.x), max_of(a.y, b.y), max_of(a.z, b.z)};
}

/// Bit k: triangle k has an area and counts by its size, for sure. A component of the cross product
/// of two edges is larger than what floats may have lost of it, and than 2 d^2 of a box whose
/// longest side d is the least that counts.
unsigned surely_large(const Corners4& a, const Corners4& b, const Corners4& c) {
    constexpr float least = 0x1p-78f;
    static_assert(least > 2.1 * min_diagonal * min_diagonal);
    const Corners4 p = b - a, q = c - a;
    const auto large = [](Float4 left, Float4 right) {
        const Float4 lost = (absolute(left) + absolute(right)) * Float4::all(0x1p-20f);
        return lost + Float4::all(least) <= absolute(left - right);
    };
    return bits_of(large(p.y * q.z, p.z * q.y) | large(p.z * q.x, p.x * q.z) |
                   large(p.x * q.y, p.y * q.x));
}

/// [bits]: lane k is used where bit k is set.
constexpr auto lanes_of_bits = [] {
    std::array<std::array<std::uint32_t, block_lanes>, 16> lanes{};
    for (std::size_t bits = 0; bits < lanes.size(); ++bits)
        for (std::size_t lane = 0; lane < block_lanes; ++lane)
            lanes[bits][lane] = (bits >> lane & 1) != 0 ? ~0u : 0u;
    return lanes;
}();

/// The box around all vertices; none if one is not finite or out of range.
std::optional<Aabb> box_of_vertices(std::span<const Vec3> vertices) {
    Aabb all = empty_box();
    bool good = true;
    std::mutex merging;
    for_each_range(vertices.size(), 32768, [&](std::size_t begin, std::size_t end) {
        const Float4 zero = Float4::all(0.0f), most = Float4::all(max_coordinate);
        Float4 lo = Float4::all(infinity), hi = Float4::all(-infinity);
        unsigned inside = 15;
        for (std::size_t i = begin; i < end; ++i) {
            const Float4 at = Float4::load(vertices[i]) + zero;
            inside &= bits_of(absolute(at) <= most);
            lo = min_of(lo, at);
            hi = max_of(hi, at);
        }
        float l[4], h[4];
        lo.store(l), hi.store(h);
        const std::scoped_lock lock(merging);
        good = good && inside == 15;
        all = unite(all, {{l[0], l[1], l[2]}, {h[0], h[1], h[2]}});
    });
    if (!good) return {};
    return all;
}

bool same(Vec3 a, Vec3 b) { return a.x == b.x && a.y == b.y && a.z == b.z; }

}  // namespace

/// One refit.
class WideRefit {
public:
    WideRefit(WideRefitter& with, const MeshView& mesh, WideBvh::Arrays& out)
        : with_(with),
          mesh_(mesh),
          source_{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()},
          out_(out),
          more_areas_(with.runs() < few_areas_.size() ? 0 : with.runs() + 1),
          areas_(more_areas_.empty() ? std::span(few_areas_).first(with.runs() + 1)
                                     : std::span(more_areas_)) {}
    WideRefit(const WideRefit&) = delete;
    WideRefit& operator=(const WideRefit&) = delete;

    /// False where the tree cannot be kept.
    bool run() {
        if (!look_at_others()) return false;
        // Planes of nodes are about the middle of all triangles, whose box the nodes tell last. It
        // is that of the vertices unless some belong to no triangle.
        std::optional<Aabb> guess;
        if (!with_.has_loose_vertices_) guess = box_of_vertices(mesh_.vertices);
        checks_range_ = !guess;
        if (!guess) guess = scene_bounds(source_, triangles()).box;
        if (!fit(center_of(*guess))) return false;
        const Aabb bounds = unite(root_, others_);
        if (!same(center_of(bounds), center_of(*guess))) {
            with_.has_loose_vertices_ = true;
            fit(center_of(bounds));
        }
        out_.set_bounds(bounds);
        settle_local_pads(out_);
        out_.stats.left_out = left_out_;
        out_.stats.sah = sah(half_area(bounds));
        return true;
    }

private:
    [[nodiscard]] std::uint32_t triangles() const {
        return static_cast<std::uint32_t>(mesh_.triangles.size());
    }

    /// Triangles that are not in the tree: as they could not be hit then, so now. Those that only
    /// lack an area count for the bounds, as in a new tree.
    bool look_at_others() {
        const std::vector<std::uint32_t>& others = with_.others_;
        bool good = true;
        std::mutex merging;
        for_each_range(others.size(), 4096, [&](std::size_t begin, std::size_t end) {
            Aabb around = empty_box();
            std::uint64_t invalid = 0;
            bool stay = true;
            for (std::size_t k = begin; k < end; ++k) {
                Aabb box;
                if (!source_.box(others[k], box)) {
                    ++invalid;
                } else {
                    around = unite(around, box);
                    stay = stay && has_zero_area(source_.corners(others[k]));
                }
            }
            const std::scoped_lock lock(merging);
            others_ = unite(others_, around);
            left_out_ += invalid;
            good = good && stay;
        });
        return good;
    }

    /// Corners, boxes and areas. False if a triangle cannot stay where it is.
    bool fit(Vec3 middle) {
        middle_ = middle;
        std::atomic<bool> good = true;
        const std::vector<std::size_t>& first = with_.first_;
        for_each_range(first.front(), 256, [&](std::size_t begin, std::size_t end) {
            if (!fit_blocks(begin, end)) good = false;
        });
        for_each_range(with_.runs(), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t run = begin; run < end && good; ++run)
                if (fit_blocks(first[run], first[run + 1]))
                    fit_run(run);
                else
                    good = false;
        });
        if (!good) return false;
        areas_.back() = {};
        for (const std::uint32_t w : with_.above_) place(w, areas_.back());
        return true;
    }

    void fit_run(std::size_t run) {
        const std::size_t begin = run * WideRefitter::nodes_of_a_run;
        std::size_t w = std::min(begin + WideRefitter::nodes_of_a_run, with_.parent_.size());
        areas_[run] = {};
        while (w-- > begin)
            if (with_.waits_[w] == 0) place(static_cast<std::uint32_t>(w), areas_[run]);
    }

    /// Fits a node whose slots all have their boxes, and tells its parent.
    void place(std::uint32_t w, Areas& areas) {
        const Aabb box = fit_node_(middle_, out_.nodes[w], areas);
        const std::uint32_t parent = with_.parent_[w];
        if (parent == WideRefitter::no_slot)
            root_ = box;
        else
            set_slot(parent, box);
    }
    void set_slot(std::uint32_t slot, const Aabb& box) {
        WideNode& node = out_.nodes[slot / quantised_width];
        const std::uint32_t s = slot % quantised_width;
        node.lo[0][s] = box.lo.x, node.lo[1][s] = box.lo.y, node.lo[2][s] = box.lo.z;
        node.hi[0][s] = box.hi.x, node.hi[1][s] = box.hi.y, node.hi[2][s] = box.hi.z;
    }

    bool fit_blocks(std::size_t begin, std::size_t end) {
        bool good = true;
        for (std::size_t k = begin; k < end; ++k) {
            prefetch(k, end);
            good = fit_block(with_.leaves_[k]) && good;
        }
        return good;
    }
    RAYDIX_PREFETCHING void prefetch(std::size_t k, std::size_t end) const {
        constexpr std::size_t indices_ahead = 8, corners_ahead = 4;
        if (k + indices_ahead >= end) return;
        for (std::size_t lane = 0; lane < block_lanes; ++lane) {
            prefetch_indices(source_, with_.leaves_[k + indices_ahead].prim[lane]);
            prefetch_corners(source_, with_.leaves_[k + corners_ahead].prim[lane]);
        }
    }

    /// Corners of a block, and boxes of its leaves into their slots.
    bool fit_block(const WideRefitter::LeafBlock& leaf) {
        const Corners4 a = Corners4::load(source_, leaf.prim, 0),
                       b = Corners4::load(source_, leaf.prim, 1),
                       c = Corners4::load(source_, leaf.prim, 2);
        unsigned used = 0;
        for (std::size_t lane = 0; lane < block_lanes; ++lane)
            used |= (leaf.slot[lane] != WideRefitter::no_slot ? 1u : 0u) << lane;
        const Mask4 mask = Mask4::load(lanes_of_bits[used].data());
        TriangleBlock& block = out_.blocks[leaf.block];
        a.store(block, 0, mask);
        b.store(block, 1, mask);
        c.store(block, 2, mask);
        set_leaves(leaf, min_of(min_of(a, b), c), max_of(max_of(a, b), c));
        const unsigned unsure = used & ~(checks_range_ ? 0u : surely_large(a, b, c));
        return unsure == 0 || can_stay(leaf, unsure);
    }
    void set_leaves(const WideRefitter::LeafBlock& leaf, const Corners4& lo, const Corners4& hi) {
        std::array<Float4, block_lanes> l{lo.x, lo.y, lo.z, lo.z}, h{hi.x, hi.y, hi.z, hi.z};
        transpose(l[0], l[1], l[2], l[3]);
        transpose(h[0], h[1], h[2], h[3]);
        for (std::size_t lane = 0; lane < block_lanes;) {
            const std::uint32_t slot = leaf.slot[lane];
            Float4 low = l[lane], high = h[lane];
            while (++lane < block_lanes && leaf.slot[lane] == slot)
                low = min_of(low, l[lane]), high = max_of(high, h[lane]);
            if (slot == WideRefitter::no_slot) continue;
            float from[4], to[4];
            low.store(from), high.store(to);
            set_slot(slot, {{from[0], from[1], from[2]}, {to[0], to[1], to[2]}});
        }
    }
    /// Whether the triangles of these lanes are valid and have an area.
    bool can_stay(const WideRefitter::LeafBlock& leaf, unsigned lanes) const {
        for (; lanes != 0; lanes &= lanes - 1) {
            const std::uint32_t prim = leaf.prim[std::countr_zero(lanes)];
            Aabb box;
            if (!source_.box(prim, box) || has_zero_area(source_.corners(prim))) return false;
        }
        return true;
    }

    /// Sums run by run, so that they do not depend on threads.
    [[nodiscard]] double sah(double root) const {
        double nodes = 0, leaves = 0;
        for (const Areas& areas : areas_) {
            nodes += areas.nodes;
            for (const double area : areas.leaves) leaves += area;
        }
        return root > 0 ? (nodes + wide_primitive_cost * leaves) / root : 0;
    }

    WideRefitter& with_;
    const MeshView mesh_;
    const TriangleSource source_;
    WideBvh::Arrays& out_;
    const FitNode fit_node_ = best_fit_node();
    // There may be many small trees: these take no memory of their own.
    std::array<Areas, 2> few_areas_;
    std::vector<Areas> more_areas_;
    const std::span<Areas> areas_;  // [runs + 1], the last one of the nodes above
    Aabb root_ = empty_box(), others_ = empty_box();
    std::uint64_t left_out_ = 0;
    bool checks_range_ = false;
    Vec3 middle_{};
};

std::shared_ptr<WideRefitter> WideRefitter::of(const WideBvh& tree) {
    if (tree.empty() || tree.stats().compact) return nullptr;
    const WideBvh::Arrays& arrays = tree.arrays();
    auto made = std::make_shared<WideRefitter>();
    if (!made->look_at_nodes(arrays) || !made->look_at_leaves(arrays)) return nullptr;
    return made;
}

bool WideRefitter::look_at_nodes(const WideBvh::Arrays& tree) {
    const std::size_t count = tree.nodes.size();
    parent_.assign(count, no_slot);
    waits_.assign(count, 0);
    for (std::size_t w = count; w-- > 0;) {
        for (std::size_t s = 0; s < quantised_width; ++s) {
            const std::uint32_t word = tree.nodes[w].child[s];
            if (!is_inner(word)) continue;
            if (word <= w) return false;  // children come after their parents
            parent_[word] = static_cast<std::uint32_t>(w * quantised_width + s);
            if (waits_[word] != 0 || word / nodes_of_a_run != w / nodes_of_a_run) waits_[w] = 1;
        }
        if (waits_[w] != 0) above_.push_back(static_cast<std::uint32_t>(w));
    }
    return true;
}

bool WideRefitter::look_at_leaves(const WideBvh::Arrays& tree) {
    std::vector<bool> in_tree(tree.stats.input_count);
    std::vector<LeafBlock> blocks(tree.blocks.size());
    for (LeafBlock& leaf : blocks) std::fill_n(leaf.slot, block_lanes, no_slot);
    for (std::size_t w = 0; w < tree.nodes.size(); ++w)
        for (std::size_t s = 0; s < quantised_width; ++s) {
            const std::uint32_t word = tree.nodes[w].child[s];
            if (!is_leaf(word)) continue;
            const std::uint32_t place = first_place(word);
            for (std::uint32_t p = place; p < place + leaf_size(word); ++p) {
                const std::uint32_t b = p / block_lanes, lane = p % block_lanes;
                const std::uint32_t prim = tree.blocks[b].prim[lane];
                // A part of a triangle is not the only one.
                if (prim >= in_tree.size() || in_tree[prim]) return false;
                in_tree[prim] = true;
                blocks[b].slot[lane] = static_cast<std::uint32_t>(w * quantised_width + s);
            }
        }
    for (std::size_t i = 0; i < in_tree.size(); ++i)
        if (!in_tree[i]) others_.push_back(static_cast<std::uint32_t>(i));
    leaves_ = std::move(blocks);
    put_blocks_in_runs(tree);
    return true;
}

void WideRefitter::put_blocks_in_runs(const WideBvh::Arrays& tree) {
    constexpr std::uint32_t slots_of_a_run = nodes_of_a_run * quantised_width;
    const std::size_t count = runs();
    // 0: of several runs; then those of each run; then those without a leaf.
    std::vector<std::size_t> group(leaves_.size(), count + 1), size(count + 2, 0);
    for (std::size_t b = 0; b < leaves_.size(); ++b) {
        LeafBlock& leaf = leaves_[b];
        leaf.block = static_cast<std::uint32_t>(b);
        std::size_t used = block_lanes;
        for (std::size_t lane = block_lanes; lane-- > 0;) {
            if (leaf.slot[lane] == no_slot) continue;
            const std::size_t own = leaf.slot[lane] / slots_of_a_run + 1;
            group[b] = used == block_lanes || group[b] == own ? own : 0;
            used = lane;
        }
        for (std::size_t lane = 0; lane < block_lanes && used < block_lanes; ++lane)
            leaf.prim[lane] = tree.blocks[b].prim[leaf.slot[lane] == no_slot ? used : lane];
        ++size[group[b]];
    }
    std::vector<std::size_t> next(count + 2, 0);
    for (std::size_t g = 0; g <= count; ++g) next[g + 1] = next[g] + size[g];
    first_.assign(next.begin() + 1, next.end());
    std::vector<LeafBlock> sorted(leaves_.size());
    for (std::size_t b = 0; b < leaves_.size(); ++b) sorted[next[group[b]]++] = leaves_[b];
    sorted.resize(first_.back());
    leaves_ = std::move(sorted);
}

namespace {

template <class T>
void copy(const Buffer<T>& from, Buffer<T>& to) {
    to.reset(from.size());
    prefer_large_pages(to);
    for_each_range(from.size(), 4096, [&](std::size_t begin, std::size_t end) {
        std::copy(from.data() + begin, from.data() + end, to.data() + begin);
    });
}

}  // namespace

std::shared_ptr<const WideBvh> WideRefitter::refit(const WideBvh& tree, const MeshView& mesh) {
    const WideBvh::Arrays& from = tree.arrays();
    if (from.stats.input_count != mesh.triangles.size()) return nullptr;
    std::unique_ptr<WideBvh> made = memory_.take();
    if (made == nullptr) {
        made = std::make_unique<WideBvh>();
        WideBvh::Arrays& room = WideBvhInternals::arrays_of(*made);
        copy(from.nodes, room.nodes);
        copy(from.blocks, room.blocks);
    }
    WideBvh::Arrays& out = WideBvhInternals::arrays_of(*made);
    out.stats = from.stats;
    if (WideRefit(*this, mesh, out).run()) return memory_.share(std::move(made));
    memory_.give(std::move(made));
    return nullptr;
}

}  // namespace raydix
