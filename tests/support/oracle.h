// Judges of hits that share no code with the library's tests: Moeller and Trumbore (1997) in
// double over all triangles, and Embree. How near a ray passes to an edge, and a name for every way
// in which two answers may differ.
#pragma once

#include <raydix/mesh.h>
#include <raydix/types.h>

#include <cstdint>
#include <iosfwd>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace raydix::test {

/// One ray against one triangle, with no tolerance.
struct OracleHit {
    double t = 0, u = 0, v = 0;
    bool valid = false;  // the triangle has area and the ray is not parallel to its plane
    /// u, v and 1 - u - v are all at least 0.
    [[nodiscard]] bool inside() const { return valid && u >= 0 && v >= 0 && u + v <= 1; }
};
/// Whether the cross product of two edges is other than 0 in double.
bool has_area(const Vec3& v0, const Vec3& v1, const Vec3& v2);
OracleHit oracle_intersect(const Vec3& v0, const Vec3& v1, const Vec3& v2, const Ray& ray);

/// How far the lateral position of a vertex may be off in float32, seen from the ray's origin, and
/// what that makes of t and of u and v. Infinite for a ray along the plane.
struct OracleSlack {
    double across = 0, t = 0, edge = 0;
};
OracleSlack oracle_slack(const Vec3& v0, const Vec3& v1, const Vec3& v2, const Ray& ray);

/// From the whole line to the nearest edge of the triangle.
double distance_to_edges(const Vec3& v0, const Vec3& v1, const Vec3& v2, const Ray& ray);

/// Closest hit over all triangles, the least (t, prim). Triangles that a builder leaves out are
/// left out by their coordinates alone.
Hit oracle_closest(const MeshView& mesh, const Ray& ray);

/// What comparing two closest hits of one ray came to.
enum class Verdict {
    exact,    // the same triangle, our t within rounding of the exact one
    tie,      // another triangle at the same distance within rounding
    grazing,  // one of the answers passes within rounding of an edge, or along the plane
    wrong
};

struct Tally {
    std::uint64_t rays = 0, hits = 0, exact = 0, ties = 0, both_miss = 0, grazing = 0, wrong = 0;
    std::string first_wrong;  // the first few wrong rays in full
};

/// Compares `ours` with what another tracer said about the same ray.
Verdict judge(const MeshView& mesh, const Ray& ray, const Hit& ours, const Hit& other);
/// Ray by ray; counts hits of `ours`.
Tally compare(const MeshView& mesh, std::span<const Ray> rays, std::span<const Hit> ours,
              std::span<const Hit> others);
/// One line: scene, peer, rays, hits, exact, ties, both missed, grazing, wrong.
std::ostream& print_line(std::ostream& out, const std::string& scene, const std::string& peer,
                         const Tally& tally);

/// Embree 3 with its robust flag over a static scene.
class EmbreeOracle {
public:
    /// Whether Embree was there when the tests were configured.
    static bool available();
    explicit EmbreeOracle(const MeshView& mesh);
    ~EmbreeOracle();
    EmbreeOracle(const EmbreeOracle&) = delete;
    EmbreeOracle& operator=(const EmbreeOracle&) = delete;
    [[nodiscard]] std::vector<Hit> closest(std::span<const Ray> rays) const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

#define RAYDIX_SKIP_WITHOUT_EMBREE()                \
    if (!::raydix::test::EmbreeOracle::available()) \
    GTEST_SKIP() << "Embree was not found when the tests were configured"

}  // namespace raydix::test
