// Rays through the caller's own geometry: spheres, capsules, points with a radius and boxes,
// through one tree and as geometries of a Scene with and without a filter, against the same
// function called for every primitive, and spheres against extended precision.
#include <raydix/scene.h>
#include <raydix/user_geometry.h>
#include <raydix/user_geometry_d.h>
#include <raydix/wide.h>

#include "attack/attack.h"
#include "attack/precision.h"

namespace raydix::attack {
namespace {

/// The least (t, prim) of `intersect` over all primitives that builders keep.
template <class AnyHit, class AnyRay, class Intersect>
AnyHit least_of_all(std::uint32_t count, const std::vector<bool>& kept, const Intersect& intersect,
                    AnyRay ray) {
    AnyHit best;
    if (!is_finite(ray.origin) || !is_finite(ray.direction) ||
        (ray.direction.x == 0 && ray.direction.y == 0 && ray.direction.z == 0) ||
        !(ray.tmin <= ray.tmax))
        return best;
    ray.tmin = std::max(ray.tmin, decltype(ray.tmin)(0));
    if (!(ray.tmin <= ray.tmax)) return best;
    for (std::uint32_t i = 0; i < count; ++i) {
        AnyHit hit;
        if (!kept[i] || !intersect(i, ray, hit)) continue;
        if (!(hit.t >= ray.tmin && hit.t <= ray.tmax)) continue;
        if (!best.hit() || hit.t < best.t) {
            best = hit;
            best.prim = i;
        }
    }
    return best;
}

template <class Scalar>
bool same_number(Scalar a, Scalar b) {
    return a == b || (std::isnan(a) && std::isnan(b));
}
template <class AnyHit>
bool same_hit(const AnyHit& a, const AnyHit& b) {
    return a.prim == b.prim && (!a.hit() || (a.t == b.t && same_number(a.u, b.u) && a.v == b.v));
}

template <class Box>
std::vector<bool> kept_boxes(const std::vector<Box>& boxes) {
    std::vector<bool> kept;
    for (const Box& box : boxes) {
        const Box single[] = {box};
        kept.push_back(build_bvh(std::span<const Box>(single), {.threads = 1}).left_out() == 0);
    }
    return kept;
}

/// Shapes as geometry 1 of a scene, in each way that scenes hold them. add(scene): as they are.
template <class Add>
class SceneDuel {
public:
    SceneDuel(Case& c, const char* shape, const std::vector<Aabb>& boxes,
              const IntersectPrimitive& intersect, const std::vector<Ray>& rays, const Add& add)
        : case_(c), shape_(shape), boxes_(boxes), intersect_(intersect) {
        // t of longer or shorter directions, and from farther away, may be infinite or subnormal in
        // one unit only.
        const auto longest = [](Vec3 v) {
            return std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)});
        };
        for (const Ray& ray : rays) {
            const float length = longest(ray.direction);
            if (length > 0x1p-60f && length < 0x1p60f && !(longest(ray.origin) > 1.6e38f))
                rays_.push_back(ray);
        }
        const SceneOptions options{.quality = static_cast<Quality>(c.random.below(3)),
                                   .usage = static_cast<Usage>(c.random.below(2)),
                                   .threads = 1};
        const std::uint32_t turn = c.random.below(0x10000);
        const auto accepts = [turn](std::uint32_t prim) {
            return ((prim * 40503u ^ turn) >> 3 & 1) != 0;
        };
        for (const bool native : {true, false}) {
            Scene scene;
            const std::vector<Sphere> none;
            scene.add(std::span<const Sphere>(none));
            if (native)
                add(scene);
            else
                scene.add(UserGeometry(boxes, intersect));
            scene.commit(options);
            const char* const kind = native ? "in a Scene" : "as user geometry in a Scene";
            run(scene, kind, {}, [](std::uint32_t) { return true; });
            run(
                scene, kind,
                [&](std::size_t, const Ray&, const Hit& hit) { return accepts(hit.prim); },
                accepts);
        }
    }

private:
    template <class Accepts>
    void run(const Scene& scene, const char* kind, const HitFilter& filter,
             const Accepts& accepts) {
        std::vector<bool> kept = kept_boxes(boxes_);
        for (std::uint32_t i = 0; i < kept.size(); ++i) kept[i] = kept[i] && accepts(i);
        const std::vector<std::string> sets = simd_instruction_sets();
        SceneTraceOptions options;
        options.threads = 1;
        options.path = static_cast<SimdPath>(case_.random.below(5));
        options.isa = sets[case_.random.below(sets.size())];
        options.filter = filter;
        const std::vector<Hit> hits = trace(scene, rays_, options);
        std::vector<std::uint8_t> any(rays_.size());
        trace_any(scene, rays_, any, options);
        for (std::size_t i = 0; i < rays_.size(); ++i) {
            const Hit wanted = least_of_all<Hit>(static_cast<std::uint32_t>(boxes_.size()), kept,
                                                 intersect_, rays_[i]);
            const auto expect = [&](bool right, const char* what, const Hit& got) {
                case_.expect(right, "user_geometry/scene",
                             text("%s of %s %s%s", what, shape_, kind, filter ? ", filtered" : ""),
                             [&] {
                                 return text_of(rays_[i]) + "    got " + text_of(got) +
                                        ", wanted " + text_of(wanted) + "\n";
                             });
            };
            expect(same_place(hits[i], wanted), "closest", hits[i]);
            expect((any[i] != 0) == wanted.hit(), "any", hits[i]);
            if (i % 8 != 0) continue;
            const Hit one =
                filter ? closest_hit(scene, rays_[i], filter) : closest_hit(scene, rays_[i]);
            expect(same_place(one, wanted), "single closest", one);
            expect((filter ? any_hit(scene, rays_[i], filter) : any_hit(scene, rays_[i])) ==
                       wanted.hit(),
                   "single any", one);
        }
    }
    static bool same_place(const Hit& hit, const Hit& wanted) {
        return same_hit(hit, wanted) && (!hit.hit() || (hit.geometry == 1 && hit.instance == 0));
    }

    Case& case_;
    const char* shape_;
    const std::vector<Aabb>& boxes_;
    const IntersectPrimitive& intersect_;
    std::vector<Ray> rays_;
};

