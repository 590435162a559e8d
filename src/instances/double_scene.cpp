// InstancedSceneD: see scene_groups.h. Boxes of instances in double -> float boxes around a center
// -> a float tree, as for triangles in double.
#include "instances/double_scene.h"

#include <raydix/error.h>

#include <algorithm>

#include "primitives/double_sources.h"
#include "tree/around_center.h"
#include "tree/median_center.h"

namespace raydix {
namespace {

/// Of rays and triangles: at t the ray is as near to the triangle as slab.h says, twice over.
constexpr double triangle_error = 0x1p-46;

constexpr AabbD nothing{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};

AabbD in_double(const Aabb& box) {
    return {{box.lo.x, box.lo.y, box.lo.z}, {box.hi.x, box.hi.y, box.hi.z}};
}

}  // namespace

DoubleInstances::Tree::Tree() : around{nothing, 0.0} {}

ExtentD DoubleInstances::extent_of(const SceneMeshD& mesh) {
    if (mesh.bvh != nullptr)
        return {mesh.bvh->empty() ? nothing : mesh.bvh->bounds(), triangle_error};
    return {mesh.of_floats->empty() ? nothing : in_double(mesh.of_floats->bounds()),
            triangle_error};
}

bool DoubleInstances::in_range(const ExtentD& extent) {
    return raydix::in_range(extent.box.lo) && raydix::in_range(extent.box.hi);
}

void DoubleInstances::build(BvhBuilder& builder, Tree& tree) {
    tree.around = {nothing, 0.0};
    for (const ExtentD& extent : tree.extents) {
        if (is_empty(extent)) continue;
        tree.around.box = {min_of(tree.around.box.lo, extent.box.lo),
                           max_of(tree.around.box.hi, extent.box.hi)};
        tree.around.error = std::max(tree.around.error, extent.error);
    }
    const auto box_at = [&](std::size_t i, AabbD& box) {
        box = tree.extents[i].box;
        return !is_empty(tree.extents[i]);
    };
    const Vec3d center = median_center(tree.extents.size(), box_at, tree.around.box);
    tree.space = {center, scale_around(center, tree.around.box)};
    tree.boxes.resize(tree.extents.size());
    for_each_index(tree.extents.size(), [&](std::size_t i) {
        AabbD box;
        tree.boxes[i] = box_at(i, box) ? box_around_center(box, tree.space.center, tree.space.scale)
                                       : empty_box();
    });
    builder.build(tree.boxes, {.builder = Builder::apetrei, .max_leaf = 1}, tree.bvh);
}

InstancedSceneD::InstancedSceneD() : state_(std::make_unique<State>()) {}
InstancedSceneD::~InstancedSceneD() = default;
InstancedSceneD::InstancedSceneD(InstancedSceneD&&) noexcept = default;
InstancedSceneD& InstancedSceneD::operator=(InstancedSceneD&&) noexcept = default;

std::uint32_t InstancedSceneD::add_object(const BvhD& bvh) {
    return state_->add_object({&bvh, nullptr});
}

std::uint32_t InstancedSceneD::add_object(const Bvh& bvh) {
    if (bvh.kind() != PrimitiveKind::triangles && !bvh.empty())
        throw InputError("an object of a scene needs triangles");
    return state_->add_object({nullptr, &bvh});
}

std::uint32_t InstancedSceneD::add_group() { return state_->add_group(); }

std::uint32_t InstancedSceneD::add_instance(std::uint32_t group, const InstanceD& instance) {
    return state_->add_instance(group, instance);
}

void InstancedSceneD::set_instance(std::uint32_t group, std::uint32_t place,
                                   const InstanceD& instance) {
    state_->set_instance(group, place, instance);
}

const InstanceD& InstancedSceneD::instance(std::uint32_t group, std::uint32_t place) const {
    return state_->instance(group, place);
}

std::uint32_t InstancedSceneD::instance_count(std::uint32_t group) const {
    return state_->instance_count(group);
}

void InstancedSceneD::build(int threads) { state_->build(threads); }

AabbD InstancedSceneD::bounds() const { return state_->root().tree.around.box; }

}  // namespace raydix
