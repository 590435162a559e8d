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

namespace raydix {

/// Rays of one tile, on the thread that calls.
class Tracer {
public:
    virtual ~Tracer() = default;
    virtual void closest(std::span<const Ray> rays, std::span<Hit> hits) const = 0;
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
    void closest(std::span<const Ray> rays, std::span<Hit> hits) const override;
    void occluded(std::span<const Ray> rays, std::span<std::uint8_t> found) const override;
    void count_steps(std::span<const Ray> rays, std::span<std::uint32_t> visits) const override;

private:
    const Bvh& bvh_;
    std::optional<WideBvh> wide_;
};

/// As the last commit left the scene. Throws InputError if there was none.
class SceneTracer final : public Tracer {
public:
    explicit SceneTracer(const Scene& scene);
    void closest(std::span<const Ray> rays, std::span<Hit> hits) const override;
    void occluded(std::span<const Ray> rays, std::span<std::uint8_t> found) const override;
    void count_steps(std::span<const Ray> rays, std::span<std::uint32_t> visits) const override;

private:
    std::shared_ptr<const SceneTree> tree_;
};

/// A scene in double, whose tracing space has `middle` of it as its origin. It counts no steps:
/// that throws InputError.
class SceneTracerD final : public Tracer {
public:
    SceneTracerD(const SceneD& scene, Double3 middle);
    void closest(std::span<const Ray> rays, std::span<Hit> hits) const override;
    void occluded(std::span<const Ray> rays, std::span<std::uint8_t> found) const override;
    void count_steps(std::span<const Ray> rays, std::span<std::uint32_t> visits) const override;

private:
    std::shared_ptr<const SceneTreeD> tree_;
    Double3 middle_;
};

}  // namespace raydix