template <class In, class Box, class Intersect, class Add>
void duel(Case& c, const char* shape, const std::vector<Box>& boxes, const Intersect& intersect,
          const std::vector<typename In::AnyRay>& rays, const Add& add) {
    if constexpr (std::is_same_v<Box, Aabb>) SceneDuel(c, shape, boxes, intersect, rays, add);
    using AnyHit = decltype(closest_hit(build_bvh(std::span<const Box>(boxes), BuildOptions{}),
                                        intersect, rays[0]));
    const std::vector<bool> kept = kept_boxes(boxes);
    std::vector<AnyHit> wanted;
    for (const auto& ray : rays)
        wanted.push_back(
            least_of_all<AnyHit>(static_cast<std::uint32_t>(boxes.size()), kept, intersect, ray));
    for (const BuildOptions& build : every_builder(c.random)) {
        const auto tree = build_bvh(std::span<const Box>(boxes), build);
        std::vector<AnyHit> hits(rays.size());
        std::vector<std::uint8_t> any(rays.size());
        trace(tree, intersect, std::span(rays), hits, {.threads = 1});
        trace_any(tree, intersect, std::span(rays), any, {.threads = 1});
        for (std::size_t i = 0; i < rays.size(); ++i) {
            const auto expect = [&](bool right, const char* what) {
                c.expect(right, text("user_geometry/%s", In::name),
                         text("%s of %s, %s", what, shape, In::name), [&] {
                             return "    " + text_of(build) + "\n" + text_of(rays[i]) + "    got " +
                                    text_of(hits[i]) + ", wanted " + text_of(wanted[i]) + "\n";
                         });
            };
            expect(same_hit(hits[i], wanted[i]), "closest");
            expect((any[i] != 0) == wanted[i].hit(), "any");
            expect(!hits[i].hit() || (std::isfinite(hits[i].u) && std::isfinite(hits[i].v)),
                   "a hit without a place: u");
            if (i % 8 != 0) continue;
            expect(same_hit(closest_hit(tree, intersect, rays[i]), wanted[i]), "single closest");
            expect(any_hit(tree, intersect, rays[i]) == wanted[i].hit(), "single any");
        }
    }
}

template <class In>
void attack_in(Case& c) {
    using Scalar = typename In::Scalar;
    // Lengths of ordinary size: what the boxes of the shapes promise is relative to them.
    const Family families[] = {Family::soup, Family::voxels, Family::grid, Family::sphere,
                               Family::tetrahedra};
    const Scenery<In> scenery(c.random, make_mesh(c.random, c.random.one_of(families), 12));
    const auto rays = scenery.rays(c.random, 80);
    const auto radius = [&] {
        return static_cast<Scalar>(scenery.size() * c.random.power_of_ten(-3, -0.3));
    };
    switch (c.random.below(3)) {
        case 0: {
            std::vector<typename In::AnySphere> spheres;
            for (int i = 0; i < 20; ++i) spheres.push_back({scenery.place(c.random), radius()});
            const std::span<const typename In::AnySphere> all(spheres);
            return duel<In>(c, "spheres", boxes_of(all), intersect_spheres(all), rays,
                            [&](auto& scene) { scene.add(all); });
        }
        case 1: {
            using AnyCapsule = std::conditional_t<sizeof(Scalar) == 4, Capsule, CapsuleD>;
            std::vector<AnyCapsule> capsules;
            for (int i = 0; i < 20; ++i)
                capsules.push_back({scenery.place(c.random), scenery.place(c.random), radius()});
            const std::span<const AnyCapsule> all(capsules);
            return duel<In>(c, "capsules", boxes_of(all), intersect_capsules(all), rays,
                            [&](auto& scene) { scene.add(all); });
        }
        default: {
            const Scalar common = radius();
            const std::span<const typename In::Point> points = scenery.mesh.vertices;
            return duel<In>(c, "points", boxes_of(points, common), intersect_points(points, common),
                            rays, [&](auto& scene) { scene.add(points, common); });
        }
    }
}

}  // namespace

static void attack_user_geometry(Case& c) {
    if (c.random.chance(0.5))
        attack_in<InFloat>(c);
    else
        attack_in<InDouble>(c);
}

static const Kind kind("user_geometry", attack_user_geometry, 1);

}  // namespace raydix::attack
