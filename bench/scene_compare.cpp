#include "scene_compare.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/math.h"
#include "triangle_point.h"

namespace raydix::bench {
namespace {

/// Copies of a ray, moved sideways and turned by up to 2^-17 of the numbers that it is made of.
std::vector<Ray> moved_a_little(const Ray& ray, double scale) {
    const Vec3 d = ray.direction;
    const float length = std::sqrt(dot(d, d));
    const Vec3 across = std::abs(d.x) < 0.5f * length ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
    Vec3 right = cross(d, across);
    right = (1.0f / std::sqrt(dot(right, right))) * right;
    const Vec3 up = (1.0f / length) * cross(right, d);
    std::vector<Ray> rays;
    for (const float part : {0x1p-21f, 0x1p-19f, 0x1p-17f})
        for (int way = 0; way < 16; ++way) {
            const float angle = 0.7853982f * static_cast<float>(way % 8);
            const Vec3 off = part * (std::cos(angle) * right + std::sin(angle) * up);
            Ray moved = ray;
            moved.origin = moved.origin + static_cast<float>(scale) * off;
            // The second half turns back, and ends near where the ray did.
            if (way >= 8) moved.direction = moved.direction - length * off;
            rays.push_back(moved);
        }
    return rays;
}

/// Rays whose answers differ, with their moved copies.
class MovedRays {
public:
    void add(std::size_t index, const Ray& ray, double scale) {
        first_.push_back(rays_.size());
        indices_.push_back(index);
        const std::vector<Ray> moved = moved_a_little(ray, scale);
        rays_.insert(rays_.end(), moved.begin(), moved.end());
    }
    [[nodiscard]] std::span<const Ray> rays() const { return rays_; }
    /// How many differing rays have a copy k for which explains(index, k).
    template <class Explains>
    [[nodiscard]] std::uint64_t count(const Explains& explains) const {
        std::uint64_t explained = 0;
        for (std::size_t i = 0; i < first_.size(); ++i) {
            const std::size_t end = i + 1 < first_.size() ? first_[i + 1] : rays_.size();
            for (std::size_t k = first_[i]; k < end; ++k)
                if (explains(indices_[i], k)) {
                    ++explained;
                    break;
                }
        }
        return explained;
    }

private:
    std::vector<std::size_t> indices_, first_;
    std::vector<Ray> rays_;
};

/// A moved ray may meet a slanted surface this much earlier or later.
constexpr double moved_tolerance = 1e-3;

/// A part of 1 that no peer's answers may differ by: the two would not see the same scene.
constexpr double too_many = 0.02;

void refuse_other_scene(const Differences& found, std::size_t rays, const std::string& who) {
    if (double(found.different()) > too_many * double(rays) + 2)
        throw std::runtime_error(who + ": " + std::to_string(found.different()) + " of " +
                                 std::to_string(rays) + " answers differ");
}

bool same_row(const Ray& ray, const std::vector<float>& a, const std::vector<float>& b,
              double tolerance) {
    if (a.size() != b.size()) return false;
    for (std::size_t k = 0; k < a.size(); ++k)
        if (far_apart(ray, a[k], b[k], tolerance)) return false;
    return true;
}

std::vector<float> each_once(const Ray& ray, const std::vector<float>& row, double tolerance) {
    std::vector<float> once;
    for (const float t : row)
        if (once.empty() || far_apart(ray, once.back(), t, tolerance)) once.push_back(t);
    return once;
}

float distance_by_all_triangles(const Mesh& mesh, Vec3 query) {
    const auto widened = [](Vec3 p) { return Vec3d{p.x, p.y, p.z}; };
    const Vec3d q = widened(query);
    double least = infinity;
    for (const Triangle& t : mesh.triangles) {
        const Vec3d off =
            point_of_triangle(widened(mesh.vertices[t[0]]), widened(mesh.vertices[t[1]]),
                              widened(mesh.vertices[t[2]]), q) -
            q;
        least = std::min(least, inner_product(off, off));
    }
    return static_cast<float>(std::sqrt(least));
}

}  // namespace

void add(Differences& sum, const Differences& more) {
    sum.equal += more.equal;
    sum.other_primitive += more.other_primitive;
    sum.hit_or_miss += more.hit_or_miss;
    sum.distance += more.distance;
    sum.explained += more.explained;
}

Answers::Answers(const RaySide& side, bool any, std::size_t rays) {
    for (std::size_t i = 0; i < rays; ++i)
        if (any)
            found.push_back(side.found(i));
        else
            hits.push_back(side.hit(i));
}

std::uint64_t Answers::hit_count() const {
    const auto is_hit = [](const PlacedHit& hit) { return hit.hit(); };
    return std::uint64_t(std::count_if(hits.begin(), hits.end(), is_hit)) +
           std::uint64_t(std::count(found.begin(), found.end(), std::uint8_t{1}));
}

Differences differences_of(const Comparison& with, const Answers& theirs) {
    const std::span<const Ray> rays = with.rays;
    RaySide& side = with.side;
    Differences found;
    MovedRays moved;
    const bool any = with.any();
    double largest = 0;
    for (const Ray& ray : rays) largest = std::max(largest, scale_of(ray, 0));
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (with.equal(theirs, i)) {
            ++found.equal;
            found.other_primitive +=
                !any && (with.ours.hits[i].prim != theirs.hits[i].prim ||
                         with.ours.hits[i].instance != theirs.hits[i].instance);
            continue;
        }
        ++(with.hit_or_miss(theirs, i) ? found.hit_or_miss : found.distance);
        if (with.robust != nullptr && with.equal(*with.robust, i)) {
            ++found.explained;
            continue;
        }
        moved.add(i, rays[i],
                  any ? largest : scale_of(rays[i], min_of(with.ours.hits[i].t, theirs.hits[i].t)));
    }
    refuse_other_scene(found, rays.size(), with.peer);
    if (moved.rays().empty()) return found;
    side.take(moved.rays());
    send(with.mode, any);
    found.explained += moved.count([&](std::size_t i, std::size_t k) {
        if (any) return side.found(k) == (theirs.found[i] != 0);
        const PlacedHit a = side.hit(k), &b = theirs.hits[i];
        return a.hit() == b.hit() && (!a.hit() || !far_apart(rays[i], a.t, b.t, moved_tolerance));
    });
    side.take(rays);
    return found;
}

