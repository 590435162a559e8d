// Spheres, capsules, points and geometry of the caller's own in scenes of doubles, nested and
// masked: rays against the same function on every primitive of every path, closest points and
// spheres that touch against extended precision.
#include <raydix/error.h>
#include <raydix/scene.h>
#include <raydix/scene_queries.h>
#include <raydix/user_geometry.h>
#include <raydix/wide.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "attack/any_transform.h"
#include "attack/attack.h"
#include "attack/precision.h"
#include "engine/affine_double.h"
#include "proximity/shape_hits.h"
#include "trace/ray_frame.h"

namespace raydix::attack {
namespace {

enum class Shape { spheres, capsules, points, users };

/// A geometry; a sphere is a capsule whose ends are the same.
struct Shapes {
    Shape shape = Shape::spheres;
    std::uint32_t id = 0, mask = 0;
    std::vector<CapsuleD> all;

    [[nodiscard]] bool hit(std::uint32_t prim, const RayD& ray, HitD& out) const {
        const CapsuleD& s = all[prim];
        return shape == Shape::capsules ? hit_capsule(s, ray, out)
                                        : hit_ball(s.a, s.radius, ray, out);
    }
};

struct Placed {
    std::size_t holder;
    TransformD transform;
    std::uint32_t mask;
};

struct Holder {
    std::vector<Shapes> shapes;  // their ids come first
    std::vector<Placed> placed;
    SceneD scene;
    std::uint32_t paths = 0;
};

auto order_of(const HitD& hit) { return std::tuple(hit.t, hit.instance, hit.geometry, hit.prim); }

class ShapesDuel {
public:
    explicit ShapesDuel(Case& c)
        : case_(c), scenery_(c.random, make_mesh(c.random, Family::soup, 12)) {
        const std::uint32_t levels = c.random.below(3);
        for (std::uint32_t level = 0; level <= levels; ++level) make_holder();
        rays_ = scenery_.rays(c.random, 90);
        for (std::size_t i = 0; i < rays_.size(); ++i) masks_.push_back(any_mask());
    }

    void run() {
        rays();
        if (holders_.size() == 1) distances();
    }

private:
    [[nodiscard]] Random& random() { return case_.random; }
    [[nodiscard]] const SceneD& scene() const { return holders_.back().scene; }
    std::uint32_t any_mask() { return random().chance(0.6) ? 0xFFFFFFFFu : random().below(8); }
    double any_radius() { return scenery_.size() * double{random().power_of_ten(-3, -0.3)}; }

    Shapes any_shapes() {
        Shapes made;
        made.shape = static_cast<Shape>(random().below(4));
        const double common = any_radius();
        const std::uint32_t count = 1 + random().below(20);
        for (std::uint32_t k = 0; k < count; ++k) {
            const Vec3d a = scenery_.place(random());
            const bool is_capsule = made.shape == Shape::capsules && !random().chance(0.1);
            const Vec3d b = is_capsule ? scenery_.place(random()) : a;
            // Others are left out.
            if (!in_range(a) || !in_range(b)) continue;
            made.all.push_back({a, b, made.shape == Shape::points ? common : any_radius()});
        }
        return made;
    }
    static bool in_range(Vec3d p) {
        return std::max({std::fabs(p.x), std::fabs(p.y), std::fabs(p.z)}) < 1e11;
    }

    static void add(const Shapes& made, const GeometryOptions& with, SceneD& scene) {
        std::vector<SphereD> spheres;
        std::vector<Vec3d> points;
        std::vector<AabbD> boxes;
        for (const CapsuleD& s : made.all) {
            spheres.push_back({s.a, s.radius});
            points.push_back(s.a);
            const double r = s.radius * (1 + 1e-9);
            boxes.push_back({{s.a.x - r, s.a.y - r, s.a.z - r}, {s.a.x + r, s.a.y + r, s.a.z + r}});
        }
        switch (made.shape) {
            case Shape::spheres:
                scene.add(std::span<const SphereD>(spheres), with);
                return;
            case Shape::capsules:
                scene.add(std::span<const CapsuleD>(made.all), with);
                return;
            case Shape::points:
                scene.add(points, made.all.empty() ? 1.0 : made.all.front().radius, with);
                return;
            case Shape::users:
                scene.add(
                    UserGeometryD(boxes, [made](std::uint32_t prim, const RayD& ray,
                                                HitD& hit) { return made.hit(prim, ray, hit); }),
                    with);
        }
    }

