// Objects and groups of instances; trees over the boxes of instances, inner groups first.
#include "instances/instanced_scene.h"

#include <raydix/error.h>

#include <string>

#include "exec/parallel.h"

namespace raydix {
namespace {

std::string name_of(std::uint32_t group, std::uint32_t place) {
    std::string name = "instance " + std::to_string(place);
    if (group != InstancedScene::scene) name += " of group " + std::to_string(group);
    return name;
}

InstanceGroup& group_of(InstancedSceneAccess::State& state, std::uint32_t id) {
    if (id >= state.objects.size() || state.objects[id].bvh != nullptr)
        throw InputError("object " + std::to_string(id) + " is no group");
    return state.groups[state.objects[id].group];
}

Affine checked_inverse(const InstancedSceneAccess::State& state, std::uint32_t group,
                       std::uint32_t place, const Instance& instance) {
    if (instance.object >= state.objects.size())
        throw InputError(name_of(group, place) + ": there is no object " +
                         std::to_string(instance.object));
    const std::optional<Affine> inverse = inverse_of(affine_of(instance.transform));
    if (!inverse)
        throw InputError(name_of(group, place) +
                         ": its transform is singular or not finite, so rays cannot go through it");
    return *inverse;
}

Aabb object_box(const InstancedSceneAccess::State& state, std::uint32_t object) {
    const SceneObject& o = state.objects[object];
    return (o.bvh != nullptr ? *o.bvh : state.groups[o.group].tree).bounds();
}

/// Builds what a group shows before the group itself.
class GroupBuilds {
public:
    explicit GroupBuilds(InstancedSceneAccess::State& state)
        : state_(state), levels_(state.objects.size(), unseen) {}

    /// Levels of groups from object `id`, a group, down.
    std::size_t build(std::uint32_t id) {
        if (levels_[id] == open)
            throw InputError("group " + std::to_string(id) +
                             " shows itself, directly or through others");
        if (levels_[id] != unseen) return levels_[id];
        levels_[id] = open;
        if (++depth_ > nesting_limit) throw InputError(too_deep(id));
        std::size_t below = 0;
        for (const Instance& instance : group_of(state_, id).instances)
            if (state_.objects[instance.object].bvh == nullptr)
                below = std::max(below, build(instance.object));
        --depth_;
        build_tree(id);
        return levels_[id] = below + 1;
    }
    static std::string too_deep(std::uint32_t id) {
        return "groups are nested more than " + std::to_string(InstanceHit::max_levels) +
               " deep at group " + std::to_string(id);
    }

private:
    static constexpr std::size_t unseen = 0, open = ~std::size_t{0};
    /// Of the descent, so that a long chain of groups is an error and not a deep recursion.
    static constexpr std::size_t nesting_limit = 1000;

    void build_tree(std::uint32_t id) {
        InstanceGroup& group = group_of(state_, id);
        const std::size_t n = group.instances.size();
        group.boxes.resize(n);
        for_each_index(n, [&](std::size_t i) {
            const Instance& instance = group.instances[i];
            const Aabb box = object_box(state_, instance.object);
            group.boxes[i] =
                is_empty(box) ? empty_box() : image_of(affine_of(instance.transform), box);
        });
        for (std::uint32_t i = 0; i < n; ++i) {
            const Aabb& box = group.boxes[i];
            if (box.lo.x > box.hi.x) continue;  // an empty object
            if (!in_range(box.lo) || !in_range(box.hi))
                throw InputError(name_of(id, i) + ": it reaches beyond 1e12, or is not finite");
        }
        state_.builder.build(group.boxes, {.builder = Builder::apetrei, .max_leaf = 1}, group.tree);
    }

    InstancedSceneAccess::State& state_;
    std::vector<std::size_t> levels_;  // [objects]: unseen, open, or how many
    std::size_t depth_ = 0;
};

}  // namespace

InstancedScene::InstancedScene() : state_(std::make_unique<State>()) { add_group(); }
InstancedScene::~InstancedScene() = default;
InstancedScene::InstancedScene(InstancedScene&&) noexcept = default;
InstancedScene& InstancedScene::operator=(InstancedScene&&) noexcept = default;

std::uint32_t InstancedScene::add_object(const Bvh& bvh) {
    if (bvh.kind() != PrimitiveKind::triangles && !bvh.empty())
        throw InputError("an object of a scene needs triangles");
    state_->objects.push_back({&bvh, 0});
    return static_cast<std::uint32_t>(state_->objects.size() - 1);
}

std::uint32_t InstancedScene::add_group() {
    state_->objects.push_back({nullptr, static_cast<std::uint32_t>(state_->groups.size())});
    state_->groups.emplace_back();
    return static_cast<std::uint32_t>(state_->objects.size() - 1);
}

std::uint32_t InstancedScene::add_instance(std::uint32_t group, const Instance& instance) {
    InstanceGroup& into = group_of(*state_, group);
    const auto place = static_cast<std::uint32_t>(into.instances.size());
    into.inverses.push_back(checked_inverse(*state_, group, place, instance));
    into.instances.push_back(instance);
    state_->built = false;
    return place;
}

void InstancedScene::set_instance(std::uint32_t group, std::uint32_t place,
                                  const Instance& instance) {
    InstanceGroup& of = group_of(*state_, group);
    if (place >= of.instances.size()) throw InputError("there is no " + name_of(group, place));
    of.inverses[place] = checked_inverse(*state_, group, place, instance);
    of.instances[place] = instance;
    state_->built = false;
}

const Instance& InstancedScene::instance(std::uint32_t group, std::uint32_t place) const {
    const InstanceGroup& of = group_of(*state_, group);
    if (place >= of.instances.size()) throw InputError("there is no " + name_of(group, place));
    return of.instances[place];
}

std::uint32_t InstancedScene::instance_count(std::uint32_t group) const {
    return static_cast<std::uint32_t>(group_of(*state_, group).instances.size());
}

void InstancedScene::build(int threads) {
    state_->built = false;
    with_threads(threads, [&] {
        GroupBuilds builds(*state_);
        if (builds.build(scene) > InstanceHit::max_levels)
            throw InputError(GroupBuilds::too_deep(scene));
    });
    state_->built = true;
}

Aabb InstancedScene::bounds() const { return state_->groups[0].tree.bounds(); }

}  // namespace raydix