Differences differences_of_rows(std::span<const Ray> rays,
                                const std::vector<std::vector<float>>& ours,
                                const AllHitsSide& theirs, const std::string& peer,
                                double tolerance, AllHitsSide& side) {
    Differences found;
    MovedRays moved;
    std::uint64_t same_once = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const std::vector<float> row = theirs.distances(i);
        if (same_row(rays[i], ours[i], row, tolerance)) {
            ++found.equal;
            continue;
        }
        ++(ours[i].empty() != row.empty() ? found.hit_or_miss : found.distance);
        if (same_row(rays[i], each_once(rays[i], ours[i], 4 * tolerance),
                     each_once(rays[i], row, 4 * tolerance), 4 * tolerance))
            ++same_once;
        else
            moved.add(i, rays[i], scale_of(rays[i], row.empty() ? 0.0f : row.back()));
    }
    refuse_other_scene(found, rays.size(), peer);
    if (moved.rays().empty()) {
        found.explained = same_once;
        return found;
    }
    side.take(moved.rays());
    side.modes().front().closest();
    found.explained = same_once + moved.count([&](std::size_t i, std::size_t k) {
        return same_row(rays[i], each_once(rays[i], side.distances(k), moved_tolerance),
                        each_once(rays[i], theirs.distances(i), moved_tolerance), moved_tolerance);
    });
    side.take(rays);
    return found;
}

Differences differences_of_distances(std::span<const Vec3> queries, const Mesh& mesh,
                                     const ClosestSide& ours, const ClosestSide& theirs,
                                     const std::string& peer, double tolerance) {
    Differences found;
    for (std::size_t i = 0; i < queries.size(); ++i) {
        // As of a ray that starts at the query.
        const Ray from{.origin = queries[i], .direction = {1, 0, 0}};
        if (!far_apart(from, ours.distance(i), theirs.distance(i), tolerance)) {
            ++found.equal;
            continue;
        }
        ++found.distance;
        found.explained += !far_apart(from, distance_by_all_triangles(mesh, queries[i]),
                                      ours.distance(i), tolerance);
    }
    refuse_other_scene(found, queries.size(), peer);
    return found;
}

}  // namespace raydix::bench
