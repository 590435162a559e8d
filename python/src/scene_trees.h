// Scenes as Python has them: what rays go through, and the trees over a mesh that other queries
// ask, each made when it is first needed. Safe for many threads that ask and one that changes.
#pragma once

#include <raydix/bvh.h>
#include <raydix/double.h>
#include <raydix/mesh.h>
#include <raydix/model.h>
#include <raydix/rdx_scene.h>
#include <raydix/refit.h>
#include <raydix/scene.h>
#include <raydix/scene_queries.h>
#include <raydix/shapes.h>
#include <raydix/solid.h>
#include <raydix/trace.h>

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "array_filter.h"
#include "attributes.h"
#include "locks.h"
#include "scene_handle.h"

namespace raydix::python {

/// The quality of trees in double, relative to the first one, as Refitter tells it in float.
class RefitterD {
public:
    /// Takes no notes of the tree yet: the first refit tells how good it was.
    RefitterD(const BvhD&, int) {}

    /// As raydix::refit.
    RefitQuality refit(BvhD& bvh, const MeshViewD& mesh, int threads);

private:
    std::optional<double> sah_at_build_;
};

/// The library's names of things in one number type.
template <class Scalar_>
struct NamesIn {
    using Scalar = Scalar_;
    static constexpr bool in_float = std::is_same_v<Scalar, float>;
    using Point = BasicVec3<Scalar>;
    using Box = BasicAabb<Scalar>;
    using Transform = BasicTransform<Scalar>;
    using Scene = BasicScene<Scalar>;
    using MeshView = BasicMeshView<Scalar>;
    using Bvh = typename BasicSolid<Scalar>::Tree;
    using Refitter = std::conditional_t<in_float, raydix::Refitter, RefitterD>;
    using Solid = BasicSolid<Scalar>;
    using Ray = BasicRay<Scalar>;
    using Hit = BasicHit<Scalar>;
    using AllHits = BasicAllHits<Scalar>;
    using ClosestPoint = BasicSceneClosestPoint<Scalar>;
    using ClosestOptions = BasicClosestOptions<Scalar>;
    using SceneClosestOptions = BasicSceneClosestOptions<Scalar>;
    using Sweep = BasicSphereSweep<Scalar>;
    using SweepHit = BasicSceneSweepHit<Scalar>;
    using Segment = BasicSegment<Scalar>;
    using Sphere = BasicSphere<Scalar>;
    using Capsule = BasicCapsule<Scalar>;
    using CameraSet = BasicCameraSet<Scalar>;
    using Rdx = BasicRdxScene<Scalar>;
};
using InFloat = NamesIn<float>;
using InDouble = NamesIn<double>;

/// A mesh in memory that stays where it is for as long as somebody looks at it. Never null.
template <class Names>
struct MeshArrays {
    using Vertices = std::vector<typename Names::Point>;
    using Triangles = std::vector<Triangle>;

    std::shared_ptr<const Vertices> vertices = std::make_shared<const Vertices>();
    std::shared_ptr<const Triangles> triangles = std::make_shared<const Triangles>();

    /// Without triangles nothing: the library would take the vertices as points.
    [[nodiscard]] typename Names::MeshView view() const {
        if (triangles->empty()) return {};
        return {*vertices, *triangles};
    }
    friend bool operator==(const MeshArrays&, const MeshArrays&) = default;
};

/// The mask of a call that is given none.
inline constexpr std::uint32_t every_bit = 0xFFFFFFFFu;

/// What a call with rays has beside them.
struct RayOptions {
    std::uint32_t mask = every_bit;
    std::span<const std::uint32_t> masks = {};  // of each ray, instead; or empty
    int threads = 0;
    std::uint64_t max_result_bytes = 0;
    const ArrayFilter* filter = nullptr;  // null: all hits count
    std::size_t first = 0;                // the filter's number of the first ray
};

/// The mesh of a scene that is one, and what answers all queries but rays. The functions that build
/// take long: call everything here without the interpreter's lock.
template <class Names>
class MeshTrees {
public:
    using Types = Names;
    using Arrays = MeshArrays<Names>;

    explicit MeshTrees(const BuildOptions& options) : options_(options) {}

    /// Held while the scene is asked; changes wait for those who hold it, and let no new ones past.
    /// Taken without the interpreter's lock; of several scenes that of the lowest address first.
    [[nodiscard]] Reading read() const;

