// The two sides of `bench scene` behind one interface for each kind of question. A side is given
// rays or queries, untimed; a mode then answers all of them into arrays of the side's own, timed;
// answers are read back for the comparison, untimed.
#pragma once

#include <raydix/types.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "scene_contents.h"

namespace raydix::bench {

/// Begins like Hit. `instance` is the number of a leaf (scene_contents.h); 0 without instances.
struct PlacedHit {
    float t = infinity;
    std::uint32_t prim = no_primitive;
    float u = 0.0f, v = 0.0f;
    std::uint32_t geometry = no_primitive, instance = no_primitive;

    [[nodiscard]] bool hit() const { return prim != no_primitive; }
    friend bool operator==(const PlacedHit&, const PlacedHit&) = default;
};

/// How one side can be called.
struct SideMode {
    std::string side, name;  // "embree medium", "8-wide coherent"
    bool ours = false;
    bool single = false;  // one ray or query a call, in a parallel loop
    bool robust = false;  // of Embree's trees: stands beside our single calls only
    std::function<void()> closest{}, any{};
};

class RaySide {
public:
    virtual ~RaySide() = default;
    virtual void take(std::span<const Ray> rays) = 0;
    /// They refer to the side.
    [[nodiscard]] virtual std::vector<SideMode> modes() = 0;
    /// Of the last `closest` and `any`.
    [[nodiscard]] virtual PlacedHit hit(std::size_t ray) const = 0;
    [[nodiscard]] virtual bool found(std::size_t ray) const = 0;
};

/// All hits of each ray, sorted by t. `closest` of its modes finds them; `any` is empty.
class AllHitsSide {
public:
    virtual ~AllHitsSide() = default;
    virtual void take(std::span<const Ray> rays) = 0;
    [[nodiscard]] virtual std::vector<SideMode> modes() = 0;
    [[nodiscard]] virtual std::vector<float> distances(std::size_t ray) const = 0;
};

/// The closest points of a mesh. `closest` of its modes finds them; `any` is empty.
class ClosestSide {
public:
    virtual ~ClosestSide() = default;
    virtual void take(std::span<const Vec3> queries) = 0;
    [[nodiscard]] virtual std::vector<SideMode> modes() = 0;
    [[nodiscard]] virtual float distance(std::size_t query) const = 0;
};

/// A scene whose things move. Place: where one of them is.
template <class Place>
class SideInMotion {
public:
    virtual ~SideInMotion() = default;
    [[nodiscard]] virtual std::string name() const = 0;
    /// One for each of them.
    virtual void move(std::span<const Place> places) = 0;
    virtual void commit() = 0;
    /// As it was committed last.
    [[nodiscard]] virtual RaySide& rays() = 0;
};
/// Instances.
using MovingSide = SideInMotion<Affine>;
/// A mesh by its vertices. Its commit begins when the program has them in an array, and says first
/// that they changed.
using FrameSide = SideInMotion<Vec3>;

}  // namespace raydix::bench
