// The hall of example voxel_gi, and its surfaces as an octree of voxels that hold light.
#pragma once

#include <raydix/octree.h>
#include <raydix/raydix.h>

#include <algorithm>
#include <array>
#include <vector>

#include "vec.h"

namespace example {

using raydix::Ray;

inline constexpr float pi = std::numbers::pi_v<float>;
inline constexpr float start_off = 2e-3f;  // of rays from surfaces, in metres: the hall is 33 long

/// A place on a surface; the normal is turned to whoever asks.
struct Point {
    Vec3 place, normal;
};

struct Spotlight {
    Vec3 place{-7.5f, 10.5f, 3.0f}, aim = unit(Vec3{6.5f, 0.0f, -2.0f} - place);
    float intensity = 1100, inner = 0.82f, outer = 0.78f;  // cosines of the cone

    /// What arrives at a point where nothing is in the way, from one side or the other.
    [[nodiscard]] float irradiance(const Point& at) const {
        const Vec3 way = at.place - place;
        const float d2 = dot(way, way), d = std::sqrt(d2);
        const float soft = std::clamp((dot(way, aim) / d - outer) / (inner - outer), 0.0f, 1.0f);
        return intensity * soft * std::abs(dot(way, at.normal)) / (d * d2);
    }
};

/// The aisles red and blue, the rest sandstone.
inline Vec3 albedo(Vec3 p) {
    if (p.y < 0.03f) return {0.62f, 0.50f, 0.38f};
    if (p.z > 4.4f) return {0.75f, 0.22f, 0.16f};
    return p.z < -4.4f ? Vec3{0.18f, 0.32f, 0.75f} : Vec3{0.70f, 0.66f, 0.58f};
}

class Hall {
public:
    Hall() : scene(raydix::load_model("builtin:atrium?triangles=150000")), traced_(scene.mesh()) {}

    [[nodiscard]] Point point_of(std::uint32_t prim, float u, float v) const {
        const raydix::Triangle& t = scene.mesh().triangles[prim];
        const auto& vertices = scene.mesh().vertices;
        const Vec3 a = vertices[t[0]], b = vertices[t[1]] - a, c = vertices[t[2]] - a;
        return {a + u * b + v * c, unit(cross(b, c))};
    }
    [[nodiscard]] Vec3 normal_of(std::uint32_t prim) const { return point_of(prim, 0, 0).normal; }
    [[nodiscard]] double area_of(std::uint32_t prim) const {
        const raydix::Triangle& t = scene.mesh().triangles[prim];
        const Vec3 a = scene.mesh().vertices[t[0]];
        return 0.5 *
               length(cross(scene.mesh().vertices[t[1]] - a, scene.mesh().vertices[t[2]] - a));
    }
    [[nodiscard]] std::vector<raydix::Hit> trace(std::span<const Ray> rays) const {
        return raydix::trace(traced_, rays);
    }

    /// Irradiance of all points by one batch of shadow rays; normals turn to the lamp.
    [[nodiscard]] std::vector<float> direct(std::span<Point> points) const {
        std::vector<float> light(points.size());
        std::vector<Ray> rays;
        for (std::size_t i = 0; i < points.size(); ++i) {
            Point& p = points[i];
            const Vec3 to_lamp = lamp.place - p.place;
            if (dot(p.normal, to_lamp) < 0) p.normal = -1.0f * p.normal;
            light[i] = lamp.irradiance(p);
            // Unlit points get a ray too, an invalid one: places in the batch stay those of points.
            rays.push_back({p.place + start_off * p.normal, 0, to_lamp, light[i] > 0 ? 1.0f : -1});
        }
        std::vector<std::uint8_t> hidden(rays.size());
        raydix::trace_any(traced_, rays, hidden);
        for (std::size_t i = 0; i < points.size(); ++i)
            if (hidden[i] != 0) light[i] = 0;
        return light;
    }

