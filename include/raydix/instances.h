// Scenes of two and more levels: trees of triangles, placed many times by affine transforms.
#pragma once

#include <raydix/bvh.h>
#include <raydix/scene.h>
#include <raydix/types.h>

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace raydix {

/// `object` is an id that InstancedScene gave. Rays see it if mask & their mask is not 0.
struct Instance {
    std::uint32_t object = 0;
    Transform transform{};
    std::uint32_t mask = 0xFFFFFFFFu;
};

/// A hit and the instances on the way to it: path[0] is the instance's place in the scene, path[1]
/// in the group that it shows, and so on; the rest is no_primitive. `hit.t` is in units of the
/// caller's ray, `hit.prim` a triangle of `object`.
struct InstanceHit {
    static constexpr std::size_t max_levels = 8;

    TreeHit hit;
    std::uint32_t object = no_primitive;
    std::array<std::uint32_t, max_levels> path = unused();

    static constexpr std::array<std::uint32_t, max_levels> unused() {
        std::array<std::uint32_t, max_levels> all{};
        all.fill(no_primitive);
        return all;
    }
};

struct InstanceTraceOptions {
    std::uint32_t mask = 0xFFFFFFFFu;           // of all rays
    std::span<const std::uint32_t> masks = {};  // of each ray, [rays], instead; or empty
    int threads = 0;                            // 0 to 1,024; 0: all the machine has
};

struct InstanceTraceCounts {
    std::uint64_t rays = 0;
    std::uint64_t hits = 0;
    std::uint64_t invalid_rays = 0;
};

/// Objects (trees of triangles, groups of instances) and what stands in the scene. Group 0 is the
/// scene itself. After changes `build` makes the trees over the instances; the objects' own trees
/// are not touched, so moving 10,000 instances costs a few milliseconds.
class InstancedScene {
public:
    static constexpr std::uint32_t scene = 0;

    InstancedScene();
    ~InstancedScene();
    InstancedScene(InstancedScene&&) noexcept;
    InstancedScene& operator=(InstancedScene&&) noexcept;

    /// The tree must outlive the scene; it may be refitted or built again, then `build` the scene.
    /// Throws InputError if it holds boxes or points.
    std::uint32_t add_object(const Bvh& bvh);
    /// An empty group, which other groups may show.
    std::uint32_t add_group();
    /// Into group `group`; returns its place there, counted from 0. Throws InputError that names
    /// the instance: an object that does not exist, a transform that is singular or not finite.
    std::uint32_t add_instance(std::uint32_t group, const Instance& instance);
    void set_instance(std::uint32_t group, std::uint32_t place, const Instance& instance);
    [[nodiscard]] const Instance& instance(std::uint32_t group, std::uint32_t place) const;
    [[nodiscard]] std::uint32_t instance_count(std::uint32_t group = scene) const;

    /// Throws InputError: groups that show each other in a circle, more than
    /// InstanceHit::max_levels of them, an instance beyond the range of coordinates
    /// (docs/contract.md 1).
    void build(int threads = 0);
    /// Around all that the last `build` saw; lo > hi if there is nothing.
    [[nodiscard]] Aabb bounds() const;

private:
    friend struct InstancedSceneAccess;
    struct State;
    std::unique_ptr<State> state_;
};

/// Closest hit of each ray: the least (t, path, prim) over all instances that its mask lets it see.
/// Rays go into an object's space in double and are rounded there, so a hit is that of
/// closest_hit on the object with this ray. rays [n] -> hits [n]. Throws InputError: sizes that
/// differ, a scene that was changed after its last `build`.
InstanceTraceCounts trace(const InstancedScene& scene, std::span<const Ray> rays,
                          std::span<InstanceHit> hits, const InstanceTraceOptions& options = {});
[[nodiscard]] std::vector<InstanceHit> trace(const InstancedScene& scene, std::span<const Ray> rays,
                                             const InstanceTraceOptions& options = {});
/// Whether each ray hits anything it may see: 1 or 0. rays [n] -> occluded [n].
InstanceTraceCounts trace_any(const InstancedScene& scene, std::span<const Ray> rays,
                              std::span<std::uint8_t> occluded,
                              const InstanceTraceOptions& options = {});
[[nodiscard]] InstanceHit closest_hit(const InstancedScene& scene, const Ray& ray,
                                      std::uint32_t mask = 0xFFFFFFFFu);

/// Many small trees in one call, as build_bvh makes them: a mesh is one thread's, so thousands of
/// them keep all threads busy. peak_bytes is 0. Throws InputError as build_bvh does, naming the
/// mesh (the first that a thread met).
[[nodiscard]] std::vector<Bvh> build_many(std::span<const MeshView> meshes,
                                          const BuildOptions& options = {});

}  // namespace raydix
