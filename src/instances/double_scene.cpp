// InstancedSceneD: see scene_groups.h.
#include "instances/double_scene.h"

#include <raydix/error.h>

namespace raydix {
namespace {

AabbD in_double(const Aabb& box) {
    return {{box.lo.x, box.lo.y, box.lo.z}, {box.hi.x, box.hi.y, box.hi.z}};
}

}  // namespace

ExtentD DoubleInstances::extent_of(const SceneMeshD& mesh) {
    if (mesh.bvh != nullptr)
        return extent_of_triangles(mesh.bvh->empty() ? nothing_d : mesh.bvh->bounds());
    return extent_of_triangles(mesh.of_floats->empty() ? nothing_d
                                                       : in_double(mesh.of_floats->bounds()));
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
