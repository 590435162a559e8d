// What rays are traced through: triangle meshes, spheres, capsules, points with a radius, geometry
// of the caller's own, and instances of other scenes; in float and in double.
#pragma once

#include <raydix/bvh.h>
#include <raydix/mesh.h>
#include <raydix/trace.h>
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
struct Sphere;
struct Capsule;
struct SphereD;
struct CapsuleD;
template <class Scalar>
class BasicUserGeometry;  // <raydix/user_geometry.h>

/// What scenes of a number type take and give.
template <class Scalar>
struct SceneTypes;
template <>
struct SceneTypes<float> {
    using Transform = raydix::Transform;
    using Mesh = raydix::Mesh;
    using MeshView = raydix::MeshView;
    using Box = Aabb;
    using Point = Vec3;
    using Sphere = raydix::Sphere;
    using Capsule = raydix::Capsule;
    using Ray = raydix::Ray;
    using TreeHit = raydix::TreeHit;
    using Hit = raydix::Hit;
    using AllHits = raydix::AllHits;
};
template <>
struct SceneTypes<double> {
    using Transform = TransformD;
    using Mesh = MeshD;
    using MeshView = MeshViewD;
    using Box = AabbD;
    using Point = Vec3d;
    using Sphere = SphereD;
    using Capsule = CapsuleD;
    using Ray = RayD;
    using TreeHit = TreeHitD;
    using Hit = HitD;
    using AllHits = AllHitsD;
};

/// What happens to a scene after its first commit.
enum class Usage : std::uint32_t {
    fixed = 0,   // little: meshes share trees, and a change of one builds its tree again
    moving = 1,  // much: a tree a mesh; a commit refits or builds those of meshes that changed
};

struct SceneOptions {
    Quality quality = Quality::balanced;
    Usage usage = Usage::fixed;
    bool compact = false;  // the small layout (WideBvhOptions::compact); no effect in double
    int threads = 0;       // 0 to 1,024; 0: all the machine has. Hits do not depend on it
    /// Usage::moving: a mesh whose vertices moved keeps its tree, with boxes fitted again, while
    /// the tree's SAH is at most so many times that at its build. So does the tree over meshes and
    /// instances while it holds as many of them. Below 1: it is always built
    /// again. So are compact trees, those that hold parts of triangles (quality high), and those of
    /// meshes where a triangle comes, goes, gets an area or loses it.
    double refit_limit = 1.5;
    /// Called with the part of the commit that is done, 0..1 and at last 1, on any thread, one at a
    /// time, while others build; it may trace the scene. What it throws ends the commit, the scene
    /// as it was, and it is not called again.
    std::function<void(double)> progress = {};
};

/// Of a geometry. Rays see it if mask & their mask is not 0, and the same holds for each instance
/// on the way to it.
struct GeometryOptions {
    std::uint32_t mask = 0xFFFFFFFFu;
    std::optional<std::uint32_t> id = {};  // none: the next one
};

/// What a commit did.
struct CommitReport {
    double ms = 0;
    std::uint64_t meshes = 0, instances = 0;  // of the scene itself
    std::uint64_t triangles = 0;              // of its meshes
    std::uint64_t shapes = 0;                 // its geometries that are neither
    std::uint64_t primitives = 0;             // of those
    std::uint64_t trees_built = 0;     // of triangles and primitives; those that did not change are
                                       // kept
    std::uint64_t trees_refitted = 0;  // instead
    double sah_ratio = 1;  // the largest SAH after a refit / at the build; above refit_limit:
                           // that tree was built again
    bool parts_refitted = false;  // the tree over meshes and instances, instead of a new one
    std::uint64_t bytes = 0;      // what rays read of the scene itself
    std::uint64_t paths = 0;      // instances, counted on every way to them
};

/// Meshes, shapes, and instances of other scenes, which may hold instances themselves. Changes take
/// effect with `commit`; until then rays meet what the last one saw. Any number of threads may
/// trace a scene at once; changes and commits need it for themselves. Scalar: float or double, of
/// all coordinates; a scene holds instances of scenes of its own type.
template <class Scalar>
class BasicScene {
public:
    using Types = SceneTypes<Scalar>;
    using Mesh = typename Types::Mesh;
    using MeshView = typename Types::MeshView;
    using Transform = typename Types::Transform;
    using Box = typename Types::Box;
    using Point = typename Types::Point;
    using Sphere = typename Types::Sphere;
    using Capsule = typename Types::Capsule;
    using UserGeometry = BasicUserGeometry<Scalar>;

    /// Levels of instances, at most.
    static constexpr std::uint32_t max_levels = 32;