    [[nodiscard]] const BuildOptions& options() const { return options_; }

    // While reading. All but the first throw InputError, which names the call, unless the last
    // commit saw one mesh and nothing else, or nothing at all.
    [[nodiscard]] bool is_mesh() const { return why_no_mesh_.empty(); }
    [[nodiscard]] const Arrays& mesh(const char* call) const;
    [[nodiscard]] const typename Types::Bvh& bvh(const char* call);
    [[nodiscard]] const typename Types::Solid& solid(InsideRule rule, const char* call);

protected:
    /// While writing: another mesh, whose trees are not there yet.
    void set_mesh(Arrays mesh);
    /// The same, but the binary tree has been refitted to it.
    void move_mesh(Arrays mesh);
    /// While writing: a refit has spoilt the tree, which the mesh will make again.
    void drop_trees();

    const typename Types::Bvh& bvh_locked();

    BuildOptions options_;
    mutable Locks locks_;
    std::optional<typename Types::Bvh> bvh_;
    std::string why_no_mesh_;

private:
    Arrays mesh_;
    std::array<std::optional<typename Types::Solid>, 4> solids_;  // by rule
};

extern template class MeshTrees<InFloat>;
extern template class MeshTrees<InDouble>;

/// Held while the structure of any scene changes: an instance asks what its scene holds, and that
/// one's scenes in turn.
[[nodiscard]] std::mutex& structure();

/// raydix::Scene or SceneD. Changes and commits wait for the queries of other threads; what they
/// throw leaves all answers as they were.
template <class Names>
class BasicSceneTrees : public MeshTrees<Names> {
public:
    using typename MeshTrees<Names>::Types;
    using typename MeshTrees<Names>::Arrays;
    using Scene = typename Names::Scene;
    using Transform = typename Names::Transform;
    using Vertices = typename Arrays::Vertices;
    using Ray = typename Names::Ray;
    using Hit = typename Names::Hit;
    using AllHits = typename Names::AllHits;

    /// Empty. `trees`: of the binary tree that other queries than rays ask; `commits`: of the first
    /// commit.
    BasicSceneTrees(const BuildOptions& trees, const SceneOptions& commits);
    /// One mesh with id 0, committed: its wide tree is made when a ray or a change needs it.
    /// Throws InputError: an index past the vertices, with `trees.strict` a triangle left out.
    BasicSceneTrees(Arrays mesh, const BuildOptions& trees, const SceneOptions& commits);

    // Changes: as those of raydix::Scene.
    std::uint32_t add(Arrays mesh, const GeometryOptions& options);
    /// One scene in many places, `masks` one for all or one each. All of them or none; `id` is of
    /// the first, and others follow with the next ones.
    std::vector<std::uint32_t> add(std::shared_ptr<BasicSceneTrees> scene,
                                   std::span<const Transform> transforms,
                                   std::span<const std::uint32_t> masks,
                                   std::optional<std::uint32_t> id);
    /// Spheres, capsules, or points of one radius, copied. add(scene, options) and
    /// update(scene, id) are calls of raydix::Scene.
    template <class Add>
    std::uint32_t add_shapes(const Add& add, const GeometryOptions& options);
    template <class Update>
    void update_shapes(const Update& update, std::uint32_t id);
    void remove(std::uint32_t id);
    /// Without triangles: those it has.
    void update(std::uint32_t id, Vertices vertices,
                std::optional<std::vector<Triangle>> triangles);
    /// All of them or none.
    void set_transforms(std::span<const std::uint32_t> ids, std::span<const Transform> transforms);
    void set_masks(std::span<const std::uint32_t> ids, std::span<const std::uint32_t> masks);
    /// Null: takes it away. Throws InputError: no such geometry, no mesh.
    void set_attribute(std::uint32_t id, const std::string& name,
                       typename Attributes<typename Names::Scalar>::Value value);
    CommitReport commit(const SceneOptions& options);
    /// Moves the vertices of the one mesh that the scene holds, in the binary tree and in the wide
    /// one. Throws InputError as Refitter::refit does, and if there are changes without a commit.
    RefitQuality refit(Vertices vertices, int threads);

    /// Those that a scene of a file does not come with: of the binary tree, and of later commits.
    void set_options(const BuildOptions& trees, double refit_limit);

