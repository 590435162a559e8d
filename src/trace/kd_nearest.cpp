// Batches of nearest-neighbour queries over threads, each by walk_kd_tree_outward.
#include <raydix/error.h>
#include <raydix/kdtree.h>
#include <raydix/result_limit.h>

#include <algorithm>

#include "base/distance.h"
#include "exec/parallel.h"
#include "exec/result_memory.h"
#include "trace/kd_walk.h"

namespace raydix {
namespace {

constexpr std::size_t queries_per_block = 512;

struct QuerySteps {
    std::uint64_t node_visits = 0, distances = 0;
};

/// The order of results: equal distances go by id.
bool comes_before(const KdNeighbor& a, const KdNeighbor& b) {
    return a.d2 < b.d2 || (a.d2 == b.d2 && a.point < b.point);
}

/// The best k so far in the caller's row, as a heap with the last of them on top.
class NeighborRow {
public:
    explicit NeighborRow(std::span<KdNeighbor> row) : row_(row) {}

    [[nodiscard]] KdNeighbor worst() const { return full() ? row_[0] : KdNeighbor{}; }
    void offer(const KdNeighbor& found) {
        if (!full()) {
            row_[size_++] = found;
            std::push_heap(row_.begin(), end(), comes_before);
        } else if (comes_before(found, row_[0])) {
            replace_top(found);
        }
    }
    /// Ascending; missing ones at the end.
    void finish() {
        std::sort_heap(row_.begin(), end(), comes_before);
        std::fill(end(), row_.end(), KdNeighbor{});
    }

private:
    [[nodiscard]] bool full() const { return size_ == row_.size(); }
    [[nodiscard]] std::span<KdNeighbor>::iterator end() const {
        return row_.begin() + static_cast<std::ptrdiff_t>(size_);
    }
    void replace_top(const KdNeighbor& found) {
        std::size_t hole = 0;
        for (std::size_t child = 1; child < size_; child = 2 * hole + 1) {
            if (child + 1 < size_ && comes_before(row_[child], row_[child + 1])) ++child;
            if (!comes_before(found, row_[child])) break;
            row_[hole] = row_[child];
            hole = child;
        }
        row_[hole] = found;
    }

    std::span<KdNeighbor> row_;
    std::size_t size_ = 0;
};

template <class Steps>
void find_nearest(const KdTreeView& tree, const Vec3* points, Vec3 query, NeighborRow& row,
                  KdStack<KdDistancePart>& stack, Steps& steps) {
    const auto leaf = [&](const KdNode& node) {
        for (std::uint32_t i = node.first; i < node.first + node.count(); ++i)
            row.offer({squared_distance(points[i], query), tree.order[i]});
        if constexpr (std::is_same_v<Steps, QuerySteps>) steps.distances += node.count();
    };
    walk_kd_tree_outward(tree, query, stack, steps, leaf, [&] { return row.worst(); });
}

template <class Steps>
KdQueryCounts nearest_batch(const KdTree& tree, std::span<const Vec3> queries, std::uint32_t k,
                            std::span<KdNeighbor> neighbors) {
    const KdTreeView view(tree);
    const Vec3* points = tree.points().data();
    std::vector<KdQueryCounts> parts((queries.size() + queries_per_block - 1) / queries_per_block);
    for_each_block(queries.size(), queries_per_block,
                   [&](std::size_t block, std::size_t begin, std::size_t end) {
                       KdStack<KdDistancePart> stack(view.max_depth);
                       Steps steps;
                       for (std::size_t i = begin; i < end; ++i) {
                           NeighborRow row(neighbors.subspan(i * k, k));
                           if (!is_finite(queries[i]))
                               ++parts[block].invalid_queries;
                           else if (!view.empty)
                               find_nearest(view, points, queries[i], row, stack, steps);
                           row.finish();
                       }
                       if constexpr (std::is_same_v<Steps, QuerySteps>) {
                           parts[block].node_visits = steps.node_visits;
                           parts[block].distances = steps.distances;
                       }
                   });
    KdQueryCounts sum;
    sum.queries = queries.size();
    for (const KdQueryCounts& part : parts) {
        sum.invalid_queries += part.invalid_queries;
        sum.node_visits += part.node_visits;
        sum.distances += part.distances;
    }
    return sum;
}

}  // namespace

KdQueryCounts kd_nearest(const KdTree& tree, std::span<const Vec3> queries, std::uint32_t k,
                         std::span<KdNeighbor> neighbors, const KdQueryOptions& options) {
    if (k == 0) throw InputError("nearest neighbours: k is 0; it must be at least 1");
    if (neighbors.size() / k != queries.size() || neighbors.size() % k != 0)
        throw InputError("nearest neighbours: " + std::to_string(queries.size()) + " queries for " +
                         std::to_string(k) + " each, but room for " +
                         std::to_string(neighbors.size()) + " results");
    if (tree.kind() != PrimitiveKind::points && !tree.empty())
        throw InputError("nearest neighbours need points; this tree holds triangles");
    KdQueryCounts counts;
    with_threads(options.threads, [&] {
        counts = options.counters ? nearest_batch<QuerySteps>(tree, queries, k, neighbors)
                                  : nearest_batch<NoSteps>(tree, queries, k, neighbors);
    });
    return counts;
}

std::vector<KdNeighbor> kd_nearest(const KdTree& tree, std::span<const Vec3> queries,
                                   std::uint32_t k, const KdQueryOptions& options) {
    require_result_bytes("kd_nearest", saturating_product(queries.size(), k * sizeof(KdNeighbor)),
                         options.max_result_bytes);
    std::vector<KdNeighbor> neighbors(queries.size() * k);
    kd_nearest(tree, queries, k, neighbors, options);
    return neighbors;
}

}  // namespace raydix