    void make_holder() {
        Holder made;
        std::uint32_t id = 0;
        const std::uint32_t count = random().below(3) + (holders_.empty() ? 1 : 0);
        for (std::uint32_t k = 0; k < count; ++k) {
            made.shapes.push_back(any_shapes());
            made.shapes.back().id = id++;
            made.shapes.back().mask = any_mask();
            add(made.shapes.back(), {.mask = made.shapes.back().mask, .id = {}}, made.scene);
        }
        const std::uint32_t instances = holders_.empty() ? 0 : 1 + random().below(3);
        for (std::uint32_t k = 0; k < instances; ++k) {
            const std::size_t inner = random().below(holders_.size());
            const auto transform = any_transform<TransformD>(random());
            made.placed.push_back({inner, transform, any_mask()});
            made.scene.add(holders_[inner].scene, transform,
                           {.mask = made.placed.back().mask, .id = {}});
            made.paths += 1 + holders_[inner].paths;
        }
        made.scene.commit({.quality = static_cast<Quality>(random().below(3)),
                           .usage = static_cast<Usage>(random().below(2)),
                           .threads = 1});
        holders_.push_back(std::move(made));
    }

    /// All hits of a ray, in no order.
    void collect(const Holder& holder, std::uint32_t number, const LineD& line, const RayD& limits,
                 std::uint32_t mask, std::vector<HitD>& out) const {
        RayD ray = line.ray(limits.tmin, limits.tmax);
        if (is_valid(ray)) {
            ray.tmin = std::max(ray.tmin, 0.0);
            for (const Shapes& shapes : holder.shapes)
                for (std::uint32_t prim = 0; prim < shapes.all.size(); ++prim) {
                    HitD hit;
                    if ((shapes.mask & mask) == 0 || !shapes.hit(prim, ray, hit)) continue;
                    hit.prim = prim, hit.geometry = shapes.id, hit.instance = number;
                    out.push_back(hit);
                }
        }
        std::uint32_t next = number + 1;
        for (const Placed& placed : holder.placed) {
            if ((placed.mask & mask) != 0)
                collect(holders_[placed.holder], next,
                        line.into(*inverse_of(affine_of(placed.transform))), limits, mask, out);
            next += 1 + holders_[placed.holder].paths;
        }
    }

    void rays() {
        const std::vector<std::string> sets = simd_instruction_sets();
        const SceneTraceOptionsD options{.masks = masks_,
                                         .threads = 1,
                                         .path = static_cast<SimdPath>(random().below(5)),
                                         .isa = sets[random().below(sets.size())]};
        const std::vector<HitD> closest = trace(scene(), rays_, options);
        const AllHitsD all = trace_all(scene(), rays_, options);
        std::vector<std::uint8_t> any(rays_.size());
        trace_any(scene(), rays_, any, options);
        for (std::size_t i = 0; i < rays_.size(); ++i) {
            std::vector<HitD> wanted;
            if (is_valid(rays_[i]))
                collect(holders_.back(), 0, LineD(rays_[i]), rays_[i], masks_[i], wanted);
            std::ranges::sort(wanted, {}, order_of);
            const HitD first = wanted.empty() ? HitD{} : wanted.front();
            const auto expect = [&](bool right, const char* what, const HitD& got) {
                case_.expect(right, "double_shapes/rays", what, [&] {
                    return text_of(rays_[i]) + "    got " + text_of(got) + ", wanted " +
                           text_of(first) +
                           text(" of geometry %u path %u, mask %x\n", first.geometry,
                                first.instance, masks_[i]);
                });
            };
            expect(closest[i] == first, "closest", closest[i]);
            expect((any[i] != 0) == first.hit(), "any", closest[i]);
            const std::span<const HitD> row =
                std::span(all.hits).subspan(all.offsets[i], all.offsets[i + 1] - all.offsets[i]);
            expect(std::ranges::equal(row, wanted), "all", row.empty() ? HitD{} : row.front());
            if (i % 8 != 0) continue;
            const HitD one = closest_hit(scene(), rays_[i], masks_[i]);
            expect(one == first, "single closest", one);
            expect(any_hit(scene(), rays_[i], masks_[i]) == first.hit(), "single any", one);
        }
    }

