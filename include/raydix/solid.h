// Inside or outside of a mesh, and signed distances.
#pragma once

#include <raydix/bvh.h>
#include <raydix/closest.h>
#include <raydix/types.h>

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace raydix {

template <class Scalar>
class BasicScene;  // <raydix/scene.h>

/// What the edges of a mesh say of it. Corners at the same place are the same corner, whatever
/// their indices.
enum class Closure : std::uint32_t {
    open = 0,     // some edge belongs to an odd number of triangles
    closed = 1,   // none does, but not all neighbours turn the same way
    oriented = 2  // each edge is run through as often one way as the other
};

/// How inside is told from outside. The first two are decided without any rounding, at edges and
/// vertices too: a point is inside if and only if it is, and a point of the surface is inside.
enum class InsideRule : std::uint32_t {
    automatic = 0,  // crossings if oriented, parity if closed, else winding
    crossings = 1,  // the winding number, the signed number of crossings to infinity, is not 0
    parity = 2,     // the number of crossings is odd
    winding = 3,    // the generalized winding number (Jacobson et al. 2013) is 1/2 or more in
                    // absolute value: for meshes with holes. Far triangles are taken together
                    // (Barill et al. 2018), with an error far below 1/2
};

struct SolidOptions {
    InsideRule rule = InsideRule::automatic;
    int threads = 0;  // 0 to 1,024; 0: all the machine has. Results do not depend on it
};

/// Of a scene as a body.
struct SceneSolidOptions {
    InsideRule rule = InsideRule::automatic;
    std::uint32_t mask = 0xFFFFFFFFu;  // as that of a ray: which geometries and instances count
    /// Bounds what the copy of all triangles, its tree and the solid take while they are made. 0:
    /// half of what is left (result_limit.h).
    std::uint64_t max_result_bytes = 0;
    int threads = 0;  // 0 to 1,024; 0: all the machine has. Results do not depend on it
};

/// Triangles as the boundary of a body. Made in O(n log n) once: edges are matched, and for
/// `winding` sums of normals are made.
class Solid {
public:
    /// Refers to the tree, which must outlive it and stay as it is. Throws InputError: a tree that
    /// holds boxes or points; more than 1.4e9 triangles.
    explicit Solid(const Bvh& bvh, const SolidOptions& options = {});
    /// The same, and keeps the tree, which must not be null.
    explicit Solid(std::shared_ptr<const Bvh> bvh, const SolidOptions& options = {});
    /// All meshes of the scene's last commit, on every path of instances, as one body: crossings
    /// are summed, an edge may belong to triangles of several geometries. Makes a tree of its own
    /// over all triangles, moved to the world in double and rounded once; two corners change places
    /// where a path mirrors. Refers to nothing of the scene. Throws InputError: a scene that was
    /// never committed; spheres, capsules, points or user geometry, which it names; more than 1.4e9
    /// triangles. ResultTooLarge, before anything is made: it would take more than
    /// options.max_result_bytes.
    explicit Solid(const BasicScene<float>& scene, const SceneSolidOptions& options = {});
    ~Solid();
    Solid(Solid&&) noexcept;
    Solid& operator=(Solid&&) noexcept;

    [[nodiscard]] Closure closure() const;
    /// Never `automatic`.
    [[nodiscard]] InsideRule rule() const;
    /// Edges that belong to an odd number of triangles.
    [[nodiscard]] std::uint64_t open_edges() const;
    /// Of a scene: the tree over all of its triangles, numbered by (instance, geometry, prim).
    [[nodiscard]] const Bvh& bvh() const;

private:
    friend struct SolidAccess;
    struct State;
    std::unique_ptr<State> state_;
};

/// 1 for each query that is inside. Non-finite queries are outside, and counted; `found` counts
/// those inside. queries [n] -> inside [n]. Throws InputError if the sizes differ.
ClosestCounts contains(const Solid& solid, std::span<const Vec3> queries,
                       std::span<std::uint8_t> inside, int threads = 0);
[[nodiscard]] bool contains(const Solid& solid, Vec3 query);

/// The distances of closest_points, negative inside. Those beyond options.max_distance are
/// infinite, with their sign. Non-finite queries: infinity, counted. queries [n] -> distances [n].
/// Throws InputError: sizes that differ, a max_distance that is negative or NaN.
ClosestCounts signed_distances(const Solid& solid, std::span<const Vec3> queries,
                               std::span<float> distances, const ClosestOptions& options = {});
[[nodiscard]] std::vector<float> signed_distances(const Solid& solid, std::span<const Vec3> queries,
                                                  const ClosestOptions& options = {});
[[nodiscard]] float signed_distance(const Solid& solid, Vec3 query);

/// Winding numbers by the solid's rule: whole numbers by `crossings` (0 on the surface), 0 or 1 by
/// `parity`, else the generalized ones. NaN for non-finite queries. queries [n] -> [n].
[[nodiscard]] std::vector<double> winding_numbers(const Solid& solid, std::span<const Vec3> queries,
                                                  int threads = 0);

}  // namespace raydix