    BasicScene();
    /// One mesh with id 0, committed.
    explicit BasicScene(const MeshView& mesh, const SceneOptions& options = {});
    explicit BasicScene(const Mesh& mesh, const SceneOptions& options = {});
    explicit BasicScene(const Model& model, const SceneOptions& options = {});
    ~BasicScene();
    BasicScene(BasicScene&&) noexcept;
    BasicScene& operator=(BasicScene&&) noexcept;

    /// Adds a mesh, of which the scene keeps a copy. Returns its id: 0, 1, 2, ... in the order of
    /// calls. Throws InputError: an index past the vertices, vertices without triangles, an id that
    /// was used before.
    std::uint32_t add(const MeshView& mesh, const GeometryOptions& options = {});
    std::uint32_t add(const Mesh& mesh, const GeometryOptions& options = {});
    /// The same without a copy: the arrays must outlive the scene, or its last commit with this
    /// mesh.
    std::uint32_t share(const MeshView& mesh, const GeometryOptions& options = {});
    /// Adds spheres, capsules, or points of one radius, of which the scene keeps a copy: `prim`
    /// counts them. Rays hit their surfaces from both sides; one that starts inside hits where it
    /// leaves. t is computed in double and rounded once. `u` of a capsule's hit is the place along
    /// its axis, 0 at a and 1 at b; else u and v are 0. In float rays that start beyond 1.7e38 may
    /// miss them. Those that are not finite, have a negative radius or reach beyond 1e12 are left
    /// out. Throws InputError for an id that was used before.
    std::uint32_t add(std::span<const Sphere> spheres, const GeometryOptions& options = {});
    std::uint32_t add(std::span<const Capsule> capsules, const GeometryOptions& options = {});
    std::uint32_t add(std::span<const Point> points, Scalar radius,
                      const GeometryOptions& options = {});
    /// Primitives that a function of the caller's intersects. The scene keeps a copy of it and of
    /// the boxes.
    std::uint32_t add(const UserGeometry& geometry, const GeometryOptions& options = {});
    /// Places another scene: as its last commit left it when this one is committed. Throws
    /// InputError: a transform that is singular or not finite, a scene that would hold itself.
    std::uint32_t add(const BasicScene& scene, const Transform& transform,
                      const GeometryOptions& options = {});
    /// The id is not given again. Throws InputError if there is no such geometry; so do all below.
    void remove(std::uint32_t id);
    /// Other vertices or triangles. A shared mesh stays shared, with these arrays.
    void update(std::uint32_t id, const MeshView& mesh);
    /// Other shapes of the same kind.
    void update(std::uint32_t id, std::span<const Sphere> spheres);
    void update(std::uint32_t id, std::span<const Capsule> capsules);
    void update(std::uint32_t id, std::span<const Point> points, Scalar radius);
    void update(std::uint32_t id, const UserGeometry& geometry);
    void set_transform(std::uint32_t id, const Transform& transform);
    void set_mask(std::uint32_t id, std::uint32_t mask);

    /// Takes all changes in. Throws InputError, the last commit still stands: an instance of a
    /// scene without a commit, one that reaches beyond the range of coordinates (contract.md 1),
    /// more than max_levels levels or 2^32 - 2 paths.
    CommitReport commit(const SceneOptions& options = {});
    [[nodiscard]] bool committed() const;  // nothing changed since the last commit

    [[nodiscard]] std::uint32_t size() const;  // geometries
    [[nodiscard]] bool contains(std::uint32_t id) const;
    [[nodiscard]] std::vector<std::uint32_t> ids() const;  // ascending
    /// The arrays of a mesh, changes without a commit included: valid until its next change. None
    /// for an instance. Throws InputError if there is no such geometry.
    [[nodiscard]] std::optional<MeshView> mesh(std::uint32_t id) const;
    /// Throws InputError if there is no such geometry.
    [[nodiscard]] std::uint32_t mask(std::uint32_t id) const;
    /// Of the last commit: around all triangles and shapes; lo > hi if there are none.
    [[nodiscard]] Box bounds() const;
    /// Of the last commit: the ids of the instances on path `number` of a hit, the outermost first.
    /// Empty for 0. Throws InputError if there is no such path.
    [[nodiscard]] std::vector<std::uint32_t> path(std::uint32_t number) const;

private:
    template <class>
    friend struct BasicSceneAccess;
    struct State;
    std::shared_ptr<State> state_;
};
extern template class BasicScene<float>;
extern template class BasicScene<double>;
using Scene = BasicScene<float>;
/// In double: hits have the bits of trees of <raydix/double.h>. Rays go through the same wide trees
/// as in float, and meet the triangles in double.
using SceneD = BasicScene<double>;

