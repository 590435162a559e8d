// Scene: ids, changes and commits; the work is in commit.cpp and scene_trace.cpp.
#include <raydix/double.h>
#include <raydix/error.h>
#include <raydix/scene.h>
#include <raydix/user_geometry.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "base/float_env.h"
#include "base/options.h"
#include "engine/commit.h"
#include "engine/moved_instances.h"
#include "engine/scene_state.h"
#include "engine/settled.h"
#include "exec/large_pages.h"
#include "exec/parallel.h"

namespace raydix {
namespace {

std::string name_of(std::uint32_t id) { return "geometry " + std::to_string(id); }

template <class Geometry>
GeometryKind kind_of_geometry(const Geometry& geometry) {
    if (geometry.is_instance()) return GeometryKind::instance;
    return geometry.shapes ? geometry_kind_of(*geometry.shapes) : GeometryKind::mesh;
}
template <class Geometry>
const char* what_is(const Geometry& geometry) {
    return name_of_kind(kind_of_geometry(geometry));
}

constexpr std::size_t triangles_a_range = 65536;
constexpr std::size_t elements_a_range = 32768;

/// Whether all indices are below `count`.
bool are_below(std::span<const Triangle> triangles, std::size_t count) {
    std::atomic<std::uint32_t> most = 0;
    for_each_range(triangles.size(), triangles_a_range, [&](std::size_t begin, std::size_t end) {
        std::uint32_t found = 0;
        for (std::size_t i = begin; i < end; ++i)
            found = std::max({found, triangles[i][0], triangles[i][1], triangles[i][2]});
        std::uint32_t known = most.load();
        while (known < found && !most.compare_exchange_weak(known, found)) {
        }
    });
    return triangles.empty() || most.load() < count;
}

bool are_equal(std::span<const Triangle> a, std::span<const Triangle> b) {
    if (a.size() != b.size()) return false;
    if (a.data() == b.data()) return true;
    std::atomic<bool> equal = true;
    for_each_range(a.size(), triangles_a_range, [&](std::size_t begin, std::size_t end) {
        if (equal && !std::equal(a.data() + begin, a.data() + end, b.data() + begin)) equal = false;
    });
    return equal;
}

constexpr std::size_t most_primitives = 0x7FFFFFFF, most_vertices = 0xFFFFFFFF;

/// Before the first of them is read: a wrong count is not to be followed.
void check_count(const std::string& name, std::size_t count, const char* what,
                 std::size_t most = most_primitives) {
    if (count > most)
        throw InputError(name + ": " + std::to_string(count) + " " + what +
                         "; a geometry holds at most " + std::to_string(most));
}

template <class AnyMeshView>
void check_mesh_size(const std::string& name, const AnyMeshView& mesh) {
    check_count(name, mesh.triangles.size(), "triangles");
    check_count(name, mesh.vertices.size(), "vertices", most_vertices);
}

template <class AnyMeshView>
void check_mesh(const std::string& name, const AnyMeshView& mesh) {
    if (mesh.triangles.empty() && !mesh.vertices.empty())
        throw InputError(name + ": vertices without triangles");
    if (are_below(mesh.triangles, mesh.vertices.size())) return;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        const Triangle& t = mesh.triangles[i];
        if (std::max({t[0], t[1], t[2]}) >= mesh.vertices.size())
            throw InputError(name + ": triangle " + std::to_string(i) + " has an index past the " +
                             std::to_string(mesh.vertices.size()) + " vertices");
    }
}

/// Whether these are the triangles that the geometry has a copy of.
template <class Geometry, class AnyMeshView>
bool keeps_triangles(const Geometry& geometry, const AnyMeshView& mesh) {
    return geometry.arrays && are_equal(geometry.arrays->triangles->view(), mesh.triangles);
}

/// All threads touch the memory for the first time, which takes longer than copying.
template <class T>
void copy_to(Buffer<T>& copy, std::span<const T> from) {
    const LargePages large;
    copy.reset(from.size());
    for_each_range(from.size(), elements_a_range, [&](std::size_t begin, std::size_t end) {
        std::copy(from.data() + begin, from.data() + end, copy.data() + begin);
    });
}

/// In memory of vertices that nobody holds any more, where there is some.
template <class Arrays, class Point>
auto copy_of_vertices(Arrays& arrays, std::span<const Point> from) {
    auto copy = arrays.memory.take();
    if (copy == nullptr) copy = std::make_unique<Buffer<Point>>();
    copy_to(*copy, from);
    return arrays.memory.share(std::move(copy));
}

/// `same_triangles`: keeps_triangles(geometry, mesh).
template <class Geometry, class AnyMeshView>
void set_mesh(Geometry& geometry, const AnyMeshView& mesh, bool shared, bool same_triangles) {
    if (shared) {
        geometry.own = nullptr;
        geometry.mesh = mesh;
    } else {
        using Arrays = typename decltype(geometry.arrays)::value_type;
        Arrays arrays = geometry.arrays ? *geometry.arrays : Arrays{};
        if (!same_triangles) {
            const auto triangles = std::make_shared<Buffer<Triangle>>();
            copy_to(*triangles, mesh.triangles);
            arrays.triangles = triangles;
        }
        arrays.vertices = copy_of_vertices(arrays, mesh.vertices);
        geometry.own = std::make_shared<
            const std::pair<decltype(arrays.triangles), decltype(arrays.vertices)>>(
            arrays.triangles, arrays.vertices);
        geometry.mesh = {arrays.vertices->view(), arrays.triangles->view()};
        geometry.arrays = std::move(arrays);
    }
    geometry.shared = shared;
    geometry.changed = true;
}

/// Copies of what is given, as shapes that view them.
template <class Array>
auto copied(std::span<const Array> from) {
    return std::make_shared<const std::vector<Array>>(from.begin(), from.end());
}
template <class Geometry, class Scalar>
void set_shapes(Geometry& geometry, const BasicShapes<Scalar>& shapes) {
    std::visit(
        [&](const auto& all) {
            using All = std::remove_cvref_t<decltype(all)>;
            if constexpr (std::is_same_v<All, BasicBalls<Scalar>>) {
                const auto own = copied(all.centers);
                geometry.own = own;
                geometry.shapes = BasicBalls<Scalar>{*own, all.radius};
            } else if constexpr (std::is_same_v<All, BasicUserGeometry<Scalar>>) {
                const auto own = copied(all.boxes());
                geometry.own = own;
                geometry.shapes = all.around(*own);
            } else {
                const auto own = copied(all);
                geometry.own = own;
                geometry.shapes = All(*own);
            }
        },
        shapes);
    geometry.changed = true;
}

template <class State>
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

/// The geometry is complete. Where memory ends, the state is as it was.
template <class State>
std::uint32_t insert(State& state, std::uint32_t id, typename State::Geometry geometry) {
    decltype(state.geometries) added;
    added.emplace(id, std::move(geometry));
    state.taken.insert(id);
    state.in_a_row.clear();
    state.geometries.merge(added);  // takes no memory
    while (!state.taken.empty() && *state.taken.begin() == state.next_id) {
        state.taken.erase(state.taken.begin());
        ++state.next_id;
    }
    state.note_change();
    return id;
}

template <class State, class AnyMeshView>
std::uint32_t add_mesh(State& state, const AnyMeshView& mesh, const GeometryOptions& options,
                       bool shared) {
    const std::uint32_t id = new_id(state, options.id);
    check_mesh_size(name_of(id), mesh);
    check_mesh(name_of(id), mesh);
    typename State::Geometry geometry;
    geometry.mask = options.mask;
    set_mesh(geometry, mesh, shared, false);
    return insert(state, id, std::move(geometry));
}

template <class Scalar, class State>
std::uint32_t add_shapes(State& state, const BasicShapes<Scalar>& shapes,
                         const GeometryOptions& options) {
    const std::uint32_t id = new_id(state, options.id);
    check_count(name_of(id), count_of(shapes), "primitives");
    typename State::Geometry geometry;
    geometry.mask = options.mask;
    set_shapes<typename State::Geometry, Scalar>(geometry, shapes);
    return insert(state, id, std::move(geometry));
}

template <class Scalar, class State>
void update_shapes(State& state, std::uint32_t id, const BasicShapes<Scalar>& shapes) {
    auto& geometry = state.at(id);
    if (!geometry.shapes || geometry.shapes->index() != shapes.index())
        throw InputError(name_of(id) + " is " + what_is(geometry) + ", not " + kind_of(shapes));
    check_count(name_of(id), count_of(shapes), "primitives");
    set_shapes<typename State::Geometry, Scalar>(geometry, shapes);
    state.note_change();
}

std::optional<SceneKind<float>::WayBack> way_back(const Transform& transform) {
    const Affine there = affine_of(transform);
    const std::optional<Affine> inverse = inverse_of(there);
    if (!inverse) return {};
    return SceneKind<float>::WayBack{*inverse, errors_of(there, *inverse)};
}
std::optional<SceneKind<double>::WayBack> way_back(const TransformD& transform) {
    const std::optional<InverseD> inverse = inverse_of(affine_of(transform));
    if (!inverse) return {};
    return SceneKind<double>::WayBack{*inverse};
}

}  // namespace

