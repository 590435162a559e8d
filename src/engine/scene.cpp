// Scene: ids, changes and commits; the work is in commit.cpp and scene_trace.cpp.
#include <raydix/error.h>
#include <raydix/model.h>
#include <raydix/scene.h>

#include <algorithm>
#include <chrono>
#include <string>

#include "base/options.h"
#include "engine/commit.h"
#include "engine/scene_state.h"

namespace raydix {
namespace {

using State = SceneAccess::State;

std::string name_of(std::uint32_t id) { return "geometry " + std::to_string(id); }

void check_mesh(const std::string& name, const MeshView& mesh) {
    if (mesh.triangles.empty() && !mesh.vertices.empty())
        throw InputError(name + ": vertices without triangles");
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        const Triangle& t = mesh.triangles[i];
        if (std::max({t[0], t[1], t[2]}) >= mesh.vertices.size())
            throw InputError(name + ": triangle " + std::to_string(i) + " has an index past the " +
                             std::to_string(mesh.vertices.size()) + " vertices");
    }
}

void set_mesh(State::Geometry& geometry, const MeshView& mesh, bool shared) {
    geometry.shared = shared;
    geometry.changed = true;
    const auto own =
        shared ? nullptr
               : std::make_shared<const Mesh>(Mesh{{},
                                                   {mesh.vertices.begin(), mesh.vertices.end()},
                                                   {mesh.triangles.begin(), mesh.triangles.end()}});
    geometry.own = own;
    geometry.mesh = shared ? mesh : MeshView(*own);
}

std::uint32_t new_id(const State& state, const std::optional<std::uint32_t>& wanted) {
    if (wanted) {
        if (*wanted < state.next_id || state.taken.contains(*wanted))
            throw InputError(name_of(*wanted) + ": this id was given before");
        if (*wanted == no_primitive) throw InputError(name_of(*wanted) + ": no id");
        return *wanted;
    }
    std::uint64_t id = state.next_id;
    while (state.taken.contains(static_cast<std::uint32_t>(id))) ++id;
    if (id >= no_primitive) throw InputError("scene: no ids are left");
    return static_cast<std::uint32_t>(id);
}

/// The geometry is complete: nothing can fail from here on but for want of memory.
std::uint32_t insert(State& state, std::uint32_t id, State::Geometry geometry) {
    state.geometries.emplace(id, std::move(geometry));
    state.taken.insert(id);
    while (!state.taken.empty() && *state.taken.begin() == state.next_id) {
        state.taken.erase(state.taken.begin());
        ++state.next_id;
    }
    state.changed = true;
    return id;
}

std::uint32_t add_mesh(State& state, const MeshView& mesh, const GeometryOptions& options,
                       bool shared) {
    const std::uint32_t id = new_id(state, options.id);
    check_mesh(name_of(id), mesh);
    State::Geometry geometry;
    geometry.mask = options.mask;
    set_mesh(geometry, mesh, shared);
    return insert(state, id, std::move(geometry));
}

}  // namespace

void SceneAccess::place(std::uint32_t id, const Transform& transform,
                        State::Geometry& geometry) {
    const std::optional<Affine> inverse = inverse_of(affine_of(transform));
    if (!inverse)
        throw InputError("instance " + std::to_string(id) +
                         ": its transform is singular or not finite, so rays cannot go through it");
    geometry.transform = transform;
    geometry.inverse = *inverse;
    geometry.errors = errors_of(affine_of(transform), *inverse);
}

State::Geometry& State::at(std::uint32_t id) {
    const auto found = geometries.find(id);
    if (found == geometries.end()) throw InputError("there is no " + name_of(id));
    return found->second;
}

bool State::holds(const State* other) const {
    std::set<const State*> known{this};
    std::vector<const State*> waiting{this};
    while (!waiting.empty()) {
        const State* const at = waiting.back();
        waiting.pop_back();
        if (at == other) return true;
        for (const auto& [id, geometry] : at->geometries)
            if (geometry.is_instance() && known.insert(geometry.scene.get()).second)
                waiting.push_back(geometry.scene.get());
    }
    return false;
}

const std::shared_ptr<const SceneTree>& SceneAccess::tree(const Scene& scene) {
    if (scene.state_->tree == nullptr) throw InputError("scene: it was never committed");
    return scene.state_->tree;
}