    raydix::Model scene;
    Spotlight lamp;

private:
    raydix::Scene traced_;
};

/// What a voxel sends toward +x, -x, +y, -y, +z, -z, times the part of that face it covers.
struct Face {
    Vec3 light{0, 0, 0};
    float cover = 0;
};
using Voxel = std::array<Face, 6>;

inline float component(Vec3 v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

class VoxelTree {
public:
    VoxelTree(const Hall& hall, int level) {
        std::vector<Point> points = spread(hall, level);
        std::vector<Vec3> places;
        for (const Point& p : points) places.push_back(p.place);
        octree_ = raydix::build_octree(places, {.max_level = level, .max_leaf = 1});
        edge_ = raydix::node_box(octree_, 0).hi.x - octree_.bounds().lo.x;
        voxels_.resize(octree_.nodes().size());
        const std::vector<float> light = hall.direct(points);  // turns normals to the lamp
        const std::vector<Sides> open = open_sides(hall, points);
        // Nodes stand level by level: from the end, children come before their parents.
        for (std::size_t n = voxels_.size(); n-- > 0;) {
            const raydix::OctreeNode& node = octree_.nodes()[n];
            if (node.is_leaf())
                fill(node, points, light, open, voxels_[n]);
            else
                average(node, voxels_[n]);
        }
    }

    [[nodiscard]] float size_of(float level) const { return edge_ * std::exp2(-level); }
    [[nodiscard]] std::size_t size() const { return voxels_.size(); }
    [[nodiscard]] float finest() const {
        return size_of(static_cast<float>(octree_.options().max_level));
    }

    /// Light from a cone, nearest first until it is full. `opening`: its radius over its length,
    /// for 60 degrees unless given; voxels that wide are looked at.
    [[nodiscard]] Vec3 cone(Vec3 from, Vec3 way, float opening = 0.577f) const {
        Face sum;
        for (float t = 0.5f * finest(); t < edge_ && sum.cover < 0.98f;) {
            const float width = std::max(finest(), opening * t);
            const Face here = sample(from + t * way, way, std::log2(edge_ / width));
            // Twice over, as steps are half a width: between two layers of cells a wall would leak.
            const float cover = std::min(here.cover, 1.0f);
            if (here.cover > 0) sum.light += ((1 - sum.cover) * cover / here.cover) * here.light;
            sum.cover += (1 - sum.cover) * cover;
            t += 0.5f * width;
        }
        return sum.light;
    }

private:
    /// Points spread evenly by area, about six a voxel.
    std::vector<Point> spread(const Hall& hall, int level) {
        double done = 0;
        const auto count = static_cast<std::uint32_t>(hall.scene.mesh().triangles.size());
        const raydix::Aabb box = raydix::inspect(hall.scene.mesh()).bounds;
        const double side = double{box.hi.x - box.lo.x} * std::exp2(-level);
        area_ = static_cast<float>(side * side / 6);
        std::vector<Point> points;
        Random random(7);
        for (std::uint32_t i = 0; i < count; ++i)
            for (done += hall.area_of(i); static_cast<double>(points.size()) * area_ < done;) {
                const float r = std::sqrt(random()), s = random();
                points.push_back(hall.point_of(i, r * (1 - s), r * s));
                prims_.push_back(i);
            }
        return points;
    }

    struct Sides {
        bool front, back;
    };
    /// Sides that look into the hall: only they can be seen. Those inside a wall or a column must
    /// not hide the light that their own outside receives.
    [[nodiscard]] std::vector<Sides> open_sides(const Hall& hall,
                                                std::span<const Point> points) const {
        const std::vector<SideCount> seen = count_seen_sides(hall);
        const std::vector<raydix::Hit> hits = hall.trace(rays_to_both_sides(points));
        const auto room = [&](std::size_t i) { return hits[i].hit() ? hits[i].t : 0.0f; };
        std::vector<Sides> open;
        for (std::size_t i = 0; i < points.size(); ++i) {
            const bool turned = dot(points[i].normal, hall.normal_of(prims_[i])) < 0;
            const SideCount of = seen[prims_[i]];
            const std::uint32_t front = of[turned], back = of[!turned], all = front + back;
            if (all != 0)  // a few slip through cracks
                open.push_back({front * 20 >= all, back * 20 >= all});
            else  // nobody saw it: the side with more room
                open.push_back({room(2 * i) > room(2 * i + 1), room(2 * i + 1) >= room(2 * i)});
        }
        return open;
    }
    using SideCount = std::array<std::uint32_t, 2>;  // as the triangle is turned, and from behind

    /// How often paths that bounce through the hall, from its cameras on, meet each triangle.
    static std::vector<SideCount> count_seen_sides(const Hall& hall) {
        std::vector<SideCount> seen(hall.scene.mesh().triangles.size());
        Random random(5);
        for (const raydix::Camera& camera : hall.scene.cameras.cameras) {
            std::vector<Ray> paths = raydix::make_primary_rays(camera, 256, 192);
            for (int bounce = 0; bounce < 16; ++bounce) {
                const std::vector<raydix::Hit> hits = hall.trace(paths);
                std::vector<Ray> next;
                for (std::size_t i = 0; i < paths.size(); ++i) {
                    if (!hits[i].hit()) continue;
                    Point p = hall.point_of(hits[i].prim, hits[i].u, hits[i].v);
                    const bool behind = dot(p.normal, paths[i].direction) > 0;
                    ++seen[hits[i].prim][behind];
                    if (behind) p.normal = -1.0f * p.normal;
                    next.push_back({p.place + start_off * p.normal, 0,
                                    cosine_direction(Frame(p.normal), random)});
                }
                paths = std::move(next);
            }
        }
        return seen;
    }
    static std::vector<Ray> rays_to_both_sides(std::span<const Point> points) {
        std::vector<Ray> rays;
        for (const Point& p : points)
            for (const float side : {1.0f, -1.0f})
                rays.push_back({p.place + side * start_off * p.normal, 0, side * p.normal});
        return rays;
    }

    void fill(const raydix::OctreeNode& node, std::span<const Point> points,
              std::span<const float> light, std::span<const Sides> open, Voxel& out) const {
        const float size = size_of(static_cast<float>(node.level)), whole = size * size;
        for (std::uint32_t k = node.first_point; k < node.first_point + node.point_count; ++k) {
            const std::uint32_t i = octree_.order()[k];
            const Vec3 sent = (light[i] / pi) * albedo(points[i].place);
            for (int face = 0; face < 6; ++face) {
                const float turned =
                    component(points[i].normal, face / 2) * (face % 2 ? -1.0f : 1.0f);
                if (!(turned > 0 ? open[i].front : open[i].back)) continue;
                out[face].cover += std::abs(turned) * area_ / whole;
                if (turned > 0) out[face].light += (turned * area_ / whole) * sent;
            }
        }
        for (Face& face : out)
            if (face.cover > 1) face = {(1 / face.cover) * face.light, 1};
    }

    /// Seen from each side, the front child covers the one behind it; then the mean of four pairs.
    void average(const raydix::OctreeNode& node, Voxel& out) const {
        for (int face = 0; face < 6; ++face) {
            const std::uint32_t bit = 4u >> (face / 2);
            for (std::uint32_t octant = 0; octant < 8; ++octant) {
                if ((octant & bit) != 0) continue;
                const std::uint32_t front = face % 2 ? octant : octant | bit;
                const Face a = child(node, front, face), b = child(node, front ^ bit, face);
                out[face].light += 0.25f * (a.light + (1 - a.cover) * b.light);
                out[face].cover += 0.25f * (a.cover + (1 - a.cover) * b.cover);
            }
        }
    }
    [[nodiscard]] Face child(const raydix::OctreeNode& node, std::uint32_t octant, int face) const {
        const std::uint32_t index = node.child(octant);
        return index == raydix::no_node ? Face{} : voxels_[index][face];
    }

    /// Between the eight nearest cells of a level; between two levels.
    [[nodiscard]] Face sample(Vec3 point, Vec3 way, float level) const {
        const float l = std::clamp(level, 1.0f, static_cast<float>(octree_.options().max_level));
        const int low = static_cast<int>(l);
        const float part = l - static_cast<float>(low);
        const Face coarse = sample_level(point, way, low);
        if (part == 0) return coarse;
        const Face fine = sample_level(point, way, low + 1);
        return {(1 - part) * coarse.light + part * fine.light,
                (1 - part) * coarse.cover + part * fine.cover};
    }
    [[nodiscard]] Face sample_level(Vec3 point, Vec3 way, int level) const {
        const float cells = static_cast<float>(1 << level);
        const Vec3 at = (cells / edge_) * (point - octree_.bounds().lo) - Vec3{0.5f, 0.5f, 0.5f};
        const Vec3 base{std::floor(at.x), std::floor(at.y), std::floor(at.z)}, part = at - base;
        Face sum;
        for (int k = 0; k < 8; ++k) {
            const int x = k >> 2, y = k >> 1 & 1, z = k & 1;
            const float weight =
                (x ? part.x : 1 - part.x) * (y ? part.y : 1 - part.y) * (z ? part.z : 1 - part.z);
            const std::uint32_t node =
                find(static_cast<int>(base.x) + x, static_cast<int>(base.y) + y,
                     static_cast<int>(base.z) + z, level);
            if (node == raydix::no_node) continue;
            for (int axis = 0; axis < 3; ++axis) {  // the three faces that the cone looks at
                const float along = component(way, axis);
                const Face& face = voxels_[node][2 * axis + (along > 0 ? 1 : 0)];
                sum.light += (weight * std::abs(along)) * face.light;
                sum.cover += weight * std::abs(along) * face.cover;
            }
        }
        return sum;
    }
    /// The node of a cell, or the leaf above it.
    [[nodiscard]] std::uint32_t find(int x, int y, int z, int level) const {
        if (((x | y | z) >> level) != 0) return raydix::no_node;
        std::uint32_t at = 0;
        for (int bit = level - 1; bit >= 0 && at != raydix::no_node; --bit) {
            const raydix::OctreeNode& node = octree_.nodes()[at];
            if (node.is_leaf()) return at;
            at = node.child(static_cast<std::uint32_t>((x >> bit & 1) << 2 | (y >> bit & 1) << 1 |
                                                       (z >> bit & 1)));
        }
        return at;
    }

    std::vector<std::uint32_t> prims_;  // triangles of the points
    raydix::Octree octree_;
    std::vector<Voxel> voxels_;
    float edge_ = 0, area_ = 0;  // of the root cube; that a point stands for
};

}  // namespace example
