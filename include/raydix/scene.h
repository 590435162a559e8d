// What rays are traced through: triangle meshes, spheres, capsules, points with a radius, geometry
// of the caller's own, and instances of other scenes. In float or in double. Exact rules:
// docs/contract.md 1 and 3. Common questions: docs/questions.md.
#pragma once

#include <raydix/batch.h>
#include <raydix/mesh.h>
#include <raydix/quality.h>
#include <raydix/shapes.h>
#include <raydix/transform.h>
#include <raydix/types.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace raydix {

struct Model;
template <class Scalar>
class BasicUserGeometry;  // <raydix/user_geometry.h>
template <class Scalar>
struct BasicSceneTraceOptions;

/// How much a scene changes after its first commit. Hits do not depend on it.
enum class Usage : std::uint32_t {
    fixed = 0,  // little. Meshes share trees; a change of one builds their tree again
    /// Much. Each mesh has a tree; a commit refits or builds those that changed. With both, from a
    /// mesh's second tree on, memory of one more, of its vertices and of its builds is kept. Where
    /// nothing but few instances moved, a commit works on what is above them alone.
    moving = 1,
};

struct SceneOptions {
    /// A mesh's tree of quality `high` never has a higher SAH than that of `balanced`: both are
    /// built, and the cheaper one is kept. Meshes of up to 1,024 triangles are also built as
    /// `fast`, and so are those of which the cheaper tree has a SAH above 100.
    Quality quality = Quality::balanced;
    Usage usage = Usage::fixed;
    bool compact = false;  // the small layout (WideBvhOptions::compact); no effect in double
    bool strict = false;   // a triangle or shape that would be left out is an InputError
    int threads = 0;       // 0 to 1,024; 0: all the machine has. Hits do not depend on it
    /// Usage::moving only. How many times its SAH at the build a tree may cost and still be kept:
    /// its boxes are then fitted again around the moved vertices. A tree that costs more is built
    /// again. Below 1 every changed tree is built again. A tree is also built again if it is
    /// compact, if it holds parts of triangles (quality high), or if a triangle of its mesh comes,
    /// goes, gets an area or loses it. The tree over meshes and instances follows the same rule
    /// while it holds the same of them.
    double refit_limit = 1.5;
    /// Called with the part of the commit that is done, from 0 to 1; the last call has 1. Calls
    /// come on any thread, one at a time, while other threads build. It may trace the scene. What
    /// it throws ends the commit: the scene stays as it was, and no more calls come.
    std::function<void(double)> progress = {};
};

/// What a geometry of a scene is.
enum class GeometryKind : std::uint32_t {
    mesh = 0,
    spheres = 1,
    capsules = 2,
    points = 3,  // with a radius
    user = 4,    // boxes and a function of the caller's
    instance = 5,
};

/// Options of one geometry.
struct GeometryOptions {
    /// A ray sees the geometry if this mask & the ray's is not 0, and so for each instance on the
    /// way to it.
    std::uint32_t mask = 0xFFFFFFFFu;
    std::optional<std::uint32_t> id = {};  // none: the next one
};

/// What a commit did.
struct CommitReport {
    double ms = 0;
    std::uint64_t meshes = 0, instances = 0;  // in the scene itself; meshes that have triangles
    std::uint64_t triangles = 0;              // of its meshes, those that are left out included
    std::uint64_t shapes = 0;                 // its geometries that are neither mesh nor instance
    std::uint64_t primitives = 0;             // of those shapes, left out ones included
    std::uint64_t left_out = 0;               // triangles and shapes: not finite, out of range
    std::uint64_t trees_built = 0;            // trees of triangles and shapes that were built
    std::uint64_t trees_refitted = 0;  // those whose boxes were fitted again; others were kept
    double sah_ratio = 1;  // the largest SAH after a refit / at the build. Above refit_limit: that
                           // tree was built again
    bool parts_refitted = false;  // the tree over meshes and instances was refitted, not built or
                                  // kept
    std::uint64_t bytes = 0;      // what rays read of the scene itself
    std::uint64_t paths = 0;      // ways to instances: each instance counts on every way to it
};

