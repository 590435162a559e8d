// What scenes of instances in float and in double share: objects, groups, and trees over the boxes
// of instances, inner groups first.
#pragma once

#include <raydix/bvh.h>
#include <raydix/error.h>
#include <raydix/instances.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "exec/parallel.h"

namespace raydix {

/// Kind says which numbers a scene is made of:
///   Instance, Mesh, Inverse        what is placed, the trees of triangles, the way back
///   Extent                         a box, and what else a group must know of its instances
///   Tree                           over instances; its `extents` are [instances]
///   inverse_of(instance)           none if the transform is singular
///   extent_of(mesh), extent_of(tree), image(instance, inverse, extent)
///   is_empty(extent), in_range(extent)
///   build(builder, tree)           the tree over its extents
template <class Kind>
class SceneGroups {
public:
    using Instance = typename Kind::Instance;

    struct Group {
        std::vector<Instance> instances;
        std::vector<typename Kind::Inverse> inverses;  // [instances]
        typename Kind::Tree tree;                      // of the last build
    };
    /// A tree of triangles, or a group.
    struct Object {
        typename Kind::Mesh mesh;
        std::uint32_t group;
        bool is_group;
    };

    SceneGroups() { add_group(); }

    std::uint32_t add_object(const typename Kind::Mesh& mesh) {
        objects_.push_back({mesh, 0, false});
        return static_cast<std::uint32_t>(objects_.size() - 1);
    }
    std::uint32_t add_group() {
        objects_.push_back({{}, static_cast<std::uint32_t>(groups_.size()), true});
        groups_.emplace_back();
        return static_cast<std::uint32_t>(objects_.size() - 1);
    }
    std::uint32_t add_instance(std::uint32_t group, const Instance& instance) {
        Group& into = groups_[group_index(group)];
        const auto place = static_cast<std::uint32_t>(into.instances.size());
        into.inverses.push_back(checked_inverse(group, place, instance));
        into.instances.push_back(instance);
        built_ = false;
        return place;
    }
    void set_instance(std::uint32_t group, std::uint32_t place, const Instance& instance) {
        Group& of = groups_[group_index(group)];
        require_place(group, place);
        of.inverses[place] = checked_inverse(group, place, instance);
        of.instances[place] = instance;
        built_ = false;
    }
    [[nodiscard]] const Instance& instance(std::uint32_t group, std::uint32_t place) const {
        require_place(group, place);
        return groups_[group_index(group)].instances[place];
    }
    [[nodiscard]] std::uint32_t instance_count(std::uint32_t group) const {
        return static_cast<std::uint32_t>(groups_[group_index(group)].instances.size());
    }

    void build(int threads) {
        built_ = false;
        with_threads(threads, [&] {
            levels_.assign(objects_.size(), unseen);
            depth_ = 0;
            if (build_group(InstancedScene::scene) > InstanceHit::max_levels)
                throw InputError(too_deep(InstancedScene::scene));
        });
        built_ = true;
    }

    [[nodiscard]] const Object& object(std::uint32_t id) const { return objects_[id]; }
    /// The group that an object of the scene is.
    [[nodiscard]] const Group& group(const Object& object) const { return groups_[object.group]; }
    [[nodiscard]] const Group& root() const { return groups_[0]; }
    void require_built() const {
        if (!built_) throw InputError("scene of instances: call build after the last change");
    }

private:
    static constexpr std::size_t unseen = 0, open = ~std::size_t{0};
    /// Of the descent, so that a long chain of groups is an error and not a deep recursion.
    static constexpr std::size_t nesting_limit = 1000;

    static std::string name_of(std::uint32_t group, std::uint32_t place) {
        std::string name = "instance " + std::to_string(place);
        if (group != InstancedScene::scene) name += " of group " + std::to_string(group);
        return name;
    }
    static std::string too_deep(std::uint32_t id) {
        return "groups are nested more than " + std::to_string(InstanceHit::max_levels) +
               " deep at group " + std::to_string(id);
    }

    [[nodiscard]] std::uint32_t group_index(std::uint32_t id) const {
        if (id >= objects_.size() || !objects_[id].is_group)
            throw InputError("object " + std::to_string(id) + " is no group");
        return objects_[id].group;
    }
    void require_place(std::uint32_t group, std::uint32_t place) const {
        if (place >= groups_[group_index(group)].instances.size())
            throw InputError("there is no " + name_of(group, place));
    }
    [[nodiscard]] typename Kind::Inverse checked_inverse(std::uint32_t group, std::uint32_t place,
                                                         const Instance& instance) const {
        if (instance.object >= objects_.size())
            throw InputError(name_of(group, place) + ": there is no object " +
                             std::to_string(instance.object));
        const std::optional<typename Kind::Inverse> inverse = Kind::inverse_of(instance);
        if (!inverse)
            throw InputError(
                name_of(group, place) +
                ": its transform is singular or not finite, so rays cannot go through it");
        return *inverse;
    }

    /// Builds what a group shows before the group itself; returns the levels of groups from there
    /// down.
    std::size_t build_group(std::uint32_t id) {
        if (levels_[id] == open)
            throw InputError("group " + std::to_string(id) +
                             " shows itself, directly or through others");
        if (levels_[id] != unseen) return levels_[id];
        levels_[id] = open;
        if (++depth_ > nesting_limit) throw InputError(too_deep(id));
        std::size_t below = 0;
        for (const Instance& instance : groups_[objects_[id].group].instances)
            if (objects_[instance.object].is_group)
                below = std::max(below, build_group(instance.object));
        --depth_;
        build_tree(id);
        return levels_[id] = below + 1;
    }

    void build_tree(std::uint32_t id) {
        Group& group = groups_[objects_[id].group];
        const std::size_t n = group.instances.size();
        auto& extents = group.tree.extents;
        extents.resize(n);
        for_each_index(n, [&](std::size_t i) {
            const Object& object = objects_[group.instances[i].object];
            const auto extent = object.is_group ? Kind::extent_of(groups_[object.group].tree)
                                                : Kind::extent_of(object.mesh);
            extents[i] = Kind::is_empty(extent)
                             ? extent
                             : Kind::image(group.instances[i], group.inverses[i], extent);
        });
        for (std::uint32_t i = 0; i < n; ++i)
            if (!Kind::is_empty(extents[i]) && !Kind::in_range(extents[i]))
                throw InputError(name_of(id, i) + ": it reaches beyond 1e12, or is not finite");
        Kind::build(builder_, group.tree);
    }

    std::vector<Object> objects_;
    std::vector<Group> groups_;
    BvhBuilder builder_;
    std::vector<std::size_t> levels_;  // [objects]: unseen, open, or how many
    std::size_t depth_ = 0;
    bool built_ = false;
};

}  // namespace raydix
