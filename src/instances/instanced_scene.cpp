// InstancedScene: see scene_groups.h.
#include "instances/instanced_scene.h"

#include <raydix/error.h>

namespace raydix {

InstancedScene::InstancedScene() : state_(std::make_unique<State>()) {}
InstancedScene::~InstancedScene() = default;
InstancedScene::InstancedScene(InstancedScene&&) noexcept = default;
InstancedScene& InstancedScene::operator=(InstancedScene&&) noexcept = default;

std::uint32_t InstancedScene::add_object(const Bvh& bvh) {
    if (bvh.kind() != PrimitiveKind::triangles && !bvh.empty())
        throw InputError("an object of a scene needs triangles");
    return state_->add_object(&bvh);
}

std::uint32_t InstancedScene::add_group() { return state_->add_group(); }

std::uint32_t InstancedScene::add_instance(std::uint32_t group, const Instance& instance) {
    return state_->add_instance(group, instance);
}

void InstancedScene::set_instance(std::uint32_t group, std::uint32_t place,
                                  const Instance& instance) {
    state_->set_instance(group, place, instance);
}

const Instance& InstancedScene::instance(std::uint32_t group, std::uint32_t place) const {
    return state_->instance(group, place);
}

std::uint32_t InstancedScene::instance_count(std::uint32_t group) const {
    return state_->instance_count(group);
}

void InstancedScene::build(int threads) { state_->build(threads); }

Aabb InstancedScene::bounds() const { return state_->root().tree.bvh.bounds(); }

}  // namespace raydix
