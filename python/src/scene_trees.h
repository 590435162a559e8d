// A mesh and the trees over it, each made when a query first needs it. Safe for many threads that
// ask and one that moves the vertices.
#pragma once

#include <raydix/bvh.h>
#include <raydix/double.h>
#include <raydix/mesh.h>
#include <raydix/refit.h>
#include <raydix/solid.h>
#include <raydix/trace.h>
#include <raydix/wide.h>

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <shared_mutex>
#include <utility>
#include <vector>

namespace raydix::python {

/// A lock on trees that are read, and the knowledge that this thread has one: Python may run a
/// signal handler between two pieces of a batch, which may ask a scene again.
class Reading {
public:
    Reading() = default;
    explicit Reading(std::shared_mutex& use) : lock_(use) { ++held_; }
    Reading(Reading&& other) noexcept : lock_(std::move(other.lock_)) {}
    Reading& operator=(Reading&& other) noexcept {
        Reading moved(std::move(other));
        lock_.swap(moved.lock_);
        return *this;
    }
    ~Reading() {
        if (lock_.owns_lock()) --held_;
    }

    [[nodiscard]] bool owns_lock() const { return lock_.owns_lock(); }
    /// How many this thread has.
    [[nodiscard]] static int held() { return held_; }

private:
    std::shared_lock<std::shared_mutex> lock_;
    static inline thread_local int held_ = 0;
};

/// The lock of the one thread that changes trees.
class Writing {
public:
    /// Throws InputError in a signal handler within a query, whose end it would wait for.
    Writing(std::mutex& queue, std::shared_mutex& use);

private:
    std::unique_lock<std::mutex> queue_;
    std::unique_lock<std::shared_mutex> use_;
};

/// The library's names of things in float32.
struct InFloat {
    using Scalar = float;
    using Point = Vec3;
    using Mesh = raydix::Mesh;
    using MeshView = raydix::MeshView;
    using Bvh = raydix::Bvh;
    using Solid = raydix::Solid;
    using Ray = raydix::Ray;
    using Hit = raydix::Hit;
    using AllHits = raydix::AllHits;
    using ClosestPoint = raydix::ClosestPoint;
    using ClosestOptions = raydix::ClosestOptions;
    using Segment = raydix::Segment;
    using Sphere = raydix::Sphere;
};

/// The same in double.
struct InDouble {
    using Scalar = double;
    using Point = Vec3d;
    using Mesh = MeshD;
    using MeshView = MeshViewD;
    using Bvh = BvhD;
    using Solid = SolidD;
    using Ray = RayD;
    using Hit = HitD;
    using AllHits = AllHitsD;
    using ClosestPoint = ClosestPointD;
    using ClosestOptions = ClosestOptionsD;
    using Segment = SegmentD;
    using Sphere = SphereD;
};

/// What scenes of both types have in common. The functions that build take long: call everything
/// here without the interpreter's lock.
template <class Names>
class MeshTrees {
public:
    using Types = Names;

    MeshTrees(typename Types::Mesh mesh, const BuildOptions& options);

    /// Held while trees are read; `refit` waits for those who hold it, and lets no new ones past.
    /// Taken without the interpreter's lock; of several scenes that of the lowest address first.
    [[nodiscard]] Reading read() const;

    [[nodiscard]] const typename Types::Mesh& mesh() const { return mesh_; }
    /// What has to be kept, beside this, for as long as the present vertices are looked at: a refit
    /// leaves their memory there. While reading.
    [[nodiscard]] std::shared_ptr<const void> keep_vertices();
    [[nodiscard]] const BuildOptions& options() const { return options_; }

    // While reading.
    [[nodiscard]] const typename Types::Bvh& bvh();
    [[nodiscard]] const typename Types::Solid& solid(InsideRule rule);
    /// Changes whenever the tree does.
    [[nodiscard]] std::uint64_t version() const { return version_; }

protected:
    using Vertices = std::vector<typename Types::Point>;

    const typename Types::Bvh& bvh_locked();
    /// While writing: what a refit that succeeded ends with.
    void take_vertices(Vertices vertices);
    /// While writing: a refit has spoilt the tree, which the mesh will make again.
    void drop_trees();

    typename Types::Mesh mesh_;
    BuildOptions options_;
    mutable std::mutex queue_;  // without it, readers would keep a refit waiting for ever
    mutable std::shared_mutex use_;
    std::mutex build_;  // one thread builds, the others wait
    std::optional<typename Types::Bvh> bvh_;
    std::uint64_t version_ = 0;
    std::shared_ptr<Vertices> old_vertices_;  // empty until a refit, and null if nobody looks
    std::array<std::optional<typename Types::Solid>, 4> solids_;  // by rule
};

extern template class MeshTrees<InFloat>;
extern template class MeshTrees<InDouble>;

/// In float32.
class SceneTrees : public MeshTrees<InFloat> {
public:
    /// Throws InputError: an index past the vertices.
    SceneTrees(Mesh mesh, const BuildOptions& options);

    /// While reading. Rays go through the wide tree, all else through the binary one.
    [[nodiscard]] const WideBvh& wide();
    [[nodiscard]] const WideBvh& ray_tree() { return wide(); }

    /// Throws InputError as Refitter::refit does, and in a signal handler within a query; answers
    /// are then as before.
    RefitQuality refit(std::vector<Vec3> vertices, int threads);

private:
    std::optional<WideBvh> wide_;
    std::optional<Refitter> refitter_;
};

/// In double. There is one tree, for all queries.
class SceneTreesD : public MeshTrees<InDouble> {
public:
    /// Throws InputError: an index past the vertices.
    SceneTreesD(MeshD mesh, const BuildOptions& options);

    /// While reading.
    [[nodiscard]] const BvhD& ray_tree() { return bvh(); }

    /// As that of SceneTrees; its quality too is relative to the tree as it was built.
    RefitQuality refit(std::vector<Vec3d> vertices, int threads);

private:
    std::optional<double> sah_at_build_;
};

}  // namespace raydix::python
