#include "engine/wide_tree_double.h"

#include <raydix/wide.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "exec/large_pages.h"
#include "exec/parallel.h"
#include "layout/about_middle.h"
#include "layout/wide_emit.h"
#include "primitives/double_sources.h"
#include "tree/around_center.h"
#include "tree/median_center.h"

namespace raydix {
namespace {

/// A BvhD as the collapse to wide nodes sees it. Blocks that it makes name positions in the tree's
/// order; their corners are not those of the triangles.
class AroundCenterView : public BinaryView {
public:
    AroundCenterView(const BvhD& bvh, const std::vector<std::uint8_t>& flat)
        : BinaryView(bvh.tree(), wide_max_leaf), flat_(flat) {}

    [[nodiscard]] Aabb box(Ref ref) const { return grown_planes(BinaryView::box(ref)); }
    [[nodiscard]] Vec3 middle() const { return {}; }
    [[nodiscard]] bool is_flat(std::uint32_t position) const { return flat_[position] != 0; }
    [[nodiscard]] std::uint32_t id(std::uint32_t position) const { return position; }
    [[nodiscard]] LeafTriangle triangle(std::uint32_t) const { return {}; }
    void prefetch_corners(std::uint32_t) const {}

private:
    const std::vector<std::uint8_t>& flat_;  // [references]
};

/// Whether no bound lies much farther from the center than most triangles do: packets widen all
/// boxes by what rays round at the farthest.
bool is_compact_place(const MeshViewD& mesh, const NodesD& tree) {
    constexpr std::size_t wanted = 1024;
    constexpr double most = 16;
    const TriangleSourceD source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    const auto largest = [](double x, double y, double z) {
        return std::max({std::fabs(x), std::fabs(y), std::fabs(z)});
    };
    const std::size_t n = mesh.triangles.size();
    std::vector<double> far;
    for (std::size_t k = 0; k < std::min(n, wanted); ++k) {
        AabbD box;
        if (!source.box(static_cast<std::uint32_t>(k * n / std::min(n, wanted)), box)) continue;
        const Vec3d at = tree.space.local(0.5 * box.lo + 0.5 * box.hi);
        far.push_back(largest(at.x, at.y, at.z));
    }
    if (far.empty()) return true;
    const auto at = far.begin() + static_cast<std::ptrdiff_t>(far.size() * 9 / 10);
    std::nth_element(far.begin(), at, far.end());
    const double reach = std::max(largest(tree.lo[0], tree.lo[1], tree.lo[2]),
                                  largest(tree.hi[0], tree.hi[1], tree.hi[2]));
    return reach <= most * std::max(*at, tree.size / 64);
}

bool is_leaf(std::uint32_t word) { return word != wide_no_child && (word & wide_leaf_bit) != 0; }
bool is_inner(std::uint32_t word) { return word != wide_no_child && (word & wide_leaf_bit) == 0; }

/// As WideRefit in float (layout/wide_refit.cpp).
class RefitD {
public:
    RefitD(const WideTreeD& from, const MeshViewD& mesh)
        : from_(from),
          mesh_(mesh),
          source_{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()},
          boxes_(from.arrays.nodes.size()),
          around_(from.arrays.nodes.size(), empty_box()),
          leaf_area_(from.arrays.nodes.size()),
          in_tree_(mesh.triangles.size()) {}

    std::shared_ptr<const WideTreeD> run() {
        auto made = std::make_shared<WideTreeD>();
        WideTreeD& out = *made;
        if (!place(out)) return {};
        out.arrays.nodes.reset(from_.arrays.nodes.size());
        out.blocks.reset(from_.blocks.size());
        prefer_large_pages(out.arrays.nodes);
        prefer_large_pages(out.blocks);
        std::copy_n(from_.blocks.data(), from_.blocks.size(), out.blocks.data());
        if (!fill_leaves(out) || !others_stay_out()) return {};
        fill_inner();
        finish(out);
        return made;
    }

private:
    static constexpr std::size_t grain = 512;

