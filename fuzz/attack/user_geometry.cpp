// Rays through the caller's own geometry: spheres, capsules and points with a radius as geometries
// of a Scene or a SceneD, as they are and as user geometry, with and without a filter, against the
// same function called for every primitive.
#include <raydix/scene.h>
#include <raydix/user_geometry.h>
#include <raydix/wide.h>

#include <functional>

#include "attack/attack.h"
#include "attack/precision.h"
#include "engine/shape_tree.h"
#include "primitives/double_sources.h"
#include "proximity/shape_hits.h"

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

bool is_kept(const Aabb& box) {
    return build_bvh(std::span<const Aabb>(&box, 1), {.threads = 1}).left_out() == 0;
}
bool is_kept(const AabbD& box) {
    AabbD as_it_is;
    return BoxSourceD{&box}.box(0, as_it_is);
}

/// Shapes as geometry 1 of a scene, in each way that scenes hold them.
template <class In>
class SceneDuel {
public:
    using Scalar = typename In::Scalar;
    using Scene = BasicScene<Scalar>;
    using AnyRay = typename In::AnyRay;
    using AnyHit = typename Scene::Hit;
    using Box = typename Scene::Box;
    using Intersect = std::function<bool(std::uint32_t prim, const AnyRay& ray, AnyHit& hit)>;
    using Filter = std::function<bool(std::size_t place, const AnyRay& ray, const AnyHit& hit)>;

    SceneDuel(Case& c, const char* shape, const BasicShapes<Scalar>& shapes, Intersect intersect,
              const std::vector<AnyRay>& rays)
        : case_(c), shape_(shape), intersect_(std::move(intersect)) {
        // t of longer or shorter directions, and from farther away, may be infinite or subnormal in
        // one unit only.
        for (const AnyRay& ray : rays) {
            const auto length = longest(ray.direction);
            if (sizeof(Scalar) == 8 || (length > Scalar(0x1p-60) && length < Scalar(0x1p60) &&
                                        !(longest(ray.origin) > Scalar(1.6e38))))
                rays_.push_back(ray);
        }
        const SceneOptions options{.quality = static_cast<Quality>(c.random.below(3)),
                                   .usage = static_cast<Usage>(c.random.below(2)),
                                   .threads = 1};
        const std::uint32_t turn = c.random.below(0x10000);
        const auto accepts = [turn](std::uint32_t prim) {
            return ((prim * 40503u ^ turn) >> 3 & 1) != 0;
        };
        const std::vector<Box> boxes = boxes_of<Scalar>(shapes);
        for (const Box& box : boxes) kept_.push_back(is_kept(box));
        for (const bool native : {true, false}) {
            Scene scene;
            scene.add(std::span<const typename In::AnySphere>());
            if (native)
                add(scene, shapes);
            else
                scene.add(BasicUserGeometry<Scalar>(boxes, intersect_));
            scene.commit(options);
            const char* const kind = native ? "in a Scene" : "as user geometry in a Scene";
            run(scene, kind, {}, [](std::uint32_t) { return true; });
            run(
                scene, kind,
                [&](std::size_t, const AnyRay&, const AnyHit& hit) { return accepts(hit.prim); },
                accepts);
        }
    }

private:
    template <class Point>
    static auto longest(const Point& v) {
        return std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)});
    }
    static void add(Scene& scene, const BasicShapes<Scalar>& shapes) {
        std::visit(
            [&](const auto& all) {
                if constexpr (requires { all.centers; })
                    scene.add(all.centers, all.radius);
                else
                    scene.add(all);
            },
            shapes);
    }
    template <class Accepts>
    void run(const Scene& scene, const char* kind, const Filter& filter, const Accepts& accepts) {
        std::vector<bool> kept = kept_;
        for (std::uint32_t i = 0; i < kept.size(); ++i) kept[i] = kept[i] && accepts(i);
        const std::vector<std::string> sets = simd_instruction_sets();
        typename Scene::TraceOptions options;
        options.threads = 1;
        options.path = static_cast<SimdPath>(case_.random.below(5));
        options.isa = sets[case_.random.below(sets.size())];
        options.filter = filter;
        const std::vector<AnyHit> hits = trace(scene, rays_, options);
        std::vector<std::uint8_t> any(rays_.size());
        trace_any(scene, rays_, any, options);
        for (std::size_t i = 0; i < rays_.size(); ++i) {
            const AnyHit wanted = least_of_all<AnyHit>(static_cast<std::uint32_t>(kept.size()),
                                                       kept, intersect_, rays_[i]);
            const auto expect = [&](bool right, const char* what, const AnyHit& got) {
                case_.expect(right, text("user_geometry/%s", In::name),
                             text("%s of %s %s%s, %s", what, shape_, kind,
                                  filter ? ", filtered" : "", In::name),
                             [&] {
                                 return text_of(rays_[i]) + "    got " + text_of(got) +
                                        ", wanted " + text_of(wanted) + "\n";
                             });
            };
            expect(same_place(hits[i], wanted), "closest", hits[i]);
            expect((any[i] != 0) == wanted.hit(), "any", hits[i]);
            expect(!hits[i].hit() || (std::isfinite(hits[i].u) && std::isfinite(hits[i].v)),
                   "a hit without a place: u", hits[i]);
            if (i % 8 != 0) continue;
            const AnyHit one =
                filter ? closest_hit(scene, rays_[i], filter) : closest_hit(scene, rays_[i]);
            expect(same_place(one, wanted), "single closest", one);
            expect((filter ? any_hit(scene, rays_[i], filter) : any_hit(scene, rays_[i])) ==
                       wanted.hit(),
                   "single any", one);
        }
    }
    static bool same_place(const AnyHit& hit, const AnyHit& wanted) {
        return same_hit(hit, wanted) && (!hit.hit() || (hit.geometry == 1 && hit.instance == 0));
    }

    Case& case_;
    const char* shape_;
    Intersect intersect_;
    std::vector<bool> kept_;
    std::vector<AnyRay> rays_;
};

template <class In>
void attack_in(Case& c) {
    using Scalar = typename In::Scalar;
    using AnyRay = typename In::AnyRay;
    using AnyHit = typename SceneDuel<In>::AnyHit;
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
            SceneDuel<In>(
                c, "spheres", all,
                [all](std::uint32_t prim, const AnyRay& ray, AnyHit& hit) {
                    return hit_ball(all[prim].center, all[prim].radius, ray, hit);
                },
                rays);
            break;
        }
        case 1: {
            using AnyCapsule = BasicCapsule<Scalar>;
            std::vector<AnyCapsule> capsules;
            for (int i = 0; i < 20; ++i)
                capsules.push_back({scenery.place(c.random), scenery.place(c.random), radius()});
            const std::span<const AnyCapsule> all(capsules);
            SceneDuel<In>(
                c, "capsules", all,
                [all](std::uint32_t prim, const AnyRay& ray, AnyHit& hit) {
                    return hit_capsule(all[prim], ray, hit);
                },
                rays);
            break;
        }
        default: {
            const Scalar common = radius();
            const std::span<const typename In::Point> points = scenery.mesh.vertices;
            SceneDuel<In>(
                c, "points", BasicBalls<Scalar>{points, common},
                [points, common](std::uint32_t prim, const AnyRay& ray, AnyHit& hit) {
                    return hit_ball(points[prim], common, ray, hit);
                },
                rays);
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

static const Kind user_geometry_kind("user_geometry", attack_user_geometry, 1);

}  // namespace raydix::attack
