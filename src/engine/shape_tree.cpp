#include "engine/shape_tree.h"

#include <raydix/error.h>

#include <algorithm>
#include <limits>
#include <string>
#include <type_traits>

#include "base/distance.h"
#include "exec/parallel.h"
#include "primitives/double_sources.h"
#include "tree/around_center.h"
#include "tree/outward_box.h"

namespace raydix {
namespace {

/// Leaves name a place and a count in 31 bits.
constexpr std::size_t most_primitives = std::size_t{1} << 28;

/// A quarter to a half of the second cache of common processors.
constexpr std::uint64_t most_bytes_at_hand = 1 << 19;

/// How far a user's hit may be from its box, of the distance that the ray has come.
constexpr double user_slack = 0x1p-17;

std::span<const Sphere> spheres_of(const Shapes& shapes) {
    const auto* const all = std::get_if<std::span<const Sphere>>(&shapes);
    return all == nullptr ? std::span<const Sphere>() : *all;
}

/// A sphere's test is cheap in vectors of eight, those of the others go one by one.
WideOptions leaves_of(const Shapes& shapes) {
    WideOptions leaves{.width = quantised_width};
    const bool vectors = std::holds_alternative<std::span<const Sphere>>(shapes) ||
                         std::holds_alternative<BasicBalls<float>>(shapes);
    leaves.max_leaf = vectors ? static_cast<std::uint32_t>(sphere_lanes) : 1;
    leaves.block = leaves.max_leaf;
    if (!vectors) leaves.block = 1;
    return leaves;
}

/// Boxes of small things all over a place: trees from the top down cost rays 5 to 10 % less than
/// clusters do, and take as long.
BuildOptions build_of(Quality quality) {
    BuildOptions build = build_options_for(quality);
    if (quality == Quality::balanced) build.builder = Builder::binned;
    if (quality == Quality::high) build.builder = Builder::sweep;
    return build;
}

/// The primitives as leaves name them.
void copy_primitives(ShapeTree& tree) {
    const std::size_t n = tree.part.size();
    const auto copy_spheres = [&](const auto& sphere) {
        tree.spheres.reset(n + sphere_lanes);
        for_each_index(n, [&](std::size_t k) { tree.spheres[k] = sphere(tree.part[k]); });
        std::fill_n(tree.spheres.data() + n, sphere_lanes, Sphere{});
    };
    if (const auto* const capsules = std::get_if<std::span<const Capsule>>(&tree.shapes)) {
        tree.capsules.reset(n);
        for_each_index(n, [&](std::size_t k) { tree.capsules[k] = (*capsules)[tree.part[k]]; });
    } else if (const auto* const balls = std::get_if<BasicBalls<float>>(&tree.shapes)) {
        copy_spheres([&](std::uint32_t k) { return Sphere{balls->centers[k], balls->radius}; });
    } else if (const auto spheres = spheres_of(tree.shapes); !spheres.empty()) {
        copy_spheres([&](std::uint32_t k) { return spheres[k]; });
    }
}

/// The largest number that is not above x - y.
float below(float x, float y) { return round_down(double(x) - double(y)); }
double below(double x, double y) { return below_difference(x, y) + 0.0; }

template <class Scalar>
Scalar above(Scalar x, Scalar y) {
    return Scalar(0) - below(-x, y);
}

/// Around the balls at both ends; NaN if they are none.
template <class Point, class Scalar>
BasicAabb<Scalar> box_around(Point a, Point b, Scalar r) {
    constexpr Scalar nan = std::numeric_limits<Scalar>::quiet_NaN();
    if (!is_finite(a) || !is_finite(b) || !(r >= 0 && r < std::numeric_limits<Scalar>::infinity()))
        return {{nan, nan, nan}, {nan, nan, nan}};
    const Point lo = min_of(a, b), hi = max_of(a, b);
    return {{below(lo.x, r), below(lo.y, r), below(lo.z, r)},
            {above(hi.x, r), above(hi.y, r), above(hi.z, r)}};
}

/// In double, what rays may be told of hits beside boxes, of the distance to their far side: a
/// surface's t is that of a point within 2^-50 of all lengths (shape_hits.h); a user's is promised
/// to be within 2^-41, and within 2^-44 of the box's largest coordinate, which the box grows by.
constexpr double surface_error = 0x1p-44, user_error = 0x1p-40;
constexpr double user_box_slack = 0x1p-43;

ExtentD extent_of_shape(const AabbD& box, bool is_users) {
    if (!is_users) return {box, surface_error};
    const Vec3d far = max_of(max_of(box.hi, -1.0 * box.hi), max_of(box.lo, -1.0 * box.lo));
    const double by = user_box_slack * max_of(max_of(far.x, far.y), far.z);
    const Vec3d side{by, by, by};
    return {{box.lo - side, box.hi + side}, user_error};
}

}  // namespace

template <class Scalar>
std::vector<BasicAabb<Scalar>> boxes_of(const BasicShapes<Scalar>& shapes) {
    if (count_of(shapes) >= most_primitives)
        throw InputError(std::to_string(count_of(shapes)) + " " + kind_of(shapes) +
                         " are too many for one geometry: fewer than 2^28 are allowed");
    std::vector<BasicAabb<Scalar>> boxes;
    boxes.reserve(count_of(shapes));
    std::visit(
        [&](const auto& all) {
            if constexpr (requires { all.centers; })
                for (const auto& p : all.centers) boxes.push_back(box_around(p, p, all.radius));
            else if constexpr (requires { all.boxes(); })
                boxes.assign(all.boxes().begin(), all.boxes().end());
            else if constexpr (requires { all[0].center; })
                for (const auto& s : all) boxes.push_back(box_around(s.center, s.center, s.radius));
            else
                for (const auto& c : all) boxes.push_back(box_around(c.a, c.b, c.radius));
        },
        shapes);
    return boxes;
}
template std::vector<Aabb> boxes_of<float>(const BasicShapes<float>&);
template std::vector<AabbD> boxes_of<double>(const BasicShapes<double>&);

std::shared_ptr<const ShapeTree> make_shape_tree(std::uint32_t id, std::uint32_t mask,
                                                 const Shapes& shapes,
                                                 std::shared_ptr<const void> own, Quality quality,
                                                 const ShapeTree* old, double limit,
                                                 bool& refitted) {
    auto tree = std::make_shared<ShapeTree>();
    tree->id = id;
    tree->mask = mask;
    tree->shapes = shapes;
    tree->own = std::move(own);
    const std::vector<Aabb> boxes = boxes_of<float>(shapes);
    refitted = old != nullptr && refit_box_tree(*old, boxes, limit, *tree);
    if (!refitted) {
        build_box_tree(boxes, build_of(quality), leaves_of(shapes), *tree);
        if (tree->user() != nullptr) name_parts_in_leaves(*tree);
    }
    if (tree->empty()) return tree;
    copy_primitives(*tree);
    const auto name_leaves = [&](const auto* first) {
        tree->leaves = reinterpret_cast<std::uintptr_t>(first);
        tree->leaf_bytes = sizeof(*first);
    };
    if (!tree->spheres.empty())
        name_leaves(tree->spheres.data());
    else if (!tree->capsules.empty())
        name_leaves(tree->capsules.data());
    else
        tree->leaves = reinterpret_cast<std::uintptr_t>(tree->arrays.nodes.data());
    tree->is_at_hand = tree->bytes() <= most_bytes_at_hand;
    tree->bounds = tree->arrays.bounds;
    // A surface's t is that of a point on it, rounded: within the pads of slab.h, as of triangles.
    tree->extent = extent_of_mesh(tree->bounds);
    if (tree->user() != nullptr) {
        tree->growth.rate = static_cast<float>(user_slack);
        tree->extent.error += 2 * user_slack;
    }
    return tree;
}

std::shared_ptr<const ShapeTreeD> make_shape_tree(std::uint32_t id, std::uint32_t mask,
                                                  const BasicShapes<double>& shapes,
                                                  std::shared_ptr<const void> own, Quality quality,
                                                  const ShapeTreeD*, double, bool& refitted) {
    auto tree = std::make_shared<ShapeTreeD>();
    tree->id = id;
    tree->mask = mask;
    tree->shapes = shapes;
    tree->own = std::move(own);
    refitted = false;
    const std::vector<AabbD> boxes = boxes_of<double>(shapes);
    std::vector<ExtentD> extents(boxes.size(), ExtentD{nothing_d, 0.0});
    for (std::uint32_t k = 0; k < boxes.size(); ++k) {
        AabbD box;
        if (!BoxSourceD{boxes.data()}.box(k, box)) continue;
        extents[k] = extent_of_shape(box, tree->user() != nullptr);
        tree->bounds = {min_of(tree->bounds.lo, box.lo), max_of(tree->bounds.hi, box.hi)};
    }
    build_box_tree(extents, build_of(quality), *tree);
    return tree;
}

}  // namespace raydix