    /// Bounds and center of where the triangles are now.
    bool place(WideTreeD& out) {
        const std::size_t n = mesh_.triangles.size();
        out.input_count = n;
        AabbD bounds{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
        std::uint64_t left_out = 0;
        for (std::uint32_t i = 0; i < n; ++i) {
            AabbD box;
            if (!source_.readable(i)) return false;
            if (!source_.box(i, box)) {
                ++left_out;
                continue;
            }
            bounds = {min_of(bounds.lo, box.lo), max_of(bounds.hi, box.hi)};
        }
        if (!(bounds.lo.x <= bounds.hi.x)) return false;
        out.bounds = bounds;
        out.arrays.stats = from_.arrays.stats;
        out.arrays.stats.left_out = left_out;
        const Vec3d center = median_center(
            n,
            [&](std::size_t i, AabbD& box) {
                return source_.box(static_cast<std::uint32_t>(i), box);
            },
            bounds);
        out.space = {center, scale_around(center, bounds)};
        return true;
    }

    bool fill_leaves(WideTreeD& out) {
        std::atomic<bool> good = true;
        for_each_index(
            from_.arrays.nodes.size(),
            [&](std::size_t w) {
                for (int slot = 0; slot < quantised_width; ++slot) {
                    const std::uint32_t word = from_.arrays.nodes[w].child[slot];
                    if (word == wide_no_child) continue;
                    boxes_[w].used |= 1u << slot;
                    if (!is_leaf(word)) continue;
                    Aabb box = empty_box();
                    if (!fill_leaf(word, out, box)) good = false;
                    boxes_[w].set(slot, grown_planes(box));
                    leaf_area_[w] += half_area(box) * ((word & 7) + 1);
                }
            },
            grain);
        return good;
    }
    /// False if a triangle cannot stay where it is.
    bool fill_leaf(std::uint32_t word, WideTreeD& out, Aabb& around) {
        const std::uint32_t place = (word & ~wide_leaf_bit) >> 3, count = (word & 7) + 1;
        for (std::uint32_t p = place; p < place + count; ++p) {
            TriangleBlockD& block = out.blocks[p / block_lanes];
            const std::uint32_t prim = block.prim[p % block_lanes];
            AabbD box;
            if (prim >= in_tree_.size() || !source_.box(prim, box)) return false;
            const LeafTriangleD corners = source_.corners(prim);
            if (has_zero_area(corners)) return false;
            in_tree_[prim] = 1;
            block.set(p % block_lanes, corners, prim);
            around = unite(around, box_around_center(box, out.space.center, out.space.scale));
        }
        return true;
    }
    [[nodiscard]] bool others_stay_out() const {
        std::atomic<bool> good = true;
        for_each_index(
            in_tree_.size(),
            [&](std::size_t i) {
                if (in_tree_[i] != 0) return;
                const auto prim = static_cast<std::uint32_t>(i);
                AabbD box;
                if (source_.box(prim, box) && !has_zero_area(source_.corners(prim))) good = false;
            },
            grain * 16);
        return good;
    }

    /// Children come after their parents.
    void fill_inner() {
        for (std::size_t w = around_.size(); w-- > 0;) {
            SlotBoxes& boxes = boxes_[w];
            for (int slot = 0; slot < quantised_width; ++slot) {
                const std::uint32_t word = from_.arrays.nodes[w].child[slot];
                if (word == wide_no_child) continue;
                if (is_inner(word)) boxes.set(slot, around_[word]);
                around_[w] =
                    unite(around_[w], {{boxes.lo[0][slot], boxes.lo[1][slot], boxes.lo[2][slot]},
                                       {boxes.hi[0][slot], boxes.hi[1][slot], boxes.hi[2][slot]}});
            }
        }
    }

    void finish(WideTreeD& out) {
        for_each_index(
            boxes_.size(),
            [&](std::size_t w) {
                set_boxes_about({}, boxes_[w], out.arrays.nodes[w]);
                std::copy_n(from_.arrays.nodes[w].child, quantised_width,
                            out.arrays.nodes[w].child);
            },
            grain);
        out.arrays.set_bounds(
            grown_planes(box_around_center(out.bounds, out.space.center, out.space.scale)), {});
        double nodes = 0, leaves = 0;
        for (std::size_t w = 0; w < boxes_.size(); ++w)
            nodes += half_area(around_[w]), leaves += leaf_area_[w];
        const double root = half_area(out.arrays.bounds);
        out.arrays.stats.sah = root > 0 ? (nodes + wide_primitive_cost * leaves) / root : 0;
        out.set_view();
        out.suits_packets = is_compact_place(mesh_, out);
    }

    const WideTreeD& from_;
    const MeshViewD& mesh_;
    const TriangleSourceD source_;
    std::vector<SlotBoxes> boxes_;       // [nodes]
    std::vector<Aabb> around_;           // [nodes]
    std::vector<double> leaf_area_;      // [nodes], times the triangles
    std::vector<std::uint8_t> in_tree_;  // [triangles]
};

}  // namespace

float grown_plane(float p, bool upper) {
    const double by = 0x1.4p-22 * std::fabs(double{p}), at = upper ? p + by : p - by;
    const auto nearest = static_cast<float>(at);
    if (upper) return double{nearest} < at ? std::nextafterf(nearest, infinity) : nearest;
    return double{nearest} > at ? std::nextafterf(nearest, -infinity) : nearest;
}

Aabb grown_planes(const Aabb& box) {
    const auto lower = [](float p) { return grown_plane(p, false); };
    const auto upper = [](float p) { return grown_plane(p, true); };
    return {{lower(box.lo.x), lower(box.lo.y), lower(box.lo.z)},
            {upper(box.hi.x), upper(box.hi.y), upper(box.hi.z)}};
}

void NodesD::set_view() {
    view = view_of(arrays);
    const double at[3] = {space.center.x, space.center.y, space.center.z};
    size = 0;
    for (int a = 0; a < 3; ++a) {
        center[a] = at[a];
        lo[a] = coordinate(arrays.bounds.lo, a);
        hi[a] = coordinate(arrays.bounds.hi, a);
        size = std::max(size, hi[a] - lo[a]);
    }
}

std::shared_ptr<const WideTreeD> build_wide_tree(const MeshViewD& mesh,
                                                 const BuildOptions& options) {
    auto made = std::make_shared<WideTreeD>();
    WideTreeD& out = *made;
    const BvhD bvh = build_bvh(mesh, options);
    out.input_count = bvh.input_count();
    out.arrays.stats.left_out = bvh.left_out();
    if (bvh.empty()) return made;
    out.bounds = bvh.bounds();
    out.space = {bvh.center(), bvh.scale()};
    out.has_parts = bvh.tree().has_split_primitives();
    std::vector<std::uint8_t> flat(bvh.order().size());
    for_each_index(flat.size(),
                   [&](std::size_t k) { flat[k] = has_zero_area(bvh.triangles()[k]) ? 1 : 0; });
    const AroundCenterView view(bvh, flat);
    PartPool pool;
    WideEmitter<quantised_width, AroundCenterView>(view,
                                                   {.width = quantised_width,
                                                    .max_leaf = wide_max_leaf,
                                                    .primitive_cost = wide_primitive_cost,
                                                    .block = wide_block},
                                                   pool)
        .run(out.arrays);
    out.blocks.reset(out.arrays.blocks.size());
    prefer_large_pages(out.blocks);
    for_each_index(
        out.blocks.size(),
        [&](std::size_t b) {
            for (std::uint32_t lane = 0; lane < block_lanes; ++lane) {
                const std::uint32_t position = out.arrays.blocks[b].prim[lane];
                out.blocks[b].set(lane, bvh.triangles()[position], bvh.order()[position]);
            }
        },
        1024);
    out.arrays.blocks = {};
    out.arrays.stats.left_out = bvh.left_out();
    out.set_view();
    out.suits_packets = is_compact_place(mesh, out);
    return made;
}

WideBvhStats wide_stats_of(const MeshViewD& mesh, const BuildOptions& options) {
    const auto start = std::chrono::steady_clock::now();
    std::shared_ptr<const WideTreeD> tree;
    with_threads(options.threads, [&] { tree = build_wide_tree(mesh, options); });
    WideBvhStats stats = tree->arrays.stats;
    stats.width = quantised_width;
    stats.widening = 1.0;
    stats.node_bytes = tree->arrays.nodes.size() * sizeof(WideNode);
    stats.triangle_bytes = tree->blocks.size() * sizeof(TriangleBlockD);
    stats.bytes = tree->bytes();
    stats.input_count = tree->input_count;
    const std::chrono::duration<double, std::milli> ms = std::chrono::steady_clock::now() - start;
    stats.ms = ms.count();
    return stats;
}

std::shared_ptr<const WideTreeD> refit_wide_tree(const WideTreeD& tree, const MeshViewD& mesh) {
    if (tree.empty() || tree.has_parts || tree.input_count != mesh.triangles.size()) return {};
    return RefitD(tree, mesh).run();
}

}  // namespace raydix