/// The last scene that stands in one ends within its destructor, and so on inward: below a depth
/// the outermost one goes on with what is left, since a long chain would not fit a thread's stack.
template <class Scalar>
BasicScene<Scalar>::State::~State() {
    constexpr int most_depth = 2 * static_cast<int>(max_levels);
    static thread_local int depth = 0;
    static thread_local std::multimap<std::uint32_t, Geometry>* left = nullptr;
    if (depth == most_depth) {
        left->merge(geometries);  // takes no memory
        return;
    }
    std::multimap<std::uint32_t, Geometry> own;
    if (depth == 0) left = &own;
    ++depth;
    geometries.clear();
    while (!own.empty()) own.erase(own.begin());
    --depth;
}

template <class Scalar>
auto BasicScene<Scalar>::State::at(std::uint32_t id) -> Geometry& {
    if (id < in_a_row.size() && in_a_row[id].first == id) return *in_a_row[id].second;
    const auto found = geometries.find(id);
    if (found == geometries.end()) throw InputError("there is no " + name_of(id));
    return found->second;
}

template <class Scalar>
void BasicScene<Scalar>::State::put_in_a_row() {
    if (!in_a_row.empty()) return;
    in_a_row.reserve(geometries.size());
    for (auto& [id, geometry] : geometries) in_a_row.emplace_back(id, &geometry);
}

