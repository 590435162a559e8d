// Scenes of two and more levels in double: trees of triangles, placed many times by affine
// transforms. As <raydix/instances.h>, for places where float32 has steps of half a metre.
#pragma once

#include <raydix/double.h>
#include <raydix/instances.h>
#include <raydix/transform.h>
#include <raydix/types.h>

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace raydix {

/// As Instance; `object` is an id that InstancedSceneD gave.
struct InstanceD {
    std::uint32_t object = 0;
    TransformD transform{};
    std::uint32_t mask = 0xFFFFFFFFu;
};

/// As InstanceHit.
struct InstanceHitD {
    static constexpr std::size_t max_levels = InstanceHit::max_levels;

    TreeHitD hit;
    std::uint32_t object = no_primitive;
    std::array<std::uint32_t, max_levels> path = InstanceHit::unused();

    friend constexpr bool operator==(const InstanceHitD&, const InstanceHitD&) = default;
};

/// As InstancedScene: objects (trees of triangles in double or in float, groups of instances) and
/// what stands in the scene, which is group 0. After changes `build` makes the trees over the
/// instances, in the memory of those before; the objects' own trees are not touched.
class InstancedSceneD {
public:
    static constexpr std::uint32_t scene = 0;

    InstancedSceneD();
    ~InstancedSceneD();
    InstancedSceneD(InstancedSceneD&&) noexcept;
    InstancedSceneD& operator=(InstancedSceneD&&) noexcept;

    /// The tree must outlive the scene; it may be refitted or built again, then `build` the scene.
    std::uint32_t add_object(const BvhD& bvh);
    /// A tree in float: hits are those of the same corners in double. Throws InputError if it holds
    /// boxes or points.
    std::uint32_t add_object(const Bvh& bvh);
    /// An empty group, which other groups may show.
    std::uint32_t add_group();
    /// Into group `group`; returns its place there, counted from 0. Throws InputError that names
    /// the instance: an object that does not exist; a transform that is not finite, or singular:
    /// its determinant is at most 2^-40 of the product of its rows' lengths.
    std::uint32_t add_instance(std::uint32_t group, const InstanceD& instance);
    void set_instance(std::uint32_t group, std::uint32_t place, const InstanceD& instance);
    [[nodiscard]] const InstanceD& instance(std::uint32_t group, std::uint32_t place) const;
    [[nodiscard]] std::uint32_t instance_count(std::uint32_t group = scene) const;

    /// Throws InputError: groups that show each other in a circle, more than
    /// InstanceHitD::max_levels of them, an instance beyond the range of coordinates
    /// (docs/contract.md 1).
    void build(int threads = 0);
    /// Around all that the last `build` saw, with room for rounding; lo > hi if there is nothing.
    [[nodiscard]] AabbD bounds() const;

private:
    friend struct InstancedSceneDAccess;
    struct State;
    std::unique_ptr<State> state_;
};

/// Closest hit of each ray: the least (t, path, prim) over all instances that its mask lets it see.
/// Rays go into an object's space in double, the translation first, so that a place far from the
/// origin costs no digits; a hit is that of closest_hit on the object with this ray. The same bits
/// for every thread count. rays [n] -> hits [n]. Throws InputError: sizes that differ, a scene that
/// was changed after its last `build`.
InstanceTraceCounts trace(const InstancedSceneD& scene, std::span<const RayD> rays,
                          std::span<InstanceHitD> hits, const InstanceTraceOptions& options = {});
[[nodiscard]] std::vector<InstanceHitD> trace(const InstancedSceneD& scene,
                                              std::span<const RayD> rays,
                                              const InstanceTraceOptions& options = {});
/// Whether each ray hits anything it may see: 1 or 0. rays [n] -> occluded [n].
InstanceTraceCounts trace_any(const InstancedSceneD& scene, std::span<const RayD> rays,
                              std::span<std::uint8_t> occluded,
                              const InstanceTraceOptions& options = {});
[[nodiscard]] InstanceHitD closest_hit(const InstancedSceneD& scene, const RayD& ray,
                                       std::uint32_t mask = 0xFFFFFFFFu);

/// Many small trees in double in one call, as build_many of meshes in float.
[[nodiscard]] std::vector<BvhD> build_many(std::span<const MeshViewD> meshes,
                                           const BuildOptions& options = {});

}  // namespace raydix