    /// From the surface; 0 inside.
    static long double distance(Vec3d p, const CapsuleD& s) {
        using Real = long double;
        const Real a[3] = {Real(p.x) - s.a.x, Real(p.y) - s.a.y, Real(p.z) - s.a.z},
                   axis[3] = {Real(s.b.x) - s.a.x, Real(s.b.y) - s.a.y, Real(s.b.z) - s.a.z};
        Real along = 0, length2 = 0, d2 = 0;
        for (int k = 0; k < 3; ++k) along += a[k] * axis[k], length2 += axis[k] * axis[k];
        along = length2 > 0 ? std::clamp<Real>(along / length2, 0, 1) : 0;
        for (int k = 0; k < 3; ++k) d2 += (a[k] - along * axis[k]) * (a[k] - along * axis[k]);
        return std::max<Real>(std::sqrt(d2) - s.radius, 0);
    }

    void distances() {
        // Geometry of the caller's own has none.
        std::uint32_t mask = 0;
        for (std::uint32_t bit = 1; bit <= 4; bit *= 2) {
            bool known = true;
            for (const Shapes& shapes : holders_.back().shapes)
                known = known && (shapes.shape != Shape::users || (shapes.mask & bit) == 0);
            if (known) mask |= bit;
        }
        for (int i = 0; i < 30; ++i) {
            const Vec3d query = scenery_.place(random());
            if (!in_range(query)) continue;
            long double nearest = infinity, reach = 0;
            for (const Shapes& shapes : holders_.back().shapes) {
                if ((shapes.mask & mask) == 0) continue;
                for (const CapsuleD& s : shapes.all) {
                    nearest = std::min(nearest, distance(query, s));
                    for (const double x : {s.a.x, s.a.y, s.a.z, s.b.x, s.b.y, s.b.z, s.radius})
                        reach = std::max(reach, std::fabs(static_cast<long double>(x)));
                }
            }
            const SceneClosestPointD got = closest_point(scene(), query, infinity, mask);
            const double far =
                std::max({std::fabs(query.x), std::fabs(query.y), std::fabs(query.z)});
            const long double slack = 0x1p-48L * (reach + far);
            expect(got.found() == (nearest < infinity), "closest point: found", query);
            if (!got.found()) continue;
            expect(std::fabs(got.distance - nearest) <= slack, "closest point: distance", query);
            const double radius = any_radius();
            if (std::fabs(radius - nearest) > 4 * slack)
                expect(touches(scene(), SphereD{query, radius}, mask) == (nearest < radius),
                       "touches", query);
        }
    }
    void expect(bool right, const char* what, Vec3d query) {
        case_.expect(right, "double_shapes/distances", what,
                     [&] { return "    query " + text_of(query) + "\n"; });
    }

    Case& case_;
    const Scenery<InDouble> scenery_;
    std::vector<Holder> holders_;
    std::vector<RayD> rays_;
    std::vector<std::uint32_t> masks_;
};

}  // namespace

static void attack_double_shapes(Case& c) {
    try {
        ShapesDuel(c).run();
    } catch (const InputError&) {
        // Transforms multiply: nearly singular ones are refused.
        c.compared("double_shapes/refused", 1);
    }
}

static const Kind double_shapes_kind("double_shapes", attack_double_shapes, 0.5);

}  // namespace raydix::attack