/// Holds meshes, shapes, and instances of other scenes, which may hold instances themselves.
///
/// Changes take effect with `commit`. Until then rays and queries meet what the last commit saw.
/// Any number of threads may trace one scene and ask it at once. Changes and commits need the scene
/// for themselves, and `commit` and the `add` of a scene also need that no scene below changes
/// meanwhile. They do not disturb rays through other scenes in which this one stands: those
/// meet what their own last commit saw.
///
/// Triangles and shapes that are not finite or out of range are left out (docs/contract.md 1): rays
/// never meet them, and the others keep their numbers. A commit counts them in its report, or
/// refuses them if its options are strict. Those in scenes that instances place are not asked
/// again.
///
/// Scalar is the type of all coordinates, float or double. A scene holds instances of scenes of its
/// own type alone. A copy is not possible; a scene that was moved from may only be assigned to or
/// destroyed.
template <class Scalar>
class BasicScene {
public:
    using Mesh = BasicMesh<Scalar>;
    using MeshView = BasicMeshView<Scalar>;
    using Transform = BasicTransform<Scalar>;
    using Box = BasicAabb<Scalar>;
    using Point = BasicVec3<Scalar>;
    using Sphere = BasicSphere<Scalar>;
    using Capsule = BasicCapsule<Scalar>;
    using Ray = BasicRay<Scalar>;
    using Hit = BasicHit<Scalar>;
    using UserGeometry = BasicUserGeometry<Scalar>;
    using TraceOptions = BasicSceneTraceOptions<Scalar>;

    /// Most levels of instances in each other.
    static constexpr std::uint32_t max_levels = 32;

    BasicScene();
    /// One mesh with id 0, copied and committed. Throws InputError as `add` and `commit` do.
    explicit BasicScene(const MeshView& mesh, const SceneOptions& options = {});
    explicit BasicScene(const Mesh& mesh, const SceneOptions& options = {});
    /// The model's meshes as geometries and its nodes as instances, committed (docs/scenes.md).
    explicit BasicScene(const Model& model, const SceneOptions& options = {});
    ~BasicScene();
    BasicScene(BasicScene&&) noexcept;
    BasicScene& operator=(BasicScene&&) noexcept;

    /// Adds a mesh, of which the scene keeps a copy. Returns its id: 0, 1, 2, ... in the order of
    /// calls, or `options.id`. An id is given once, never again after `remove`. Throws InputError,
    /// and nothing is added: an index past the vertices, vertices without triangles, an id that was
    /// given before.
    std::uint32_t add(const MeshView& mesh, const GeometryOptions& options = {});
    std::uint32_t add(const Mesh& mesh, const GeometryOptions& options = {});
    /// The same without a copy. The caller keeps the arrays until the scene ends or is committed
    /// without them, and those in which it stands are committed after that. `update` changes them.
    std::uint32_t share(const MeshView& mesh, const GeometryOptions& options = {});
    std::uint32_t share(Mesh&&, const GeometryOptions& = {}) = delete;  // would be gone at once
    /// Adds spheres, capsules, or points of one radius, of which the scene keeps a copy. `prim`
    /// counts them. Rays hit their surfaces from both sides. A ray that starts inside hits where it
    /// leaves. t is computed in double and rounded once. In double, the point of the ray at t is
    /// within 2^-50 of (distance of the origin from the shape + its length and radius) of the
    /// surface; what the ray passes or starts from within that may be hit or missed. `u` of a
    /// capsule's hit is the place along its axis, 0 at a and 1 at b; other u and v are 0. Shapes
    /// that are not finite, have a negative radius or reach beyond 1e12 are left out. In float,
    /// rays that start beyond 1.7e38 may miss shapes. Throws InputError for an id that was given
    /// before.
    std::uint32_t add(std::span<const Sphere> spheres, const GeometryOptions& options = {});
    std::uint32_t add(std::span<const Capsule> capsules, const GeometryOptions& options = {});
    std::uint32_t add(std::span<const Point> points, Scalar radius,
                      const GeometryOptions& options = {});
    /// Adds primitives that a function of the caller's intersects (user_geometry.h). The scene
    /// keeps a copy of the function and of the boxes. Throws InputError as for shapes.
    std::uint32_t add(const UserGeometry& geometry, const GeometryOptions& options = {});
    /// Adds an instance of another scene. A commit of this scene takes the other one as its own
    /// last commit left it; later commits of the other one show with the next commit of this one.
    /// The other scene may be destroyed. Throws InputError: a transform that is singular or not
    /// finite, a scene that would hold itself.
    std::uint32_t add(const BasicScene& scene, const Transform& transform,
                      const GeometryOptions& options = {});
    /// Removes a geometry. Others keep their ids; this one is not given again. Throws InputError if
    /// there is no such geometry, as all calls below do.
    void remove(std::uint32_t id);
    /// Replaces vertices and triangles of a mesh. A shared mesh stays shared, with these arrays. Of
    /// any other the triangles are copied only if they are not those of before. Large arrays are
    /// compared and copied by several threads. Throws InputError as `add` does, and for a geometry
    /// that is no mesh.
    void update(std::uint32_t id, const MeshView& mesh);
    /// Replaces shapes by others of the same kind. Throws InputError for another kind.
    void update(std::uint32_t id, std::span<const Sphere> spheres);
    void update(std::uint32_t id, std::span<const Capsule> capsules);
    void update(std::uint32_t id, std::span<const Point> points, Scalar radius);
    void update(std::uint32_t id, const UserGeometry& geometry);
    /// Moves an instance. Throws InputError as `add` does, and for a geometry that is none.
    void set_transform(std::uint32_t id, const Transform& transform);
    void set_mask(std::uint32_t id, std::uint32_t mask);

