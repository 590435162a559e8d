// tree_stats: one parallel pass over the node array for SAH; depth and counts are the builder's
// own, which `check` verifies.
#include <vector>

#include "base/math.h"
#include "exec/parallel.h"
#include "tree/epo.h"
#include "tree/lbvh_family.h"

namespace raydix {
namespace {

/// Expected cost of a random ray that meets the root: each node's share of the root's area times
/// its cost (contract.md 2). Summed per block of slots, then block after block.
std::optional<double> sah_cost(const Bvh& bvh, const SahConstants& cost) {
    constexpr std::size_t block_slots = 8192;
    const std::span<const BvhNode> nodes = bvh.nodes();
    if (nodes.empty()) return std::nullopt;
    const double root_area = half_area({nodes[0].lo, nodes[0].hi});
    if (root_area == 0) return std::nullopt;

    std::vector<double> sums((nodes.size() + block_slots - 1) / block_slots);
    for_each_block(
        nodes.size(), block_slots, [&](std::size_t b, std::size_t begin, std::size_t end) {
            double sum = 0;
            for (std::size_t slot = begin; slot < end; ++slot) {
                const BvhNode& node = nodes[slot];  // slot 1 is all zero: no area, adds nothing
                const double weight = node.is_leaf() ? cost.primitive * node.count : cost.node;
                sum += weight * (half_area({node.lo, node.hi}) / root_area);
            }
            sums[b] = sum;
        });
    double total = 0;
    for (const double sum : sums) total += sum;
    return total;
}

}  // namespace

TreeStats tree_stats(const Bvh& bvh, const StatsOptions& options) {
    TreeStats stats;
    stats.nodes = std::uint64_t{bvh.inner_count()} + bvh.leaf_count();
    stats.leaves = bvh.leaf_count();
    stats.references = bvh.order().size();
    stats.layout_nodes = bvh.nodes().size();
    stats.max_depth = bvh.max_depth();
    stats.sah_constants = options.sah;
    stats.bytes = bvh.bytes();
    if (!bvh.empty() && follows_codes(bvh.options()))
        stats.depth_bound = lbvh_depth_bound(bvh.options().bits, stats.references);
    with_threads(options.threads, [&] {
        stats.sah = sah_cost(bvh, options.sah);
        if (options.with_epo) stats.epo = end_point_overlap(bvh, options.sah, options.epo_sample);
        if (options.with_hash) stats.tree_hash = tree_hash(bvh);
    });
    return stats;
}

}  // namespace raydix
