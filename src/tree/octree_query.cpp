// Queries of octrees: cubes of nodes, locating points, points in boxes.
#include "tree/octree_query.h"

#include <algorithm>
#include <bit>
#include <limits>

#include "base/float_env.h"
#include "exec/parallel.h"
#include "exec/result_budget.h"

namespace raydix {
namespace {

/// Floats as integers in the same order.
std::int64_t ordered(float x) {
    const auto bits = std::bit_cast<std::int32_t>(x);
    return bits < 0 ? -std::int64_t{bits & 0x7FFFFFFF} : bits;
}
float from_ordered(std::int64_t k) {
    return k < 0 ? -std::bit_cast<float>(static_cast<std::int32_t>(-k))
                 : std::bit_cast<float>(static_cast<std::int32_t>(k));
}

/// One axis of the root: from the scene's lower face to the upper face of the cube or of the scene,
/// whichever rounding puts farther.
struct RootAxis {
    float lo, hi, cells_per_unit, last_cell;

    [[nodiscard]] float cell(float x) const { return min_of((x - lo) * cells_per_unit, last_cell); }
    /// The least float whose cell is `first` or above; past the root if there is none.
    [[nodiscard]] float least_of_cell(std::uint32_t first) const {
        const auto wanted = static_cast<float>(first);  // below 2^24: exact
        std::int64_t below = ordered(lo) - 1, at = ordered(hi) + 1;
        while (at - below > 1) {
            const std::int64_t middle = below + (at - below) / 2;
            (cell(from_ordered(middle)) >= wanted ? at : below) = middle;
        }
        return from_ordered(at);
    }
};

Aabb root_box(const Octree& octree) {
    const Aabb scene = octree.bounds();
    const Vec3 size = scene.hi - scene.lo;
    const float edge = max_of(max_of(size.x, size.y), size.z);
    return {scene.lo, max_of(scene.hi, scene.lo + Vec3{edge, edge, edge})};
}

/// `grid` and `root` are the octree's.
std::uint32_t locate_one(const Octree& octree, const Grid& grid, const Aabb& root, Vec3 p) {
    if (octree.empty() || !contains(root, p)) return no_node;  // NaN is in no box
    const auto code = interleave<std::uint64_t>(grid.cell(p));
    return descend(octree, code, static_cast<std::uint32_t>(axis_bits_of(octree)));
}

/// Appends the ids of a row, ascending.
void append_points(const Octree& octree, const Grid& grid, const Aabb& box,
                   BudgetVector<std::uint32_t>& ids) {
    if (!is_valid_query(box)) return;
    const auto before = static_cast<std::ptrdiff_t>(ids.size());
    for_each_point_in_box(octree, grid, box,
                          [&](std::uint32_t position) { ids.push_back(octree.order()[position]); });
    std::sort(ids.begin() + before, ids.end());
}

}  // namespace

Aabb node_box(const Octree& octree, std::uint32_t node_index) {
    const FloatEnvironment plain;
    const OctreeNode& node = node_at(octree, node_index);
    const Aabb root = root_box(octree);
    const Grid grid = grid_of(octree);
    const int shift = axis_bits_of(octree) - static_cast<int>(node.level);
    const auto face = [&](float lo, float hi, std::uint32_t cell) {
        if (cell == 0) return lo;
        if (cell >> node.level != 0) return hi;
        return RootAxis{lo, hi, grid.cells_per_unit, grid.last_cell}.least_of_cell(cell << shift);
    };
    const auto corner = [&](Cell cell) {
        return Vec3{face(root.lo.x, root.hi.x, cell.x), face(root.lo.y, root.hi.y, cell.y),
                    face(root.lo.z, root.hi.z, cell.z)};
    };
    const Cell cell = cell_of_code(node.code);
    return {corner(cell), corner({cell.x + 1, cell.y + 1, cell.z + 1})};
}

std::uint32_t locate(const Octree& octree, Vec3 point) {
    const FloatEnvironment plain;
    return locate_one(octree, grid_of(octree), root_box(octree), point);
}

std::vector<std::uint32_t> locate(const Octree& octree, std::span<const Vec3> points, int threads) {
    std::vector<std::uint32_t> found(points.size());
    with_threads(threads, [&] {
        const Grid grid = grid_of(octree);
        const Aabb root = root_box(octree);
        for_each_index(
            points.size(),
            [&](std::size_t i) { found[i] = locate_one(octree, grid, root, points[i]); }, 256);
    });
    return found;
}

std::vector<std::uint32_t> points_in_box(const Octree& octree, const Aabb& box,
                                         std::uint64_t max_result_bytes) {
    const FloatEnvironment plain;
    ResultBudget budget("points_in_box", max_result_bytes);
    BudgetVector<std::uint32_t> ids{BudgetAllocator<std::uint32_t>(&budget)};
    append_points(octree, grid_of(octree), box, ids);
    budget.take_last(ids.size() * sizeof(std::uint32_t));
    return {ids.begin(), ids.end()};
}

PointsInBoxes points_in_boxes(const Octree& octree, std::span<const Aabb> boxes, int threads,
                              std::uint64_t max_result_bytes) {
    constexpr std::size_t block = 64;
    ResultBudget budget("points_in_boxes", max_result_bytes);
    budget.take((boxes.size() + 1) * sizeof(std::uint64_t));
    PointsInBoxes result;
    result.offsets.assign(boxes.size() + 1, 0);
    auto found = budget_lists<std::uint32_t>((boxes.size() + block - 1) / block, budget);
    with_threads(threads, [&] {
        for (const Aabb& box : boxes) result.invalid_queries += is_valid_query(box) ? 0 : 1;
        const Grid grid = grid_of(octree);
        for_each_block(boxes.size(), block, [&](std::size_t b, std::size_t begin, std::size_t end) {
            budget.go_on();
            BudgetVector<std::uint32_t>& ids = found[b];
            for (std::size_t q = begin; q < end; ++q) {
                const std::size_t before = ids.size();
                append_points(octree, grid, boxes[q], ids);
                result.offsets[q + 1] = ids.size() - before;
            }
            pack(ids);
        });
    });
    for (std::size_t q = 0; q < boxes.size(); ++q) result.offsets[q + 1] += result.offsets[q];
    budget.take_last(result.offsets.back() * sizeof(std::uint32_t));
    result.ids.reserve(result.offsets.back());
    for (BudgetVector<std::uint32_t>& list : found) {
        const BudgetVector<std::uint32_t> ids = std::move(list);
        result.ids.insert(result.ids.end(), ids.begin(), ids.end());
    }
    return result;
}

}  // namespace raydix
