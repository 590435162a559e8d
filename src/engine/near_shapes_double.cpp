#include "engine/near_shapes_double.h"

#include <raydix/error.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "exec/parallel.h"
#include "exec/result_memory.h"
#include "primitives/double_sources.h"
#include "tree/around_center.h"
#include "tree/median_center.h"

namespace raydix {
namespace {

constexpr std::uint64_t most_primitives = std::uint64_t{1} << 31;
/// More than a box and a build over boxes hold for each primitive at any time.
constexpr std::uint64_t bytes_a_primitive = 350;

double largest(Double3 p) { return std::max({std::fabs(p.x), std::fabs(p.y), std::fabs(p.z)}); }

Affine times(const AffineD& outer, const Affine& inner) {
    const auto row = [&](Double3 r) { return inner.x * r.x + inner.y * r.y + inner.z * r.z; };
    return {row(outer.x), row(outer.y), row(outer.z), {}};
}

}  // namespace

Double3 ShapesOnPath::in_world(Vec3d p) const {
    Double3 at(p);
    for (const AffineD& map : maps) at = map.vector(at) + map.move;
    return at;
}

Double3 ShapesOnPath::inside(Vec3d p) const {
    Double3 at(p);
    for (const InverseD& inverse : inverses) at = inverse.point(at);
    return at;
}

ShapePointD ShapesOnPath::closest(std::uint32_t prim, Vec3d query) const {
    return shapes->with_capsule(prim, [&](Vec3d a, Vec3d b, double radius) {
        if (maps.empty()) return closest_on_capsule(Double3(a), Double3(b), radius, query);
        return closest_on_image(in_world(a), in_world(b), BallImage(all_maps, radius), radius,
                                query);
    });
}

bool ShapesOnPath::touches(std::uint32_t prim, const SegmentD& segment) const {
    return shapes->with_capsule(prim, [&](Vec3d a, Vec3d b, double radius) {
        // About the shape's own place: far from the origin no digit is lost.
        const auto from_a = [&](Vec3d p) {
            Vec3d at;
            (inside(p) - Double3(a)).round_to(at);
            return Double3(at);
        };
        Vec3d axis;
        (Double3(b) - Double3(a)).round_to(axis);
        return segment_touches_capsule(from_a(segment.a), from_a(segment.b),
                                       CapsuleD{{0, 0, 0}, axis, radius});
    });
}

AabbD ShapesOnPath::box_of(std::uint32_t prim) const {
    return shapes->with_capsule(prim, [&](Vec3d from, Vec3d to, double radius) {
        const Double3 a = in_world(from), b = in_world(to);
        const Double3 reach =
            maps.empty() ? Double3{radius, radius, radius} : BallImage(all_maps, radius).reach();
        double lengths = std::max({largest(a), largest(b), largest(reach)});
        for (const AffineD& map : maps) lengths = std::max(lengths, largest(map.move));
        // What moving the shape loses grows with the condition of the maps; 2^-42 is far more than
        // the roundings of distances to the shape and to the box.
        const double room = (0x1p-44 * condition + 0x1p-42) * lengths + double{min_diagonal};
        const auto side = [&](double x, double y, double by, double& lo, double& hi) {
            constexpr double edge = max_coordinate;
            by = by * (1.0 + 0x1p-40) + room;
            lo = std::clamp(std::min(x, y) - by, -edge, edge);
            hi = std::clamp(std::max(x, y) + by, -edge, edge);
        };
        AabbD box;
        side(a.x, b.x, reach.x, box.lo.x, box.hi.x);
        side(a.y, b.y, reach.y, box.lo.y, box.hi.y);
        side(a.z, b.z, reach.z, box.lo.z, box.hi.z);
        return box;
    });
}

NearShapesD::NearShapesD(std::vector<ShapesOnPath> paths) : paths_(std::move(paths)) {
    if (paths_.empty()) return;
    const ShapesOnPath& last = paths_.back();
    std::vector<AabbD> boxes(last.first + last.shapes->part.size());
    for (const ShapesOnPath& on_path : paths_)
        for_each_index(on_path.shapes->part.size(), [&](std::size_t k) {
            boxes[on_path.first + k] = on_path.box_of(on_path.shapes->part[k]);
        });
    const BoxSourceD source{boxes.data()};
    const auto box_at = [&](std::size_t k, AabbD& box) {
        return source.box(static_cast<std::uint32_t>(k), box);
    };
    AabbD bounds = nothing_d, box;
    for (std::size_t k = 0; k < boxes.size(); ++k)
        if (box_at(k, box)) bounds = {min_of(bounds.lo, box.lo), max_of(bounds.hi, box.hi)};
    const Vec3d center = median_center(boxes.size(), box_at, bounds);
    space_ = {center, scale_around(center, bounds)};
    std::vector<Aabb> around_center(boxes.size());
    for_each_index(boxes.size(), [&](std::size_t k) {
        AabbD valid;
        around_center[k] =
            box_at(k, valid) ? box_around_center(valid, space_.center, space_.scale) : empty_box();
    });
    tree_ = build_bvh(around_center, build_options_for(Quality::balanced));
    if (tree_.empty()) return;
    const BvhNode& root = nodes()[0];
    const Vec3 far = max_of(root.hi, -1.0f * root.lo);
    reach_ = max_of(max_of(max_of(far.x, far.y), far.z), 0.0f);
}

auto NearShapesD::place(std::uint32_t position) const -> Place {
    const std::uint32_t index = tree_.order()[position];
    const auto past = std::upper_bound(
        paths_.begin(), paths_.end(), index,
        [](std::uint32_t wanted, const ShapesOnPath& on_path) { return wanted < on_path.first; });
    const ShapesOnPath& on_path = *(past - 1);
    return {&on_path, on_path.shapes->part[index - on_path.first]};
}

/// As PaddedTreeD::distances.
BoxDistancesD NearShapesD::distances(Vec3d query) const {
    const Vec3d q = space_.local(query);
    return {q, 0x1p-50 * (largest(Double3(q)) + reach_)};
}

bool NearShapesD::find_closest(Vec3d query, Found& best, BasicWalkStack<double>& stack) const {
    bool found = false;
    const auto leaf = [&](const BvhNode& node) {
        for (std::uint32_t k = node.first; k < node.first + node.count; ++k) {
            const Place at = place(k);
            const Found here{at.on_path->closest(at.prim, query), name_of(at)};
            if (!(here.point.d2 < best.point.d2 ||
                  (here.point.d2 == best.point.d2 && here.name < best.name)))
                continue;
            best = here;
            found = true;
        }
        return false;
    };
    walk_outward(nodes(), distances(query), stack, leaf,
                 [&] { return best.point.d2 * space_.scale * space_.scale; });
    return found;
}

NearShapesPlan::NearShapesPlan(const SceneTreeD& scene, std::uint32_t mask, NearCall call)
    : scene_(scene), mask_(mask), call_(call) {
    count(scene, 0);
}

auto NearShapesPlan::count(const SceneTreeD& scene, std::uint32_t path) -> const Count& {
    const auto known = counts_.find(&scene);
    if (known != counts_.end()) return known->second;
    Count sum;
    for (const auto& shapes : scene.shapes) {
        if ((shapes->mask & mask_) == 0 || shapes->empty()) continue;
        require_answers(*shapes, path, call_);
        sum.primitives += shapes->part.size();
        ++sum.geometries;
    }
    for (const InstanceNameD& instance : scene.instances) {
        if ((instance.mask & mask_) == 0) continue;
        const Count inner = count(*instance.scene, path + instance.number);
        sum.primitives = saturating_sum(sum.primitives, inner.primitives);
        sum.geometries = saturating_sum(sum.geometries, inner.geometries);
    }
    return counts_.emplace(&scene, sum).first->second;
}

std::uint64_t NearShapesPlan::bytes() const {
    const Count& all = counts_.at(&scene_);
    const std::uint64_t a_geometry =
        2 * (sizeof(ShapesOnPath) + scene_.levels * (sizeof(AffineD) + sizeof(InverseD)));
    return saturating_sum(saturating_product(all.primitives, bytes_a_primitive),
                          saturating_product(all.geometries, a_geometry));
}

struct NearShapesPlan::Way {
    const Way* outer;  // null: the world
    const InstanceNameD* instance;
    std::uint32_t number;  // of the path
};

NearShapesD NearShapesPlan::make() const {
    const Count& all = counts_.at(&scene_);
    if (all.primitives == 0) return {};
    if (all.primitives >= most_primitives)
        throw InputError(std::string(raydix::name_of(call_)) +
                         ": 2^31 spheres, capsules and points or more, on all paths of instances");
    std::vector<ShapesOnPath> paths;
    paths.reserve(all.geometries);
    walk(scene_, {nullptr, nullptr, 0}, paths);
    return NearShapesD(std::move(paths));
}

void NearShapesPlan::walk(const SceneTreeD& scene, const Way& way,
                          std::vector<ShapesOnPath>& out) const {
    for (const auto& shapes : scene.shapes) {
        if ((shapes->mask & mask_) == 0 || shapes->empty()) continue;
        const std::size_t first =
            out.empty() ? 0 : out.back().first + out.back().shapes->part.size();
        ShapesOnPath on_path{shapes, way.number, static_cast<std::uint32_t>(first),
                             {},     {},         {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {}}};
        for (const Way* at = &way; at->instance != nullptr; at = at->outer) {
            const AffineD map = affine_of(at->instance->transform);
            on_path.maps.push_back(map);
            on_path.inverses.push_back(at->instance->inverse);
            on_path.all_maps = times(map, on_path.all_maps);
            on_path.condition *= map.norm() * at->instance->inverse.rows.norm();
        }
        std::ranges::reverse(on_path.inverses);
        out.push_back(std::move(on_path));
    }
    for (const InstanceNameD& instance : scene.instances) {
        if ((instance.mask & mask_) == 0 || counts_.at(instance.scene.get()).primitives == 0)
            continue;
        walk(*instance.scene, {&way, &instance, way.number + instance.number}, out);
    }
}

}  // namespace raydix
