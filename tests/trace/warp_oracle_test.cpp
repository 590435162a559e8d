// Every warp kernel against a tracer that shares no code with the kernels: Woop's map and test are
// written apart, and every triangle near a ray's line is tested. At equal t the lower primitive
// wins. Then against the watertight tracer, where single rays at edges may differ.
#include <gtest/gtest.h>

#include <raydix/raydix.h>
#include <raydix/simulate.h>
#include <raydix/trace.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <vector>

#include "exec/parallel.h"
#include "support/ray_sets.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

std::vector<int> oracle_widths() {
    if (sanitized) return {1, 8, 32, 128};
    return {1, 2, 4, 8, 16, 32, 64, 128};
}

struct Vector {
    double x, y, z;
};
Vector minus(const Vec3& a, const Vec3& b) {
    return {double(a.x) - b.x, double(a.y) - b.y, double(a.z) - b.z};
}
double scalar(const Vector& a, const Vector& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vector outer(const Vector& a, const Vector& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// The plane and the two axes of a triangle, as 12 floats.
struct UnitMap {
    float plane[4] = {}, u[4] = {}, v[4] = {};

    UnitMap(const Vec3& a, const Vec3& b, const Vec3& c) {
        const Vector from{a.x, a.y, a.z}, ab = minus(b, a), ac = minus(c, a);
        const Vector normal = outer(ab, ac);
        const double area = scalar(normal, normal);
        if (!(area > 0)) return;
        const double by_length = 1.0 / std::sqrt(area), by_area = 1.0 / area;
        const Vector to_u = outer(ac, normal), to_v = outer(normal, ab);
        const bool fits = set(plane, normal, by_length, from, 1.0) &&
                          set(u, to_u, by_area, from, -1.0) && set(v, to_v, by_area, from, -1.0);
        if (!fits) *this = UnitMap({}, {}, {});
    }

private:
    static bool set(float* row, const Vector& axis, double scale, const Vector& from, double sign) {
        const Vector scaled{axis.x * scale, axis.y * scale, axis.z * scale};
        row[0] = static_cast<float>(scaled.x), row[1] = static_cast<float>(scaled.y);
        row[2] = static_cast<float>(scaled.z);
        row[3] = static_cast<float>(sign * scalar(scaled, from));
        for (int k = 0; k < 4; ++k)
            if (!std::isfinite(row[k])) return false;
        return true;
    }
};

/// All triangles by a tree of spheres around them: median splits, no early end, no order.
class SphereTree {
public:
    explicit SphereTree(const MeshView& mesh) {
        for (std::uint32_t id = 0; id < mesh.triangles.size(); ++id) {
            const auto& corner = mesh.triangles[id];
            const Vec3 a = mesh.vertices[corner[0]], b = mesh.vertices[corner[1]],
                       c = mesh.vertices[corner[2]];
            const Vector middle{(double(a.x) + b.x + c.x) / 3, (double(a.y) + b.y + c.y) / 3,
                                (double(a.z) + b.z + c.z) / 3};
            double radius = 0;
            for (const Vec3& p : {a, b, c}) {
                const Vector d{p.x - middle.x, p.y - middle.y, p.z - middle.z};
                radius = std::max(radius, std::sqrt(scalar(d, d)));
            }
            // What is not finite is no triangle of the library's.
            if (std::isfinite(radius)) items_.push_back({middle, radius, id, UnitMap(a, b, c)});
        }
        if (!items_.empty()) split(0, items_.size());
    }

    [[nodiscard]] TreeHit closest(const Ray& ray) const {
        TreeHit best{infinity, no_primitive, 0, 0};
        float limit = ray.tmax;
        if (!nodes_.empty()) visit(0, ray, limit, best);
        return best;
    }

private:
    struct Item {
        Vector middle;
        double radius;
        std::uint32_t id;
        UnitMap map;
    };
    struct Node {
        Vector middle;
        double radius;
        std::size_t begin, end, right;
    };

    std::size_t split(std::size_t begin, std::size_t end) {
        const std::size_t index = nodes_.size();
        nodes_.emplace_back();
        double lo[3] = {1e300, 1e300, 1e300}, hi[3] = {-1e300, -1e300, -1e300};
        for (std::size_t k = begin; k < end; ++k)
            for (int axis = 0; axis < 3; ++axis) {
                const double at = coordinate(items_[k], axis);
                lo[axis] = std::min(lo[axis], at), hi[axis] = std::max(hi[axis], at);
            }
        const Vector middle{(lo[0] + hi[0]) / 2, (lo[1] + hi[1]) / 2, (lo[2] + hi[2]) / 2};
        double radius = 0;
        for (std::size_t k = begin; k < end; ++k) {
            const Vector& m = items_[k].middle;
            const Vector d{m.x - middle.x, m.y - middle.y, m.z - middle.z};
            radius = std::max(radius, std::sqrt(scalar(d, d)) + items_[k].radius);
        }
        std::size_t right = 0;
        if (end - begin > 4) {
            int axis = 0;
            for (int k = 1; k < 3; ++k)
                if (hi[k] - lo[k] > hi[axis] - lo[axis]) axis = k;
            const std::size_t half = (begin + end) / 2;
            std::nth_element(
                items_.begin() + std::ptrdiff_t(begin), items_.begin() + std::ptrdiff_t(half),
                items_.begin() + std::ptrdiff_t(end),
                [axis](auto& a, auto& b) { return coordinate(a, axis) < coordinate(b, axis); });
            split(begin, half);
            right = split(half, end);
        }
        nodes_[index] = {middle, radius, begin, end, right};
        return index;
    }
    static double coordinate(const Item& item, int axis) {
        return axis == 0 ? item.middle.x : axis == 1 ? item.middle.y : item.middle.z;
    }
    /// Whether the ray's line passes the sphere, with a margin far above rounding.
    static bool near(const Ray& ray, const Vector& middle, double radius) {
        const Vector d{ray.direction.x, ray.direction.y, ray.direction.z};
        const Vector to{middle.x - ray.origin.x, middle.y - ray.origin.y, middle.z - ray.origin.z};
        const Vector across = outer(to, d);
        const double reach = radius + 1e-4 * (radius + std::sqrt(scalar(to, to)));
        return scalar(across, across) <= reach * reach * scalar(d, d);
    }
    void visit(std::size_t index, const Ray& ray, float& limit, TreeHit& best) const {
        const Node& node = nodes_[index];
        if (!near(ray, node.middle, node.radius)) return;
        if (node.right != 0) {
            visit(index + 1, ray, limit, best);
            visit(node.right, ray, limit, best);
            return;
        }
        for (std::size_t k = node.begin; k < node.end; ++k) test(items_[k], ray, limit, best);
    }
    static float height(const float* row, const Vec3& p, float sign) {
        return std::fma(sign * row[0], p.x,
                        std::fma(sign * row[1], p.y, std::fma(sign * row[2], p.z, row[3])));
    }
    static float slope(const float* row, const Vec3& d) {
        return std::fma(row[0], d.x, std::fma(row[1], d.y, row[2] * d.z));
    }
    static void test(const Item& item, const Ray& ray, float& limit, TreeHit& best) {
        const float t =
            height(item.map.plane, ray.origin, -1.0f) / slope(item.map.plane, ray.direction);
        if (!(t >= ray.tmin) || !(t <= limit)) return;
        const float u =
            std::fma(t, slope(item.map.u, ray.direction), height(item.map.u, ray.origin, 1.0f));
        const float v =
            std::fma(t, slope(item.map.v, ray.direction), height(item.map.v, ray.origin, 1.0f));
        if (!(u >= 0) || !(v >= 0) || !(u + v <= 1)) return;
        if (best.prim != no_primitive && t == best.t && item.id > best.prim) return;
        best = {t, item.id, u, v};
        limit = t;
    }

    std::vector<Item> items_;
    std::vector<Node> nodes_;
};

/// Kinds of rays of ordinary length. The first two are not aimed at anything.
constexpr RaySet ray_sets[] = {RaySet::camera,       RaySet::through_box,    RaySet::at_vertex,
                               RaySet::at_edge,      RaySet::axis_aligned,   RaySet::zero_component,
                               RaySet::from_surface, RaySet::tmin_above_zero};
constexpr std::size_t not_aimed = 2;

/// As many rays of each kind, one kind behind the other.
std::vector<Ray> ordinary_rays(const Model& scene, std::size_t count) {
    std::vector<Ray> all;
    for (const RaySet set : ray_sets) {
        const std::vector<Ray> rays = make_rays(scene, set, count / std::size(ray_sets), 5);
        all.insert(all.end(), rays.begin(), rays.end());
    }
    return all;
}

/// Lists where Woop's test and the watertight one decide otherwise: at edges and vertices, and on
/// surfaces that rays start from or run along.
void list_differences(const std::vector<Ray>& rays, const std::vector<TreeHit>& woop,
                      const std::vector<Hit>& watertight) {
    const std::size_t of_each = rays.size() / std::size(ray_sets);
    for (std::size_t set = 0; set < std::size(ray_sets); ++set) {
        std::size_t missed = 0, beside = 0, other = 0;
        for (std::size_t i = set * of_each; i < (set + 1) * of_each; ++i) {
            const bool a = woop[i].hit(), b = watertight[i].hit();
            missed += b && !a;
            beside += a && !b;
            other += a && b && std::abs(woop[i].t - watertight[i].t) > 1e-4f * watertight[i].t;
        }
        std::cout << "  " << name_of(ray_sets[set]) << ", " << of_each << " rays: " << missed
                  << " missed, " << beside << " found beside, " << other << " on another surface\n";
        if (set < not_aimed) {
            EXPECT_LE(missed + beside + other, of_each / 1000 + 1) << name_of(ray_sets[set]);
        }
    }
}

bool same(const TreeHit& a, const TreeHit& b) { return std::memcmp(&a, &b, sizeof(TreeHit)) == 0; }

/// Closest hits of all kernels at all widths, bit for bit; of any-hit kernels, whether there is
/// one.
void expect_hits_of_the_oracle(const Model& scene, Builder builder, std::size_t count) {
    SCOPED_TRACE(scene.name + ", " + std::string(builder_name(builder)));
    const std::vector<Ray> rays = ordinary_rays(scene, count);
    const SphereTree oracle(scene.mesh());
    std::vector<TreeHit> expected(rays.size());
    for_each_index(
        rays.size(), [&](std::size_t i) { expected[i] = oracle.closest(rays[i]); }, 64);
    const Bvh bvh = build_bvh(scene.mesh(), {.builder = builder, .max_leaf = 8});
    const WarpTree tree(bvh, true);
    MachineModel machine = machine_model("gtx480");
    machine.multiprocessors = 3;  // few warps, so that each fetches many times
    machine.resident_lanes = 256;
    machine.block_lanes = 64;
    std::vector<SimulateOptions> runs;
    for (const WarpKernel kernel : warp_kernels())
        for (const int width : oracle_widths())
            for (const bool any_hit : {false, true})
                if (!any_hit || width == 32)
                    runs.push_back(
                        {.kernel = kernel, .machine = machine, .width = width, .any_hit = any_hit});
    std::size_t hits = 0;
    for (const TreeHit& hit : expected) hits += hit.hit();
    EXPECT_GT(hits, rays.size() / 4);
    for (const SimulateOptions& run : runs) {
        SCOPED_TRACE(std::string(warp_kernel_name(run.kernel)) + ", width " +
                     std::to_string(run.width) + (run.any_hit ? ", any" : ""));
        std::vector<std::vector<TreeHit>> found;
        static_cast<void>(simulate(tree, rays, std::span(&run, 1), &found));
        std::size_t different = 0, first = rays.size();
        for (std::size_t i = rays.size(); i-- > 0;) {
            const bool equal = run.any_hit ? found[0][i].hit() == expected[i].hit()
                                           : same(found[0][i], expected[i]);
            if (!equal) ++different, first = i;
        }
        EXPECT_EQ(different, 0u) << "first: ray " << first;
    }
    std::cout << scene.name << ", Woop's test against the watertight one:\n";
    list_differences(rays, expected, trace(bvh, rays));
}

TEST(WarpOracle, AgreesWithEveryKernelOnRandomTriangles) {
    const Model scene = scene_of(random_soup(2000, 5, 0.1f), "soup");
    for (const Builder builder : {Builder::split, Builder::sbvh})
        expect_hits_of_the_oracle(scene, builder, fewer(8000, 20));
}

/// The root is not the first inner node of every builder.
TEST(WarpOracle, AgreesWithEveryKernelOnTreesOfAllBuilders) {
    const Model scene = scene_of(random_soup(300, 6, 0.2f), "soup");
    for (const Builder builder :
         {Builder::karras, Builder::lauterbach, Builder::garanzha, Builder::apetrei, Builder::ploc,
          Builder::hploc, Builder::binned, Builder::sweep, Builder::split, Builder::sbvh})
        expect_hits_of_the_oracle(scene, builder, fewer(400, 3));
}

/// Every triangle twice, the second ones backwards: which of two is met first is up to the tree.
TEST(WarpOracle, TheLowerOfTwoEqualTrianglesWins) {
    Mesh soup = random_soup(1000, 5, 0.1f);
    for (std::size_t k = 1000; k-- > 0;) soup.triangles.push_back(soup.triangles[k]);
    const Model scene = scene_of(std::move(soup), "every triangle twice");
    for (const Builder builder : {Builder::split, Builder::karras})
        expect_hits_of_the_oracle(scene, builder, fewer(4000, 20));
}

TEST(WarpOracle, AgreesWithEveryKernelOnSibenik) {
    const std::filesystem::path file = shared_scene("sibenik/sibenik.ply.xz");
    if (!std::filesystem::exists(file)) GTEST_SKIP() << "needs the scene sibenik";
    const Model scene = load_thinned(file, 20'000);
    for (const Builder builder : {Builder::split, Builder::sbvh})
        expect_hits_of_the_oracle(scene, builder, fewer(100000, 200));
}

TEST(WarpOracle, AgreesWithEveryKernelOnConference) {
    const std::filesystem::path file = shared_scene("conference/conference.ply.xz");
    if (!std::filesystem::exists(file)) GTEST_SKIP() << "needs the scene conference";
    const Model scene = load_thinned(file, 20'000);
    for (const Builder builder : {Builder::split, Builder::sbvh})
        expect_hits_of_the_oracle(scene, builder, fewer(20000, 50));
}

}  // namespace
}  // namespace raydix::test