    /// Takes all changes in: rays meet them from then on. The options are those of this commit
    /// alone: what the constructor or an earlier commit was given, or a file holds, is not kept.
    /// With another quality all trees are built again. Throws InputError, and the last commit
    /// still stands: an option out of range, an instance of a scene without a commit, one that
    /// reaches beyond the range of coordinates (docs/contract.md 1), more than max_levels levels or
    /// 2^32 - 2 paths.
    CommitReport commit(const SceneOptions& options = {});
    [[nodiscard]] bool committed() const;  // nothing changed since the last commit

    /// Number of geometries. This call and the six below answer from the changes, those without a
    /// commit included.
    [[nodiscard]] std::uint32_t size() const;
    [[nodiscard]] bool contains(std::uint32_t id) const;
    [[nodiscard]] std::vector<std::uint32_t> ids() const;  // ascending
    /// Throws InputError if there is no such geometry.
    [[nodiscard]] GeometryKind kind(std::uint32_t id) const;
    /// The arrays of a mesh. They are valid until its next change. None for what is no mesh. Throws
    /// InputError if there is no such geometry.
    [[nodiscard]] std::optional<MeshView> mesh(std::uint32_t id) const;
    /// Where an instance stands. None for what is no instance. Throws InputError if there is no
    /// such geometry.
    [[nodiscard]] std::optional<Transform> transform(std::uint32_t id) const;
    /// Throws InputError if there is no such geometry.
    [[nodiscard]] std::uint32_t mask(std::uint32_t id) const;
    /// A box around what rays can hit in the last commit; triangles without area may lie outside,
    /// but not in double. lo > hi: nothing. It may be larger than needed. InputError without a
    /// commit.
    [[nodiscard]] Box bounds() const;
    /// The ids of the instances on path `number` of a hit, the outermost first, in the last commit.
    /// Empty for 0. Throws InputError without a commit, or if there is no such path.
    [[nodiscard]] std::vector<std::uint32_t> path(std::uint32_t number) const;

private:
    template <class>
    friend struct BasicSceneInternals;
    struct State;
    std::shared_ptr<State> state_;
};
extern template class BasicScene<float>;
extern template class BasicScene<double>;
using Scene = BasicScene<float>;
/// In double. Rays go through the same wide trees as in float and meet the triangles in double.
/// Hits have the bits of trees of <raydix/double.h>.
using SceneD = BasicScene<double>;

/// Says whether a hit counts: for alpha tests, the triangle that a ray starts on, masks of one's
/// own. `place` is the number of the ray in the call, 0 for a single ray. `ray` is as the caller
/// gave it.
///
/// Calls come from several threads at once and in any order. A hit may be asked about any number of
/// times, also one that turns out not to be the closest. So the answer may depend on the arguments
/// alone. A filter may itself trace and query. What it throws comes out of the call that traces.
///
/// Each triangle or shape has one hit on a ray, the first within [tmin, tmax]. Where that one is
/// refused, the ray goes on to other triangles and shapes.
template <class Scalar>
using BasicHitFilter = std::function<bool(std::size_t place, const BasicRay<Scalar>& ray,
                                          const BasicHit<Scalar>& hit)>;
using HitFilter = BasicHitFilter<float>;
using HitFilterD = BasicHitFilter<double>;