/// Which hits count: alpha tests, the triangle that a ray starts on, masks of one's own. `place`:
/// of the ray among those of the call, 0 for a single one; `ray`: as the caller gave it. Called
/// from several threads at once, any number of times for each hit, also for hits that turn out not
/// to be the closest, in any order; so its answer may depend on its arguments alone. Each triangle
/// or shape has one hit on a ray: the first within [tmin, tmax]. If that is refused, the next one
/// is of another. What it throws comes out of the call that traces.
using HitFilter = std::function<bool(std::size_t place, const Ray& ray, const Hit& hit)>;

/// The same in double.
using HitFilterD = std::function<bool(std::size_t place, const RayD& ray, const HitD& hit)>;

struct SceneTraceOptions {
    std::uint32_t mask = 0xFFFFFFFFu;           // of all rays
    std::span<const std::uint32_t> masks = {};  // of each ray, [rays], instead; or empty
    int threads = 0;                            // 0 to 1,024; 0: all the machine has
    SimdPath path = SimdPath::automatic;        // hits do not depend on it
    std::string isa = {};                       // one of simd_instruction_sets(); empty: the best
    HitFilter filter = {};                      // of a Scene; empty: all hits count
    HitFilterD filter_d = {};                   // of a SceneD
    /// trace_all only: bounds the peak of the call. 0: half of what is left (result_limit.h).
    std::uint64_t max_result_bytes = 0;
};

/// Closest hit of each ray: the least (t, instance, geometry, prim) over all triangles that the
/// watertight test accepts (Woop, Benthin, Wald 2013; edges belong to both triangles) and all
/// shapes that it meets. Rays go
/// through each instance's inverse in double and are rounded once, where the mesh is; in double the
/// translation comes first, so that a place far from the origin costs no digits. rays [n] ->
/// hits [n]. Throws InputError: sizes that differ, a scene that was never committed.
TraceCounts trace(const Scene& scene, std::span<const Ray> rays, std::span<Hit> hits,
                  const SceneTraceOptions& options = {});
TraceCounts trace(const SceneD& scene, std::span<const RayD> rays, std::span<HitD> hits,
                  const SceneTraceOptions& options = {});
[[nodiscard]] std::vector<Hit> trace(const Scene& scene, std::span<const Ray> rays,
                                     const SceneTraceOptions& options = {});
[[nodiscard]] std::vector<HitD> trace(const SceneD& scene, std::span<const RayD> rays,
                                      const SceneTraceOptions& options = {});
/// Whether each ray hits anything at all: 1 or 0. rays [n] -> occluded [n].
TraceCounts trace_any(const Scene& scene, std::span<const Ray> rays,
                      std::span<std::uint8_t> occluded, const SceneTraceOptions& options = {});
TraceCounts trace_any(const SceneD& scene, std::span<const RayD> rays,
                      std::span<std::uint8_t> occluded, const SceneTraceOptions& options = {});

/// All hits of all rays, those of one ray sorted by (t, instance, geometry, prim). Each triangle at
/// most once on every path. Edges are half open (exact sign, then a top-left
/// rule), so that the number of crossings of a closed mesh is right for rays through edges and
/// vertices too. Throws ResultTooLarge, an InputError, if the call would take more than
/// options.max_result_bytes.
[[nodiscard]] AllHits trace_all(const Scene& scene, std::span<const Ray> rays,
                                const SceneTraceOptions& options = {});
[[nodiscard]] AllHitsD trace_all(const SceneD& scene, std::span<const RayD> rays,
                                 const SceneTraceOptions& options = {});

/// One ray, on the caller's thread.
[[nodiscard]] Hit closest_hit(const Scene& scene, const Ray& ray, std::uint32_t mask = 0xFFFFFFFFu);
[[nodiscard]] HitD closest_hit(const SceneD& scene, const RayD& ray,
                               std::uint32_t mask = 0xFFFFFFFFu);
[[nodiscard]] bool any_hit(const Scene& scene, const Ray& ray, std::uint32_t mask = 0xFFFFFFFFu);
[[nodiscard]] bool any_hit(const SceneD& scene, const RayD& ray, std::uint32_t mask = 0xFFFFFFFFu);
/// Of the hits that `filter` accepts.
[[nodiscard]] Hit closest_hit(const Scene& scene, const Ray& ray, const HitFilter& filter,
                              std::uint32_t mask = 0xFFFFFFFFu);
[[nodiscard]] HitD closest_hit(const SceneD& scene, const RayD& ray, const HitFilterD& filter,
                               std::uint32_t mask = 0xFFFFFFFFu);
[[nodiscard]] bool any_hit(const Scene& scene, const Ray& ray, const HitFilter& filter,
                           std::uint32_t mask = 0xFFFFFFFFu);
[[nodiscard]] bool any_hit(const SceneD& scene, const RayD& ray, const HitFilterD& filter,
                           std::uint32_t mask = 0xFFFFFFFFu);

}  // namespace raydix