Scene::Scene() : state_(std::make_shared<State>()) {}
Scene::Scene(const MeshView& mesh, const SceneOptions& options) : Scene() {
    add(mesh);
    commit(options);
}
Scene::Scene(const Mesh& mesh, const SceneOptions& options) : Scene(MeshView(mesh), options) {}
Scene::~Scene() = default;
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;

std::uint32_t Scene::add(const MeshView& mesh, const GeometryOptions& options) {
    return add_mesh(*state_, mesh, options, false);
}
std::uint32_t Scene::add(const Mesh& mesh, const GeometryOptions& options) {
    return add(MeshView(mesh), options);
}
std::uint32_t Scene::share(const MeshView& mesh, const GeometryOptions& options) {
    return add_mesh(*state_, mesh, options, true);
}

std::uint32_t Scene::add(const Scene& scene, const Transform& transform,
                         const GeometryOptions& options) {
    const std::uint32_t id = new_id(*state_, options.id);
    if (scene.state_->holds(state_.get()))
        throw InputError("instance " + std::to_string(id) + ": the scene would hold itself");
    State::Geometry geometry;
    geometry.mask = options.mask;
    SceneAccess::place(id, transform, geometry);
    geometry.scene = scene.state_;
    return insert(*state_, id, std::move(geometry));
}

void Scene::remove(std::uint32_t id) {
    static_cast<void>(state_->at(id));
    state_->geometries.erase(id);
    state_->changed = true;
}

void Scene::update(std::uint32_t id, const MeshView& mesh) {
    State::Geometry& geometry = state_->at(id);
    if (geometry.is_instance()) throw InputError(name_of(id) + " is an instance, not a mesh");
    check_mesh(name_of(id), mesh);
    set_mesh(geometry, mesh, geometry.shared);
    state_->changed = true;
}

void Scene::set_transform(std::uint32_t id, const Transform& transform) {
    State::Geometry& geometry = state_->at(id);
    if (!geometry.is_instance()) throw InputError(name_of(id) + " is a mesh, not an instance");
    SceneAccess::place(id, transform, geometry);
    state_->changed = true;
}

void Scene::set_mask(std::uint32_t id, std::uint32_t mask) {
    state_->at(id).mask = mask;
    state_->changed = true;
}

CommitReport Scene::commit(const SceneOptions& options) {
    check_enum("quality", options.quality, Quality::high);
    check_enum("usage", options.usage, Usage::moving);
    if (!(options.refit_limit >= 0))
        throw InputError("refit_limit: expected 0 or more, given " +
                         std::to_string(options.refit_limit));
    const auto start = std::chrono::steady_clock::now();
    CommitReport report;
    std::shared_ptr<const SceneTree> tree = make_scene_tree(*state_, options, report);
    state_->tree = std::move(tree);
    state_->tree_quality = options.quality;
    state_->tree_compact = options.compact;
    for (auto& [id, geometry] : state_->geometries) geometry.changed = false;
    state_->changed = false;
    const std::chrono::duration<double, std::milli> ms = std::chrono::steady_clock::now() - start;
    report.ms = ms.count();
    return report;
}

bool Scene::committed() const { return !state_->changed; }
std::uint32_t Scene::size() const { return static_cast<std::uint32_t>(state_->geometries.size()); }
bool Scene::contains(std::uint32_t id) const { return state_->geometries.contains(id); }

Aabb Scene::bounds() const {
    const SceneTree& tree = *SceneAccess::tree(*this);
    return tree.bounds;
}

std::vector<std::uint32_t> Scene::path(std::uint32_t number) const {
    const SceneTree* tree = SceneAccess::tree(*this).get();
    std::vector<std::uint32_t> ids;
    for (std::uint32_t left = number; left != 0;) {
        if (left > tree->paths)
            throw InputError("there is no path " + std::to_string(number) + " of instances");
        const auto after = std::upper_bound(
            tree->instances.begin(), tree->instances.end(), left,
            [](std::uint32_t value, const InstanceName& name) { return value < name.number; });
        const InstanceName& name = *(after - 1);
        ids.push_back(name.id);
        left -= name.number;
        tree = name.scene.get();
    }
    return ids;
}

}  // namespace raydix