template <class Scalar>
struct BasicSceneTraceOptions {
    std::uint32_t mask = 0xFFFFFFFFu;           // of all rays
    std::span<const std::uint32_t> masks = {};  // [rays], one for each ray instead; or empty
    int threads = 0;                            // 0 to 1,024; 0: all the machine has
    SimdPath path = SimdPath::automatic;        // hits do not depend on it
    std::string isa = {};                       // of simd_instruction_sets() (wide.h); empty: best
    BasicHitFilter<Scalar> filter = {};         // empty: all hits count
    /// trace_all only: the most bytes that the call may hold. 0: half of what is left to the
    /// process (result_limit.h).
    std::uint64_t max_result_bytes = 0;
};
using SceneTraceOptions = BasicSceneTraceOptions<float>;
using SceneTraceOptionsD = BasicSceneTraceOptions<double>;

/// Finds the closest hit of each ray: the least (t, instance, geometry, prim). rays [n] -> hits
/// [n]. The hits have the same bits for every quality, layout, path, instruction set and number of
/// threads (docs/contract.md 3).
///
/// Triangles are tested by the watertight test of Woop, Benthin and Wald (2013): an edge belongs to
/// both triangles, and no ray slips between. A ray goes through the inverse of each instance in
/// double and is rounded once, where the triangles are. t stays in units of the caller's direction.
/// Invalid rays (types.h) miss and are counted.
///
/// Throws InputError: sizes that differ, a scene that was never committed, an option out of range,
/// an instruction set that this processor does not have.
TraceCounts trace(const Scene& scene, std::span<const Ray> rays, std::span<Hit> hits,
                  const SceneTraceOptions& options = {});
TraceCounts trace(const SceneD& scene, std::span<const RayD> rays, std::span<HitD> hits,
                  const SceneTraceOptionsD& options = {});
[[nodiscard]] std::vector<Hit> trace(const Scene& scene, std::span<const Ray> rays,
                                     const SceneTraceOptions& options = {});
[[nodiscard]] std::vector<HitD> trace(const SceneD& scene, std::span<const RayD> rays,
                                      const SceneTraceOptionsD& options = {});
/// Says whether each ray hits anything at all: 1 or 0. rays [n] -> occluded [n]. Errors as above.
TraceCounts trace_any(const Scene& scene, std::span<const Ray> rays,
                      std::span<std::uint8_t> occluded, const SceneTraceOptions& options = {});
TraceCounts trace_any(const SceneD& scene, std::span<const RayD> rays,
                      std::span<std::uint8_t> occluded, const SceneTraceOptionsD& options = {});

/// Finds all hits of all rays, those of one ray sorted by (t, instance, geometry, prim). Each
/// triangle or shape comes at most once on every path. An edge belongs to one of its triangles
/// here, so that the number of crossings of a closed mesh is right for rays through edges and
/// vertices too. Throws ResultTooLarge, an InputError, if the call would take more than
/// options.max_result_bytes; no hit is ever dropped. Other errors as above.
[[nodiscard]] AllHits trace_all(const Scene& scene, std::span<const Ray> rays,
                                const SceneTraceOptions& options = {});
[[nodiscard]] AllHitsD trace_all(const SceneD& scene, std::span<const RayD> rays,
                                 const SceneTraceOptionsD& options = {});

/// One ray, on the caller's thread: the same bits as in a batch. Throws InputError if the scene was
/// never committed.
[[nodiscard]] Hit closest_hit(const Scene& scene, const Ray& ray, std::uint32_t mask = 0xFFFFFFFFu);
[[nodiscard]] HitD closest_hit(const SceneD& scene, const RayD& ray,
                               std::uint32_t mask = 0xFFFFFFFFu);
[[nodiscard]] bool any_hit(const Scene& scene, const Ray& ray, std::uint32_t mask = 0xFFFFFFFFu);
[[nodiscard]] bool any_hit(const SceneD& scene, const RayD& ray, std::uint32_t mask = 0xFFFFFFFFu);
/// The same among the hits that `filter` accepts.
[[nodiscard]] Hit closest_hit(const Scene& scene, const Ray& ray, const HitFilter& filter,
                              std::uint32_t mask = 0xFFFFFFFFu);
[[nodiscard]] HitD closest_hit(const SceneD& scene, const RayD& ray, const HitFilterD& filter,
                               std::uint32_t mask = 0xFFFFFFFFu);
[[nodiscard]] bool any_hit(const Scene& scene, const Ray& ray, const HitFilter& filter,
                           std::uint32_t mask = 0xFFFFFFFFu);
[[nodiscard]] bool any_hit(const SceneD& scene, const RayD& ray, const HitFilterD& filter,
                           std::uint32_t mask = 0xFFFFFFFFu);

}  // namespace raydix
