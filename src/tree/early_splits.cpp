#include "tree/early_splits.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "exec/parallel.h"
#include "tree/outward_box.h"

namespace raydix {
namespace {

constexpr std::size_t block_references = 4096;
/// Planes lie on a grid of this many cells an axis over the scene, so that neighbours are cut
/// alike.
constexpr double grid_cells = 16777216;

/// A part of one triangle with its box, and how much of the box's surface it wastes.
struct Part {
    Aabb box;
    double waste;
};

class TriangleCutter {
public:
    TriangleCutter(const TriangleCorners& corners, const Aabb& scene)
        : corners_(corners), scene_(scene) {}

    [[nodiscard]] Part whole(const SahReference& reference) const {
        return {reference.box(), waste(corners_.polygon(reference.primitive_id), reference.box())};
    }

    /// Calls take(box) for the parts that up to `cuts` cuts make of one triangle.
    template <class Take>
    void cut(const SahReference& reference, std::uint32_t cuts, const Take& take) const {
        if (cuts == 0) return take(reference.box());
        const Polygon triangle = corners_.polygon(reference.primitive_id);
        cut({triangle, corners_.room(triangle)}, whole(reference), cuts, take);
    }

private:
    struct Whole {
        const Polygon& triangle;
        double room;  // what its parts are larger by
    };

    /// What the box has beyond a parallelogram: of a triangle half of which fills its flat box,
    /// nothing. Cutting walls only made trees worse (docs/algorithms/split.md).
    [[nodiscard]] static double waste(const Polygon& polygon, const Aabb& box) {
        return std::max(0.0, half_area(box) - 2 * polygon.projected_area());
    }

    /// Each cut halves a cell of the grid, so this ends after 24 levels an axis.
    template <class Take>
    void cut(const Whole& triangle, const Part& part, std::uint32_t cuts, const Take& take) const {
        std::pair<Aabb, Aabb> halves;
        if (cuts == 0 || !cut_in_middle(part.box, halves)) return take(part.box);
        const Part a = part_in(triangle, halves.first), b = part_in(triangle, halves.second);
        const double weight_a = std::sqrt(a.waste), weight_b = std::sqrt(b.waste);
        const double sum = weight_a + weight_b;
        const auto left = cuts - 1;
        const auto cuts_a =
            sum > 0 ? static_cast<std::uint32_t>(std::lround(left * (weight_a / sum))) : 0u;
        cut(triangle, a, cuts_a, take);
        cut(triangle, b, sum > 0 ? left - cuts_a : 0u, take);
    }

    [[nodiscard]] static Part part_in(const Whole& whole, const Aabb& half) {
        const Polygon polygon = clip(whole.triangle, half, whole.room);
        const Aabb box = outward_box(polygon, half, whole.room);
        return {box, waste(polygon, box)};
    }

    /// At the coarsest plane of the grid inside the longest side; false if there is none.
    bool cut_in_middle(const Aabb& box, std::pair<Aabb, Aabb>& halves) const {
        std::size_t axis = 0;
        const Vec3 size = box.hi - box.lo;
        if (size.y > (&size.x)[axis]) axis = 1;
        if (size.z > (&size.x)[axis]) axis = 2;
        const float lo = (&box.lo.x)[axis], hi = (&box.hi.x)[axis];
        const double origin = (&scene_.lo.x)[axis];
        const double cell = ((&scene_.hi.x)[axis] - origin) / grid_cells;
        if (!(cell > 0)) return false;
        const auto at = [&](float x) {
            return static_cast<std::uint32_t>(std::clamp((x - origin) / cell, 0.0, grid_cells - 1));
        };
        const std::uint32_t first = at(lo), last = at(hi);
        if (first == last) return false;
        std::uint32_t line = last;  // the most trailing zeros in (first, last]
        while ((line & (line - 1)) > first) line &= line - 1;
        const auto plane = static_cast<float>(origin + line * cell);
        if (!(plane > lo && plane < hi)) return false;
        halves = {box, box};
        (&halves.first.hi.x)[axis] = plane + 0.0f;
        (&halves.second.lo.x)[axis] = plane + 0.0f;
        return true;
    }

    const TriangleCorners& corners_;
    Aabb scene_;
};

/// The largest factor with which floor(factor * weight) cuts a triangle stay within the budget, and
/// triangles below the least weight stay whole.
double cuts_per_weight(const std::vector<float>& weights, double least_weight,
                       std::uint64_t budget) {
    const auto cuts_with = [&](double factor) {
        std::vector<std::uint64_t> sums((weights.size() + block_references - 1) / block_references);
        for_each_block(weights.size(), block_references,
                       [&](std::size_t b, std::size_t begin, std::size_t end) {
                           std::uint64_t sum = 0;
                           for (std::size_t i = begin; i < end; ++i)
                               sum += static_cast<std::uint64_t>(factor * weights[i]);
                           sums[b] = sum;
                       });
        std::uint64_t all = 0;
        for (const std::uint64_t sum : sums) all += sum;
        return all;
    };
    double most = 1 / least_weight, least = 0;
    if (cuts_with(most) <= budget) return most;
    for (int step = 0; step < 30; ++step) {
        const double middle = 0.5 * (least + most);
        (cuts_with(middle) <= budget ? least : most) = middle;
    }
    return least;
}

}  // namespace

void split_early(const TriangleCorners& corners, const Aabb& scene, const EarlySplits& options,
                 Buffer<SahReference>& references, Buffer<SahReference>& spare) {
    const std::size_t n = references.size();
    const double share = half_area(scene) / static_cast<double>(n);
    if (!(share > 0)) return;
    const TriangleCutter cutter(corners, scene);
    std::vector<float> weights(n);
    for_each_index(n, [&](std::size_t i) {
        weights[i] = static_cast<float>(std::sqrt(cutter.whole(references[i]).waste));
    });
    const double factor =
        cuts_per_weight(weights, std::sqrt(options.least_waste * share),
                        static_cast<std::uint64_t>(options.budget * static_cast<double>(n)));
    const auto cuts_of = [&](std::size_t i) {
        return static_cast<std::uint32_t>(factor * weights[i]);
    };

    std::vector<std::size_t> first((n + block_references - 1) / block_references + 1);
    for_each_block(n, block_references, [&](std::size_t b, std::size_t begin, std::size_t end) {
        std::size_t parts = 0;
        for (std::size_t i = begin; i < end; ++i)
            cutter.cut(references[i], cuts_of(i), [&](const Aabb&) { ++parts; });
        first[b + 1] = parts;
    });
    for (std::size_t b = 1; b < first.size(); ++b) first[b] += first[b - 1];
    spare.reset(first.back());
    for_each_block(n, block_references, [&](std::size_t b, std::size_t begin, std::size_t end) {
        SahReference* out = spare.data() + first[b];
        for (std::size_t i = begin; i < end; ++i)
            cutter.cut(references[i], cuts_of(i), [&](const Aabb& box) {
                *out++ = make_reference(box, references[i].primitive_id);
            });
    });
    std::swap(references, spare);
}

}  // namespace raydix
