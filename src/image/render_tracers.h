// What pictures send their rays through: a tree or a scene.
#pragma once

#include <raydix/bvh.h>
#include <raydix/scene.h>
#include <raydix/wide.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "base/double3.h"
#include "engine/scene_tree.h"
#include "engine/scene_tree_double.h"
#include "image/surface_points.h"

namespace raydix {

/// Rays of one tile, on the thread that calls.
class Tracer {
public:
    virtual ~Tracer() = default;
    /// Around all that rays may meet; lo > hi if there is nothing.
    [[nodiscard]] virtual Aabb bounds() const = 0;
    /// normals [rays]: set for those that hit. Geometric, of any length and on either side; 0 or
    /// NaN where there is none.
    virtual void closest(std::span<const Ray> rays, std::span<Hit> hits,
                         std::span<Double3> normals) const = 0;
    virtual void occluded(std::span<const Ray> rays, std::span<std::uint8_t> found) const = 0;
    /// How many nodes each ray visits on the way to its closest hit.
    virtual void count_steps(std::span<const Ray> rays, std::span<std::uint32_t> visits) const = 0;
};

/// The tree must outlive it.
class BvhTracer final : public Tracer {
public:
    /// `rays`: about how many will come. Where they are enough they go through a wide tree: the
    /// same hits, in less time. Steps are those of the scalar reference.
    BvhTracer(const Bvh& bvh, std::uint64_t rays);
    [[nodiscard]] Aabb bounds() const override { return surface_.bounds(); }
    void closest(std::span<const Ray> rays, std::span<Hit> hits,
                 std::span<Double3> normals) const override;
    void occluded(std::span<const Ray> rays, std::span<std::uint8_t> found) const override;
    void count_steps(std::span<const Ray> rays, std::span<std::uint32_t> visits) const override;

private:
    const Bvh& bvh_;
    BvhSurface surface_;
    std::optional<WideBvh> wide_;
};

/// As the last commit left the scene. Throws InputError if there was none.
class SceneTracer final : public Tracer {
public:
    explicit SceneTracer(const Scene& scene);
    [[nodiscard]] Aabb bounds() const override { return surface_.bounds(); }
    void closest(std::span<const Ray> rays, std::span<Hit> hits,
                 std::span<Double3> normals) const override;
    void occluded(std::span<const Ray> rays, std::span<std::uint8_t> found) const override;
    void count_steps(std::span<const Ray> rays, std::span<std::uint32_t> visits) const override;

private:
    std::shared_ptr<const SceneTree> tree_;
    SceneSurface surface_;
};

/// A scene in double, whose tracing space has `middle` of it as its origin. It counts no steps:
/// that throws InputError.
class SceneTracerD final : public Tracer {
public:
    explicit SceneTracerD(const SceneD& scene);
    /// The origin of that space in the scene's.
    [[nodiscard]] Double3 middle() const { return surface_.middle(); }
    [[nodiscard]] Aabb bounds() const override { return surface_.bounds(); }
    void closest(std::span<const Ray> rays, std::span<Hit> hits,
                 std::span<Double3> normals) const override;
    void occluded(std::span<const Ray> rays, std::span<std::uint8_t> found) const override;
    void count_steps(std::span<const Ray> rays, std::span<std::uint32_t> visits) const override;

private:
    std::shared_ptr<const SceneTreeD> tree_;
    SceneSurfaceD surface_;
};

}  // namespace raydix