    // While reading.
    /// Of the last commit.
    [[nodiscard]] const SceneOptions& commit_options() const { return commits_; }
    [[nodiscard]] bool committed();
    [[nodiscard]] bool contains(std::uint32_t id) const { return scene_.contains(id); }
    [[nodiscard]] std::vector<std::uint32_t> ids() const;
    /// How many ids were ever given, those of removed geometries too. Of a scene from a .rdx file,
    /// which may have given more than it holds, a number above that of its geometries.
    [[nodiscard]] std::uint64_t ids_given() const { return ids_given_; }
    /// Of the mesh, if the last commit saw one and nothing else.
    [[nodiscard]] std::optional<std::uint32_t> mesh_id() const { return mesh_id_; }
    /// Its mask; 0 if there is none.
    [[nodiscard]] std::uint32_t mesh_mask() const { return mesh_mask_; }
    /// Whether a mask shows the mesh of a scene that is one. That of all bits always does.
    [[nodiscard]] bool shows_mesh(std::uint32_t mask) const {
        return mask == every_bit || (mask & mesh_mask_) != 0;
    }
    /// Of any geometry, changes without a commit included. Throws InputError: there is none.
    [[nodiscard]] std::uint32_t mask_of(std::uint32_t id) const { return scene_.mask(id); }
    /// Those of a mesh; a copy of what still lies in the file of the scene. None of all else.
    [[nodiscard]] std::optional<Arrays> mesh_arrays(std::uint32_t id) const;
    /// Of a mesh, changes without a commit included; else none.
    [[nodiscard]] std::map<std::string, typename Attributes<typename Names::Scalar>::Value>
    attributes(std::uint32_t id) const;
    /// By the last commit, of what rays hit there; nothing if it has none of that name. Throws
    /// InputError: no such path.
    [[nodiscard]] std::optional<typename Attributes<typename Names::Scalar>::Found> attribute(
        std::uint32_t path, std::uint32_t id, const std::string& name);
    /// By the last commit, of any mesh of the scene itself.
    [[nodiscard]] std::optional<typename Attributes<typename Names::Scalar>::Found> any_attribute(
        const std::string& name) const;
    /// As the last commit left it. Throws InputError, as its functions do, if there was none.
    [[nodiscard]] const Scene& traced();
    /// The same with its locks, for another module.
    [[nodiscard]] LentScene<typename Names::Scalar> lend();

    using Point = typename Names::Point;
    QueryCounts closest_points(std::span<const Point> queries,
                               std::span<typename Names::ClosestPoint> results,
                               const typename Names::SceneClosestOptions& options);
    template <class Shape>
    [[nodiscard]] SceneOverlapLists touch_all(std::span<const Shape> queries,
                                              const SceneOverlapOptions& options);
    template <class Shape>
    QueryCounts touch_any(std::span<const Shape> queries, std::span<std::uint8_t> touched,
                          const SceneOverlapOptions& options);
    QueryCounts sweep_spheres(std::span<const typename Names::Sweep> sweeps,
                              std::span<typename Names::SweepHit> hits,
                              const SceneOverlapOptions& options);
    /// All meshes that the mask shows as one body. Throws InputError, which names the call: what
    /// raydix::Solid throws. The last mask's body is kept for each rule.
    [[nodiscard]] std::shared_ptr<const typename Names::Solid> solid(InsideRule rule,
                                                                     std::uint32_t mask,
                                                                     const char* call);

    TraceCounts trace(std::span<const Ray> rays, std::span<Hit> hits, const RayOptions& options);
    TraceCounts trace_any(std::span<const Ray> rays, std::span<std::uint8_t> occluded,
                          const RayOptions& options);
    [[nodiscard]] AllHits trace_all(std::span<const Ray> rays, const RayOptions& options);
    [[nodiscard]] Hit closest_hit(const Ray& ray, std::uint32_t mask);
    [[nodiscard]] bool any_hit(const Ray& ray, std::uint32_t mask);

private:
    friend struct SceneFiles;
    using MeshTrees<Names>::bvh_;
    using MeshTrees<Names>::locks_;
    using MeshTrees<Names>::options_;
    using MeshTrees<Names>::why_no_mesh_;

