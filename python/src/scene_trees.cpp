// Changes and commits of scenes, and rays through them.
#include "scene_trees.h"

#include <raydix/error.h>

#include <algorithm>
#include <limits>
#include <set>
#include <string>
#include <type_traits>
#include <utility>

#include "batch.h"
#include "strict_meshes.h"

namespace raydix::python {

std::mutex& structure() {
    static Locks locks;
    return locks.build();
}

namespace {

/// Throws InputError, with the first rays of a call, as require_lengths does.
template <class Scalar>
BasicSceneTraceOptions<Scalar> trace_options(const BasicScene<Scalar>& scene,
                                             const RayOptions& options) {
    BasicSceneTraceOptions<Scalar> out;
    out.mask = options.mask;
    out.masks = options.masks;
    out.threads = options.threads;
    out.max_result_bytes = options.max_result_bytes;
    if (options.filter != nullptr) {
        if (options.first == 0) require_lengths(*options.filter, scene);
        out.filter = [filter = options.filter, first = options.first](
                         std::size_t place, const auto&, const auto& hit) {
            return filter->takes(first + place, hit);
        };
    }
    return out;
}

std::string name_of(std::uint32_t id) { return "geometry " + std::to_string(id); }

/// Throws InputError unless there is one for each, or one for all.
void require_one_each(const char* name, std::size_t given, std::size_t wanted) {
    if (given != wanted)
        throw InputError(std::string(name) + ": expected " + std::to_string(wanted) + ", given " +
                         std::to_string(given));
}

}  // namespace

template <class Names>
BasicSceneTrees<Names>::BasicSceneTrees(const BuildOptions& trees, const SceneOptions& commits)
    : MeshTrees<Names>(trees), commits_(commits) {
    why_no_mesh_ = "the scene was never committed";
}

template <class Names>
BasicSceneTrees<Names>::BasicSceneTrees(Arrays mesh, const BuildOptions& trees,
                                        const SceneOptions& commits)
    : BasicSceneTrees(trees, commits) {
    static_cast<void>(add(std::move(mesh), {}));
    kept_ = keep();
    unsettled_ = true;
    look_for_mesh();
}

template <class Names>
const typename BasicSceneTrees<Names>::Arrays& BasicSceneTrees<Names>::arrays_of(
    std::uint32_t id, Geometry& geometry) {
    if (geometry.is_in_file) {
        geometry.mesh = copied(*scene_.mesh(id));
        geometry.is_in_file = false;
    }
    return geometry.mesh;
}

template <class Names>
typename BasicSceneTrees<Names>::Arrays BasicSceneTrees<Names>::copied(
    const typename Names::MeshView& mesh) {
    using Triangles = typename Arrays::Triangles;
    return {std::make_shared<const Vertices>(mesh.vertices.begin(), mesh.vertices.end()),
            std::make_shared<const Triangles>(mesh.triangles.begin(), mesh.triangles.end())};
}

template <class Names>
std::optional<typename BasicSceneTrees<Names>::Arrays> BasicSceneTrees<Names>::mesh_arrays(
    std::uint32_t id) const {
    const auto found = geometries_.find(id);
    if (found == geometries_.end()) throw InputError("there is no " + name_of(id));
    const Geometry& geometry = found->second;
    if (geometry.is_instance || geometry.is_shapes) return std::nullopt;
    return geometry.is_in_file ? copied(*scene_.mesh(id)) : geometry.mesh;
}

template <class Names>
void BasicSceneTrees<Names>::check_strict(const std::string& name,
                                          const typename Names::MeshView& mesh) const {
    if (options_.strict) require_all_valid(name, mesh, threads_for(options_.threads));
}

template <class Names>
typename BasicSceneTrees<Names>::Geometry& BasicSceneTrees<Names>::at(std::uint32_t id) {
    const auto found = geometries_.find(id);
    if (found == geometries_.end()) throw InputError("there is no " + name_of(id));
    return found->second;
}

template <class Names>
void BasicSceneTrees<Names>::settle() {
    if (!unsettled_) return;
    const Locks::Change change(locks_);
    static_cast<void>(commit_now(commits_));
    unsettled_ = false;
}

template <class Names>
std::uint32_t BasicSceneTrees<Names>::add(Arrays mesh, const GeometryOptions& options) {
    const Writing lock("add", locks_);
    settle();
    check_strict("mesh", mesh.view());
    const std::lock_guard all(structure());
    Geometry made{.mask = options.mask,
                  .mesh = std::move(mesh),
                  .attributes = std::make_shared<MeshAttributes>()};
    members_changed_ = true;
    const std::uint32_t id = scene_.share(made.mesh.view(), options);
    try {
        geometries_.emplace(id, std::move(made));
    } catch (...) {  // no memory
        scene_.remove(id);
        throw;
    }
    ++ids_given_;
    return id;
}

template <class Names>
std::vector<std::uint32_t> BasicSceneTrees<Names>::add(std::shared_ptr<BasicSceneTrees> scene,
                                                       std::span<const Transform> transforms,
                                                       std::span<const std::uint32_t> masks,
                                                       std::optional<std::uint32_t> id) {
    if (masks.size() != 1) require_one_each("masks", masks.size(), transforms.size());
    if (transforms.size() > 1) check_transforms(transforms);
    const Writing lock("add", locks_);
    settle();
    const std::lock_guard all(structure());
    members_changed_ = true;
    std::vector<std::uint32_t> ids;
    ids.reserve(transforms.size());
    try {
        for (std::size_t i = 0; i < transforms.size(); ++i) {
            const std::uint32_t mask = masks[masks.size() == 1 ? 0 : i];
            ids.push_back(scene_.add(scene->scene_, transforms[i], {mask, id}));
            geometries_[ids.back()] = {.is_instance = true, .mask = mask, .scene = scene};
            ++ids_given_;
            id.reset();
        }
    } catch (...) {  // other than the first one: out of memory or of ids
        for (const std::uint32_t added : ids) {
            scene_.remove(added);
            geometries_.erase(added);
        }
        throw;
    }
    return ids;
}

/// Throws what Scene::add would of one of them, and says of which.
template <class Names>
void BasicSceneTrees<Names>::check_transforms(std::span<const Transform> transforms) {
    Scene tried;
    const Scene nothing;
    const std::uint32_t id = tried.add(nothing, Transform{});
    for (std::size_t i = 0; i < transforms.size(); ++i) try {
            tried.set_transform(id, transforms[i]);
        } catch (const InputError&) {
            throw InputError("transform, row " + std::to_string(i) +
                             ": it is singular or not finite, so rays cannot go through it");
        }
}

template <class Names>
void BasicSceneTrees<Names>::remove(std::uint32_t id) {
    const Writing lock("remove", locks_);
    settle();
    const std::lock_guard all(structure());
    members_changed_ = true;
    scene_.remove(id);
    geometries_.erase(id);
}

template <class Names>
void BasicSceneTrees<Names>::update(std::uint32_t id, Vertices vertices,
                                    std::optional<std::vector<Triangle>> triangles) {
    const Writing lock("update", locks_);
    Geometry& geometry = at(id);
    if (geometry.is_instance) throw InputError(name_of(id) + " is an instance, not a mesh");
    if (geometry.is_shapes) throw InputError(name_of(id) + " holds shapes, not a mesh");
    settle();
    Arrays mesh{std::make_shared<const Vertices>(std::move(vertices)),
                arrays_of(id, geometry).triangles};
    if (triangles)
        mesh.triangles = std::make_shared<const typename Arrays::Triangles>(std::move(*triangles));
    check_strict(name_of(id), mesh.view());
    auto attributes = geometry.attributes->of(mesh.vertices->size(), mesh.triangles);
    members_changed_ = true;
    scene_.update(id, mesh.view());
    geometry.attributes = std::move(attributes);
    geometry.mesh = std::move(mesh);
    geometry.is_in_file = false;
}

template <class Names>
void BasicSceneTrees<Names>::set_transforms(std::span<const std::uint32_t> ids,
                                            std::span<const Transform> transforms) {
    require_one_each("transforms", transforms.size(), ids.size());
    const Writing lock("set_transform", locks_);
    check_places(ids, transforms);
    settle();
    for (std::size_t i = 0; i < ids.size(); ++i) scene_.set_transform(ids[i], transforms[i]);
}

/// Throws what Scene::set_transform would.
template <class Names>
void BasicSceneTrees<Names>::check_places(std::span<const std::uint32_t> ids,
                                          std::span<const Transform> transforms) {
    Scene tried;
    const Scene nothing;
    for (std::size_t i = 0; i < ids.size(); ++i) {
        if (!at(ids[i]).is_instance)
            throw InputError(name_of(ids[i]) +
                             (at(ids[i]).is_shapes ? " holds shapes" : " is a mesh") +
                             ", not an instance");
        if (tried.contains(ids[i]))
            tried.set_transform(ids[i], transforms[i]);
        else
            tried.add(nothing, transforms[i], {.id = ids[i]});
    }
}

template <class Names>
void BasicSceneTrees<Names>::set_masks(std::span<const std::uint32_t> ids,
                                       std::span<const std::uint32_t> masks) {
    if (masks.size() != 1) require_one_each("masks", masks.size(), ids.size());
    const Writing lock("set_mask", locks_);
    for (const std::uint32_t id : ids) static_cast<void>(at(id));
    settle();
    for (std::size_t i = 0; i < ids.size(); ++i) {
        const std::uint32_t mask = masks[masks.size() == 1 ? 0 : i];
        scene_.set_mask(ids[i], mask);
        at(ids[i]).mask = mask;
    }
}

template <class Names>
CommitReport BasicSceneTrees<Names>::commit_now(SceneOptions options) {
    options.threads = threads_for(options.threads);
    return scene_.commit(options);
}

template <class Names>
void BasicSceneTrees<Names>::set_options(const BuildOptions& trees, double refit_limit) {
    const Writing lock("set_options", locks_);
    options_ = trees;
    this->drop_trees();
    commits_.strict = trees.strict;
    commits_.refit_limit = refit_limit;
}

template <class Names>
CommitReport BasicSceneTrees<Names>::commit(const SceneOptions& options) {
    const Writing lock("commit", locks_);
    // The scenes that this one places must stay as they are meanwhile. Past their queues: whoever
    // changes one of them may wait for somebody who waits for this.
    std::vector<Reading> reading;
    if (members_changed_) below_ = placed_scenes();
    bool same = !members_changed_;
    for (const Below& below : below_) {
        reading.emplace_back("commit", below.scene->locks_);
        const std::lock_guard build(below.scene->locks_.build());
        below.scene->settle();
        same = same && below.kept == below.scene->kept_;
    }
    auto kept = same ? kept_ : keep();
    const CommitReport report = commit_now(options);
    for (Below& below : below_) below.kept = below.scene->kept_;
    members_changed_ = false;
    commits_ = options;
    commits_.progress = nullptr;
    unsettled_ = false;
    kept_ = std::move(kept);
    look_for_mesh();
    return report;
}

template <class Names>
auto BasicSceneTrees<Names>::placed_scenes() const -> std::vector<Below> {
    std::vector<Below> below;
    std::set<const BasicSceneTrees*> known;
    for (const auto& [id, geometry] : geometries_)
        if (geometry.scene != nullptr && known.insert(geometry.scene.get()).second)
            below.push_back({geometry.scene.get(), nullptr});
    return below;
}

template <class Names>
std::shared_ptr<const typename BasicSceneTrees<Names>::Kept> BasicSceneTrees<Names>::keep() const {
    auto kept = std::make_shared<Kept>();
    for (const auto& [id, geometry] : geometries_) {
        if (!geometry.is_instance) kept->meshes.push_back(geometry.mesh);
        if (geometry.attributes != nullptr) kept->attributes.emplace_back(id, geometry.attributes);
        if (geometry.scene != nullptr) kept->placed.emplace_back(id, geometry.scene->kept_);
    }
    return kept;
}

namespace {

/// What a list by ascending ids has for one; null: nothing.
template <class Value>
const Value* find_id(const std::vector<std::pair<std::uint32_t, std::shared_ptr<const Value>>>& all,
                     std::uint32_t id) {
    const auto found =
        std::ranges::lower_bound(all, id, {}, [](const auto& entry) { return entry.first; });
    return found == all.end() || found->first != id ? nullptr : found->second.get();
}

}  // namespace

template <class Names>
void BasicSceneTrees<Names>::set_attribute(
    std::uint32_t id, const std::string& name,
    typename Attributes<typename Names::Scalar>::Value value) {
    const Writing lock("set_attributes", locks_);
    Geometry& geometry = at(id);
    if (geometry.attributes == nullptr)
        throw InputError(name_of(id) + " is no mesh whose vertices could have attributes");
    const Arrays& mesh = arrays_of(id, geometry);
    geometry.attributes->set(name, std::move(value), mesh.vertices->size(), mesh.triangles);
}

template <class Names>
std::map<std::string, typename Attributes<typename Names::Scalar>::Value>
BasicSceneTrees<Names>::attributes(std::uint32_t id) const {
    const auto found = geometries_.find(id);
    if (found == geometries_.end() || found->second.attributes == nullptr) return {};
    return found->second.attributes->all();
}

template <class Names>
std::optional<typename Attributes<typename Names::Scalar>::Found> BasicSceneTrees<Names>::attribute(
    std::uint32_t path, std::uint32_t id, const std::string& name) {
    const Kept* kept = kept_.get();
    for (const std::uint32_t step : traced().path(path)) {
        kept = find_id(kept->placed, step);
        if (kept == nullptr) return std::nullopt;
    }
    const auto* mesh = find_id(kept->attributes, id);
    return mesh == nullptr ? std::nullopt : mesh->find(name);
}

template <class Names>
std::optional<typename Attributes<typename Names::Scalar>::Found>
BasicSceneTrees<Names>::any_attribute(const std::string& name) const {
    for (const auto& [id, mesh] : kept_->attributes)
        if (auto found = mesh->find(name)) return found;
    return std::nullopt;
}

/// After a commit, or in its place.
template <class Names>
void BasicSceneTrees<Names>::look_for_mesh() {
    scene_solids_ = {};
    mesh_id_.reset();
    mesh_mask_ = 0;
    why_no_mesh_.clear();
    Arrays found;
    const auto is_mesh = [](const auto& entry) {
        return !entry.second.is_instance && !entry.second.is_shapes;
    };
    if (geometries_.size() == 1 && is_mesh(*geometries_.begin())) {
        mesh_id_ = geometries_.begin()->first;
        mesh_mask_ = geometries_.begin()->second.mask;
        found = arrays_of(*mesh_id_, geometries_.begin()->second);
    } else if (!geometries_.empty()) {
        const auto other = std::ranges::find_if_not(geometries_, is_mesh);
        const auto& named = other == geometries_.end() ? *std::next(geometries_.begin()) : *other;
        why_no_mesh_ = name_of(named.first) +
                       (named.second.is_instance ? " is an instance"
                        : named.second.is_shapes ? " holds shapes"
                                                 : " is a second mesh") +
                       ", and this call takes a scene of one mesh: Scene(vertices, faces)";
    }
    if (why_no_mesh_.empty() && found == this->mesh("")) return;
    refitter_.reset();
    this->set_mesh(std::move(found));
}

template <class Names>
RefitQuality BasicSceneTrees<Names>::refit(Vertices vertices, int threads) {
    const Writing lock("refit", locks_);
    const Arrays moved{std::make_shared<const Vertices>(std::move(vertices)),
                       this->mesh("refit").triangles};
    if (!scene_.committed() && !unsettled_)
        throw InputError("refit: the scene has changed; commit it first");
    if (!mesh_id_) return {};
    const auto spoil = [&] {
        this->drop_trees();
        refitter_.reset();
    };
    RefitQuality quality;
    if (!moved.triangles->empty()) {
        if (!refitter_) refitter_.emplace(this->bvh_locked(), threads_for(threads));
        const bool had_nodes = !this->bvh_locked().empty();
        try {
            quality = refitter_->refit(*bvh_, moved.view(), threads_for(threads));
        } catch (const InputError&) {
            // Found late, the tree is gone: the mesh is still there, and makes it again.
            if (had_nodes && bvh_->empty()) spoil();
            throw;
        } catch (...) {
            spoil();
            throw;
        }
    }
    try {
        Geometry& geometry = at(*mesh_id_);
        members_changed_ = true;
        scene_.update(*mesh_id_, moved.view());
        geometry.mesh = moved;  // the scene looks at it from here on, whatever fails
        auto kept = keep();
        if (!unsettled_) {
            SceneOptions options = commits_;
            options.usage = Usage::moving;
            options.refit_limit = std::numeric_limits<double>::infinity();
            options.threads = threads;
            static_cast<void>(commit_now(options));
        }
        kept_ = std::move(kept);
    } catch (...) {  // as after `update`: the last commit stands, with the mesh it was made of
        spoil();
        throw;
    }
    this->move_mesh(moved);
    return quality;
}

template <class Names>
bool BasicSceneTrees<Names>::committed() {
    const std::lock_guard lock(locks_.build());
    return unsettled_ || scene_.committed();
}

template <class Names>
std::vector<std::uint32_t> BasicSceneTrees<Names>::ids() const {
    std::vector<std::uint32_t> all;
    for (const auto& [id, geometry] : geometries_) all.push_back(id);
    return all;
}

template <class Names>
const typename Names::Scene& BasicSceneTrees<Names>::traced() {
    const std::lock_guard lock(locks_.build());
    settle();
    return scene_;
}

template <class Names>
LentScene<typename Names::Scalar> BasicSceneTrees<Names>::lend() {
    const auto locks = std::make_shared<std::vector<Reading>>();
    std::set<const BasicSceneTrees*> known;
    read_all(known, *locks);
    return {&traced(), kept_, locks};
}

template <class Names>
void BasicSceneTrees<Names>::read_all(std::set<const BasicSceneTrees*>& known,
                                      std::vector<Reading>& locks) const {
    if (!known.insert(this).second) return;
    locks.push_back(this->read());
    for (const auto& [id, geometry] : geometries_)
        if (geometry.scene != nullptr) geometry.scene->read_all(known, locks);
}

template <class Names>
QueryCounts BasicSceneTrees<Names>::closest_points(
    std::span<const Point> queries, std::span<typename Names::ClosestPoint> results,
    const typename Names::SceneClosestOptions& options) {
    return raydix::closest_points(traced(), queries, results, options);
}

template <class Names>
template <class Shape>
SceneOverlapLists BasicSceneTrees<Names>::touch_all(std::span<const Shape> queries,
                                                    const SceneOverlapOptions& options) {
    return raydix::touch_all(traced(), queries, options);
}

template <class Names>
template <class Shape>
QueryCounts BasicSceneTrees<Names>::touch_any(std::span<const Shape> queries,
                                              std::span<std::uint8_t> touched,
                                              const SceneOverlapOptions& options) {
    return raydix::touch_any(traced(), queries, touched, options);
}

template <class Names>
QueryCounts BasicSceneTrees<Names>::sweep_spheres(std::span<const typename Names::Sweep> sweeps,
                                                  std::span<typename Names::SweepHit> hits,
                                                  const SceneOverlapOptions& options) {
    return raydix::sweep_spheres(traced(), sweeps, hits, options);
}

template <class Names>
std::shared_ptr<const typename Names::Solid> BasicSceneTrees<Names>::solid(InsideRule rule,
                                                                           std::uint32_t mask,
                                                                           const char* call) {
    if (this->is_mesh() && shows_mesh(mask))
        return {std::shared_ptr<const void>(), &MeshTrees<Names>::solid(rule, call)};
    const std::lock_guard lock(locks_.build());
    settle();
    KeptSolid& kept = scene_solids_[static_cast<std::size_t>(rule)];
    if (kept.solid != nullptr && kept.mask == mask) return kept.solid;
    const SceneSolidOptions options{
        .rule = rule, .mask = mask, .threads = threads_for(options_.threads)};
    try {
        kept = {mask, std::make_shared<const typename Names::Solid>(scene_, options)};
    } catch (const ResultTooLarge&) {
        throw;
    } catch (const InputError& error) {
        throw InputError(std::string(call) + ": " + error.what());
    }
    return kept.solid;
}

template <class Names>
TraceCounts BasicSceneTrees<Names>::trace(std::span<const Ray> rays, std::span<Hit> hits,
                                          const RayOptions& options) {
    return raydix::trace(traced(), rays, hits, trace_options(traced(), options));
}

template <class Names>
TraceCounts BasicSceneTrees<Names>::trace_any(std::span<const Ray> rays,
                                              std::span<std::uint8_t> occluded,
                                              const RayOptions& options) {
    return raydix::trace_any(traced(), rays, occluded, trace_options(traced(), options));
}

template <class Names>
typename Names::AllHits BasicSceneTrees<Names>::trace_all(std::span<const Ray> rays,
                                                          const RayOptions& options) {
    return raydix::trace_all(traced(), rays, trace_options(traced(), options));
}

template <class Names>
typename Names::Hit BasicSceneTrees<Names>::closest_hit(const Ray& ray, std::uint32_t mask) {
    return raydix::closest_hit(traced(), ray, mask);
}

template <class Names>
bool BasicSceneTrees<Names>::any_hit(const Ray& ray, std::uint32_t mask) {
    return raydix::any_hit(traced(), ray, mask);
}

template class BasicSceneTrees<InFloat>;
template class BasicSceneTrees<InDouble>;
template QueryCounts SceneTrees::touch_any(std::span<const Segment>, std::span<std::uint8_t>,
                                           const SceneOverlapOptions&);
template QueryCounts SceneTrees::touch_any(std::span<const Sphere>, std::span<std::uint8_t>,
                                           const SceneOverlapOptions&);
template QueryCounts SceneTreesD::touch_any(std::span<const SegmentD>, std::span<std::uint8_t>,
                                            const SceneOverlapOptions&);
template QueryCounts SceneTreesD::touch_any(std::span<const SphereD>, std::span<std::uint8_t>,
                                            const SceneOverlapOptions&);
template SceneOverlapLists SceneTrees::touch_all(std::span<const Segment>,
                                                 const SceneOverlapOptions&);
template SceneOverlapLists SceneTrees::touch_all(std::span<const Sphere>,
                                                 const SceneOverlapOptions&);
template SceneOverlapLists SceneTreesD::touch_all(std::span<const SegmentD>,
                                                  const SceneOverlapOptions&);
template SceneOverlapLists SceneTreesD::touch_all(std::span<const SphereD>,
                                                  const SceneOverlapOptions&);

}  // namespace raydix::python
