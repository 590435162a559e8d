// Inside or outside of a mesh, and signed distances.
#pragma once

#include <raydix/batch.h>
#include <raydix/types.h>

#include <cstdint>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

namespace raydix {

class Bvh;   // <raydix/bvh.h>
class BvhD;  // <raydix/double.h>
template <class Scalar>
class BasicScene;  // <raydix/scene.h>

/// Whether a mesh encloses a body, told from its edges. Corners at the same place are the same
/// corner, whatever their indices.
enum class Closure : std::uint32_t {
    open = 0,     // some edge belongs to an odd number of triangles
    closed = 1,   // no edge does, but not all neighbours turn the same way
    oriented = 2  // each edge is run through as often one way as the other
};

/// How inside is told from outside. `crossings` and `parity` are exact for closed meshes: no point
/// is ever put on the wrong side, and a point of the surface is inside. `winding` is for meshes
/// with holes and is computed with rounding.
enum class InsideRule : std::uint32_t {
    automatic = 0,  // crossings if oriented, parity if closed, else winding
    crossings = 1,  // inside: the signed number of crossings on the way to infinity is not 0
    parity = 2,     // inside: the number of crossings is odd
    winding = 3,    // inside: the generalized winding number (Jacobson et al. 2013) is 1/2 or more
                    // in magnitude. Far triangles are taken together (Barill et al. 2018)
};

struct SolidOptions {
    InsideRule rule = InsideRule::automatic;
    int threads = 0;  // 0 to 1,024; 0: all the machine has. Results do not depend on it
};

/// Options of a scene as a body.
struct SceneSolidOptions {
    InsideRule rule = InsideRule::automatic;
    std::uint32_t mask = 0xFFFFFFFFu;  // as that of a ray: which geometries and instances count
    /// The most bytes that the copy of all triangles, its tree and the solid may take while they
    /// are made. 0: half of what is left to the process (result_limit.h).
    std::uint64_t max_result_bytes = 0;
    int threads = 0;  // 0 to 1,024; 0: all the machine has. Results do not depend on it
};

/// Triangles as the boundary of a body. Making one takes O(n log n): edges are matched, and
/// `winding` also sums normals. Any number of threads may ask a solid at once. In double, crossings
/// and their signs are exact too. A solid that was moved from may only be assigned to or destroyed.
template <class Scalar>
class BasicSolid {
public:
    using Tree = std::conditional_t<std::is_same_v<Scalar, float>, Bvh, BvhD>;

    /// Refers to the tree. The caller keeps it as it is, as long as the solid lives. Throws
    /// InputError: a tree that holds boxes or points; more than 1.4e9 triangles.
    explicit BasicSolid(const Tree& bvh, const SolidOptions& options = {});
    explicit BasicSolid(Tree&&, const SolidOptions& = {}) = delete;  // would be gone at once
    /// The same, and keeps the tree, which must not be null.
    explicit BasicSolid(std::shared_ptr<const Tree> bvh, const SolidOptions& options = {});
    /// Takes all meshes of the scene's last commit, on every path of instances, as one body.
    /// Crossings are summed, and an edge may belong to triangles of several geometries. Makes a
    /// tree of its own and refers to nothing of the scene. Vertices are moved to the world in
    /// double and rounded once. Where a path mirrors, two corners change places, so that the
    /// outside stays outside. Throws InputError: a scene that was never committed; spheres,
    /// capsules, points or user geometry that the mask shows (they are named); more than 1.4e9
    /// triangles. Throws ResultTooLarge before anything is made, if it would take more than
    /// options.max_result_bytes.
    explicit BasicSolid(const BasicScene<Scalar>& scene, const SceneSolidOptions& options = {});
    ~BasicSolid();
    BasicSolid(BasicSolid&&) noexcept;
    BasicSolid& operator=(BasicSolid&&) noexcept;

    [[nodiscard]] Closure closure() const;
    /// Never `automatic`.
    [[nodiscard]] InsideRule rule() const;
    /// Number of edges that belong to an odd number of triangles.
    [[nodiscard]] std::uint64_t open_edges() const;
    /// The tree that the solid asks (bvh.h, in double double.h). Of a scene it is that over all
    /// triangles, numbered by (instance, geometry, prim).
    [[nodiscard]] const Tree& bvh() const;

private:
    friend struct SolidInternals;
    struct State;
    std::unique_ptr<State> state_;
};
extern template class BasicSolid<float>;
extern template class BasicSolid<double>;
using Solid = BasicSolid<float>;
using SolidD = BasicSolid<double>;

/// Says whether each query is inside: 1 or 0. queries [n] -> inside [n]. `found` counts those
/// inside. Queries that are not finite are outside and are counted. Throws InputError if the sizes
/// differ.
QueryCounts contains(const Solid& solid, std::span<const Vec3> queries,
                     std::span<std::uint8_t> inside, int threads = 0);
QueryCounts contains(const SolidD& solid, std::span<const Vec3d> queries,
                     std::span<std::uint8_t> inside, int threads = 0);
[[nodiscard]] bool contains(const Solid& solid, Vec3 query);
[[nodiscard]] bool contains(const SolidD& solid, Vec3d query);

/// Computes the distances of closest_points, negative inside. queries [n] -> distances [n]. A
/// distance beyond options.max_distance is infinite, with its sign. A query that is not finite gets
/// infinity and is counted. Throws InputError: sizes that differ, a max_distance that is negative
/// or NaN.
QueryCounts signed_distances(const Solid& solid, std::span<const Vec3> queries,
                             std::span<float> distances, const ClosestOptions& options = {});
[[nodiscard]] std::vector<float> signed_distances(const Solid& solid, std::span<const Vec3> queries,
                                                  const ClosestOptions& options = {});
QueryCounts signed_distances(const SolidD& solid, std::span<const Vec3d> queries,
                             std::span<double> distances, const ClosestOptionsD& options = {});
[[nodiscard]] std::vector<double> signed_distances(const SolidD& solid,
                                                   std::span<const Vec3d> queries,
                                                   const ClosestOptionsD& options = {});
[[nodiscard]] float signed_distance(const Solid& solid, Vec3 query);
[[nodiscard]] double signed_distance(const SolidD& solid, Vec3d query);

/// Computes winding numbers by the solid's rule. queries [n] -> numbers [n]. `crossings` gives
/// whole numbers, 0 on the surface. `parity` gives 0 or 1. `winding` gives the generalized numbers,
/// the same for every number of threads. A query that is not finite gets NaN.
[[nodiscard]] std::vector<double> winding_numbers(const Solid& solid, std::span<const Vec3> queries,
                                                  int threads = 0);
[[nodiscard]] std::vector<double> winding_numbers(const SolidD& solid,
                                                  std::span<const Vec3d> queries, int threads = 0);

}  // namespace raydix