    using MeshAttributes = Attributes<typename Names::Scalar>;
    /// What a commit may still read, meshes of the scene and of those that it places, and what its
    /// vertices carry.
    struct Kept {
        std::vector<Arrays> meshes;
        // By id, ascending: of meshes and of instances.
        std::vector<std::pair<std::uint32_t, std::shared_ptr<const MeshAttributes>>> attributes;
        std::vector<std::pair<std::uint32_t, std::shared_ptr<const Kept>>> placed;
    };
    /// A scene that this one places, once for all its instances, and what it kept at the commit.
    struct Below {
        BasicSceneTrees* scene;  // held by geometries_ as long as members_changed_ is false
        std::shared_ptr<const Kept> kept;
    };
    struct Geometry {
        bool is_instance = false;
        bool is_shapes = false;  // whose arrays the library has
        std::uint32_t mask = 0xFFFFFFFFu;
        Arrays mesh = {};                                 // empty while `is_in_file`
        std::shared_ptr<MeshAttributes> attributes = {};  // null unless it is a mesh
        std::shared_ptr<BasicSceneTrees> scene =
            {};                   // of an instance; null if it comes from a file
        bool is_in_file = false;  // the arrays of the mesh are those that the scene came with
    };

    void check_strict(const std::string& name, const typename Names::MeshView& mesh) const;
    void check_places(std::span<const std::uint32_t> ids, std::span<const Transform> transforms);
    static void check_transforms(std::span<const Transform> transforms);
    Geometry& at(std::uint32_t id);
    /// Of a mesh: its arrays, copied if they are still those of a file.
    const Arrays& arrays_of(std::uint32_t id, Geometry& geometry);
    [[nodiscard]] static Arrays copied(const typename Names::MeshView& mesh);
    /// While writing, or with `locks_.build()` locked: the first commit of a scene that was made
    /// from a mesh.
    void settle();
    CommitReport commit_now(SceneOptions options);
    /// While writing, with the scenes that are placed held: of all geometries as they are.
    [[nodiscard]] std::vector<Below> placed_scenes() const;
    [[nodiscard]] std::shared_ptr<const Kept> keep() const;
    void look_for_mesh();
    /// Of this scene and all that it places, each once, `known` aside.
    void read_all(std::set<const BasicSceneTrees*>& known, std::vector<Reading>& locks) const;

    SceneOptions commits_;
    Scene scene_;
    bool unsettled_ = false;
    std::uint64_t ids_given_ = 0;
    std::map<std::uint32_t, Geometry> geometries_;
    std::shared_ptr<const Kept> kept_ = std::make_shared<const Kept>();
    bool members_changed_ = true;  // geometries, or arrays of theirs, since the last commit
    std::vector<Below> below_;     // at the last commit
    std::optional<std::uint32_t> mesh_id_;
    std::uint32_t mesh_mask_ = 0;
    std::optional<typename Names::Refitter> refitter_;
    /// Of what a mask shows.
    struct KeptSolid {
        std::uint32_t mask = 0;
        std::shared_ptr<const typename Names::Solid> solid = {};  // null: not made
    };
    std::array<KeptSolid, 4> scene_solids_;  // by rule, if not a mesh's
};

template <class Names>
template <class Add>
std::uint32_t BasicSceneTrees<Names>::add_shapes(const Add& add, const GeometryOptions& options) {
    const Writing lock("add", locks_);
    settle();
    const std::lock_guard all(structure());
    members_changed_ = true;
    const std::uint32_t id = add(scene_, options);
    geometries_[id] = {.is_shapes = true, .mask = options.mask};
    ++ids_given_;
    return id;
}

template <class Names>
template <class Update>
void BasicSceneTrees<Names>::update_shapes(const Update& update, std::uint32_t id) {
    const Writing lock("update", locks_);
    settle();
    update(scene_, id);
}

extern template class BasicSceneTrees<InFloat>;
extern template class BasicSceneTrees<InDouble>;
using SceneTrees = BasicSceneTrees<InFloat>;
using SceneTreesD = BasicSceneTrees<InDouble>;

/// Scenes of files: in float, but for those of .rdx files, which may be in double.
struct SceneFiles {
    /// What a file holds, committed: with ids as raydix::Scene gives them. One mesh, or several
    /// without nodes, wait for their first ray or change as a scene of one mesh does.
    [[nodiscard]] static std::shared_ptr<SceneTrees> scene_of(Model model,
                                                              const BuildOptions& trees,
                                                              const SceneOptions& commits);
    /// What a .rdx file holds, with the options of its commits.
    template <class Names>
    [[nodiscard]] static std::shared_ptr<BasicSceneTrees<Names>> scene_of_rdx(
        typename Names::Rdx file, const BuildOptions& trees);
};

}  // namespace raydix::python