template <class Scalar>
void BasicScene<Scalar>::State::note_change() noexcept {
    changed = true;
    only_moved = false;
    moved.clear();
}

template <class Scalar>
void BasicScene<Scalar>::State::note_move(std::uint32_t id) noexcept {
    if (!changed) only_moved = true;
    changed = true;
    if (!only_moved || (!moved.empty() && moved.back() == id)) return;
    try {
        if (moved.size() >= geometries.size()) return note_change();
        moved.push_back(id);
    } catch (const std::bad_alloc&) {
        note_change();
    }
}

template <class Scalar>
void BasicScene<Scalar>::State::take(std::shared_ptr<const typename SceneKind<Scalar>::Tree> made,
                                     const CommitReport& told, double limit) {
    auto scenes = scenes_below(geometries, *made);  // no memory: the last commit still stands
    below.swap(scenes);
    tree = std::move(made);
    report = told;
    refit_limit = limit;
    for (const auto& mesh : tree->mesh_names) at(mesh.id).changed = false;
    for (const auto& shapes : tree->shapes) at(shapes->id).changed = false;
    changed = only_moved = false;
    moved.clear();
}

template <class Scalar>
bool BasicScene<Scalar>::State::holds(const State* other) const {
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

template <class Scalar>
auto BasicSceneInternals<Scalar>::tree(const Scene& scene) -> const std::shared_ptr<const Tree>& {
    if (scene.state_->tree == nullptr) throw InputError("scene: it was never committed");
    return scene.state_->tree;
}

template <class Scalar>
void BasicSceneInternals<Scalar>::place(std::uint32_t id, const BasicTransform<Scalar>& transform,
                                        typename State::Geometry& geometry) {
    const FloatEnvironment plain;
    const auto back = way_back(transform);
    if (!back)
        throw InputError("instance " + std::to_string(id) +
                         ": its transform is singular or not finite, so rays cannot go through it");
    geometry.transform = transform;
    static_cast<typename SceneKind<Scalar>::WayBack&>(geometry) = *back;
}

template <class Scalar>
BasicScene<Scalar>::BasicScene() : state_(std::make_shared<State>()) {}
template <class Scalar>
BasicScene<Scalar>::BasicScene(const MeshView& mesh, const SceneOptions& options) : BasicScene() {
    add(mesh);
    commit(options);
}
template <class Scalar>
BasicScene<Scalar>::BasicScene(const Mesh& mesh, const SceneOptions& options)
    : BasicScene(MeshView(mesh), options) {}
template <class Scalar>
BasicScene<Scalar>::~BasicScene() = default;
template <class Scalar>
BasicScene<Scalar>::BasicScene(BasicScene&&) noexcept = default;
template <class Scalar>
BasicScene<Scalar>& BasicScene<Scalar>::operator=(BasicScene&&) noexcept = default;

template <class Scalar>
std::uint32_t BasicScene<Scalar>::add(const MeshView& mesh, const GeometryOptions& options) {
    return add_mesh(*state_, mesh, options, false);
}
template <class Scalar>
std::uint32_t BasicScene<Scalar>::add(const Mesh& mesh, const GeometryOptions& options) {
    return add(MeshView(mesh), options);
}
template <class Scalar>
std::uint32_t BasicScene<Scalar>::share(const MeshView& mesh, const GeometryOptions& options) {
    return add_mesh(*state_, mesh, options, true);
}

template <class Scalar>
std::uint32_t BasicScene<Scalar>::add(std::span<const Sphere> spheres,
                                      const GeometryOptions& options) {
    return add_shapes<Scalar>(*state_, BasicShapes<Scalar>(spheres), options);
}
template <class Scalar>
std::uint32_t BasicScene<Scalar>::add(std::span<const Capsule> capsules,
                                      const GeometryOptions& options) {
    return add_shapes<Scalar>(*state_, BasicShapes<Scalar>(capsules), options);
}
template <class Scalar>
std::uint32_t BasicScene<Scalar>::add(std::span<const Point> points, Scalar radius,
                                      const GeometryOptions& options) {
    return add_shapes<Scalar>(*state_, BasicShapes<Scalar>(BasicBalls<Scalar>{points, radius}),
                              options);
}
template <class Scalar>
std::uint32_t BasicScene<Scalar>::add(const UserGeometry& geometry,
                                      const GeometryOptions& options) {
    return add_shapes<Scalar>(*state_, BasicShapes<Scalar>(geometry), options);
}

template <class Scalar>
std::uint32_t BasicScene<Scalar>::add(const BasicScene& scene, const Transform& transform,
                                      const GeometryOptions& options) {
    const std::uint32_t id = new_id(*state_, options.id);
    // A scene that only its handle has stands in no other one.
    if (scene.state_ == state_ || (state_.use_count() > 1 && scene.state_->holds(state_.get())))
        throw InputError("instance " + std::to_string(id) + ": the scene would hold itself");
    typename State::Geometry geometry;
    geometry.mask = options.mask;
    BasicSceneInternals<Scalar>::place(id, transform, geometry);
    geometry.scene = scene.state_;
    return insert(*state_, id, std::move(geometry));
}

template <class Scalar>
void BasicScene<Scalar>::remove(std::uint32_t id) {
    static_cast<void>(state_->at(id));
    state_->in_a_row.clear();
    state_->geometries.erase(id);
    state_->note_change();
}

template <class Scalar>
void BasicScene<Scalar>::update(std::uint32_t id, const MeshView& mesh) {
    auto& geometry = state_->at(id);
    if (!geometry.is_mesh())
        throw InputError(name_of(id) + " is " + what_is(geometry) + ", not a mesh");
    check_mesh_size(name_of(id), mesh);
    const bool same_triangles =
        !geometry.shared && !mesh.triangles.empty() && keeps_triangles(geometry, mesh);
    if (!same_triangles || mesh.vertices.size() < geometry.mesh.vertices.size())
        check_mesh(name_of(id), mesh);
    set_mesh(geometry, mesh, geometry.shared, same_triangles);
    state_->note_change();
}

template <class Scalar>
void BasicScene<Scalar>::update(std::uint32_t id, std::span<const Sphere> spheres) {
    update_shapes<Scalar>(*state_, id, BasicShapes<Scalar>(spheres));
}
template <class Scalar>
void BasicScene<Scalar>::update(std::uint32_t id, std::span<const Capsule> capsules) {
    update_shapes<Scalar>(*state_, id, BasicShapes<Scalar>(capsules));
}
template <class Scalar>
void BasicScene<Scalar>::update(std::uint32_t id, std::span<const Point> points, Scalar radius) {
    update_shapes<Scalar>(*state_, id, BasicShapes<Scalar>(BasicBalls<Scalar>{points, radius}));
}
template <class Scalar>
void BasicScene<Scalar>::update(std::uint32_t id, const UserGeometry& geometry) {
    update_shapes<Scalar>(*state_, id, BasicShapes<Scalar>(geometry));
}

template <class Scalar>
void BasicScene<Scalar>::set_transform(std::uint32_t id, const Transform& transform) {
    auto& geometry = state_->at(id);
    if (!geometry.is_instance())
        throw InputError(name_of(id) + " is " + what_is(geometry) + ", not an instance");
    BasicSceneInternals<Scalar>::place(id, transform, geometry);
    state_->note_move(id);
}

template <class Scalar>
void BasicScene<Scalar>::set_mask(std::uint32_t id, std::uint32_t mask) {
    auto& geometry = state_->at(id);
    geometry.mask = mask;
    if (geometry.is_instance())
        state_->note_move(id);
    else
        state_->note_change();
}

template <class Scalar>
CommitReport BasicScene<Scalar>::commit(const SceneOptions& options) {
    check_enum("quality", options.quality, Quality::high);
    check_enum("usage", options.usage, Usage::moving);
    if (!(options.refit_limit >= 0))
        throw InputError("refit_limit: expected 0 or more, given " +
                         std::to_string(options.refit_limit));
    const auto start = std::chrono::steady_clock::now();
    CommitReport report;
    state_->put_in_a_row();
    if (!take_moves(*state_, options, report)) {
        auto tree = make_scene_tree(*state_, options, report);
        if (tree != state_->tree) state_->take(std::move(tree), report, options.refit_limit);
    }
    const std::chrono::duration<double, std::milli> ms = std::chrono::steady_clock::now() - start;
    report.ms = ms.count();
    return report;
}

template <class Scalar>
bool BasicScene<Scalar>::committed() const {
    return !state_->changed;
}
template <class Scalar>
std::uint32_t BasicScene<Scalar>::size() const {
    return static_cast<std::uint32_t>(state_->geometries.size());
}
template <class Scalar>
bool BasicScene<Scalar>::contains(std::uint32_t id) const {
    return state_->geometries.contains(id);
}

template <class Scalar>
std::vector<std::uint32_t> BasicScene<Scalar>::ids() const {
    std::vector<std::uint32_t> all;
    all.reserve(state_->geometries.size());
    for (const auto& [id, geometry] : state_->geometries) all.push_back(id);
    return all;
}

template <class Scalar>
GeometryKind BasicScene<Scalar>::kind(std::uint32_t id) const {
    return kind_of_geometry(state_->at(id));
}

template <class Scalar>
auto BasicScene<Scalar>::transform(std::uint32_t id) const -> std::optional<Transform> {
    const auto& geometry = state_->at(id);
    if (!geometry.is_instance()) return {};
    return geometry.transform;
}

template <class Scalar>
auto BasicScene<Scalar>::mesh(std::uint32_t id) const -> std::optional<MeshView> {
    const auto& geometry = state_->at(id);
    if (!geometry.is_mesh()) return {};
    return geometry.mesh;
}

template <class Scalar>
std::uint32_t BasicScene<Scalar>::mask(std::uint32_t id) const {
    return state_->at(id).mask;
}

template <class Scalar>
BasicAabb<Scalar> BasicScene<Scalar>::bounds() const {
    return BasicSceneInternals<Scalar>::tree(*this)->bounds;
}

template <class Scalar>
std::vector<std::uint32_t> BasicScene<Scalar>::path(std::uint32_t number) const {
    const auto* tree = BasicSceneInternals<Scalar>::tree(*this).get();
    std::vector<std::uint32_t> ids;
    for (std::uint32_t left = number; left != 0;) {
        if (left > tree->paths)
            throw InputError("there is no path " + std::to_string(number) + " of instances");
        const auto after = std::upper_bound(
            tree->instances.begin(), tree->instances.end(), left,
            [](std::uint32_t value, const auto& name) { return value < name.number; });
        const auto& name = *(after - 1);
        ids.push_back(name.id);
        left -= name.number;
        tree = name.scene.get();
    }
    return ids;
}

template class BasicScene<float>;
template class BasicScene<double>;
template struct BasicSceneInternals<float>;
template struct BasicSceneInternals<double>;

}  // namespace raydix
