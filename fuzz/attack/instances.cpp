// Instances, nested, mirrored, sheared and masked: scenes of many against the least over scenes of
// one, and moves that lose nothing against rays moved by hand.
#include <raydix/error.h>
#include <raydix/instances.h>
#include <raydix/instances_d.h>
#include <raydix/model.h>
#include <raydix/scene.h>
#include <raydix/wide.h>

#include <optional>

#include "attack/any_transform.h"
#include "attack/attack.h"
#include "attack/ray_families.h"
#include "attack/vectors.h"

namespace raydix::attack {
namespace {

struct FloatScenes {
    static constexpr const char* name = "float";
    using Scene = InstancedScene;
    using Placed = Instance;
    using Affine = Transform;
    using AnyRay = Ray;
    using AnyHit = InstanceHit;
    using Whole = raydix::Scene;
    static std::vector<Ray> rays(const std::vector<Ray>& made) { return made; }
};
struct DoubleScenes {
    static constexpr const char* name = "double";
    using Scene = InstancedSceneD;
    using Placed = InstanceD;
    using Affine = TransformD;
    using AnyRay = RayD;
    using AnyHit = InstanceHitD;
    using Whole = SceneD;
    static std::vector<RayD> rays(const std::vector<Ray>& made) {
        std::vector<RayD> wider;
        for (const Ray& ray : made) wider.push_back(to_double(ray));
        return wider;
    }
};

/// One way from the scene to an object.
template <class Kit>
struct Path {
    std::vector<typename Kit::Placed> steps;  // `object` of the last is a tree
    std::array<std::uint32_t, InstanceHit::max_levels> places = InstanceHit::unused();
};

template <class Kit>
class InstanceDuel {
public:
    explicit InstanceDuel(Case& c) : case_(c) {
        const std::uint32_t objects = 1 + c.random.below(3);
        for (std::uint32_t i = 0; i < objects; ++i) {
            meshes_.push_back(any_ordinary_mesh(c.random));
            trees_.push_back(build_bvh(meshes_.back().mesh, any_build_options(c.random)));
        }
        make_scene();
        std::vector<Ray> rays;
        for (int i = 0; i < 3; ++i) {
            const std::vector<Ray> more =
                make_rays(c.random, meshes_[c.random.below(meshes_.size())].mesh, 40);
            rays.insert(rays.end(), more.begin(), more.end());
        }
        rays_ = Kit::rays(rays);
        for (std::size_t i = 0; i < rays_.size(); ++i)
            masks_.push_back(c.random.chance(0.5) ? 0xFFFFFFFFu : c.random.below(8));
    }

    void run() {
        const std::vector<typename Kit::AnyHit> wanted = least_of_single_paths();
        const InstanceTraceOptions options{.masks = masks_, .threads = 1};
        const auto hits = trace(scene_, rays_, options);
        std::vector<std::uint8_t> any(rays_.size());
        trace_any(scene_, rays_, any, options);
        for (std::size_t i = 0; i < rays_.size(); ++i) {
            expect(same(hits[i], wanted[i]), "closest", i, hits[i], wanted[i]);
            expect((any[i] != 0) == wanted[i].hit.hit(), "any", i, hits[i], wanted[i]);
            if (i % 8 == 0)
                expect(same(closest_hit(scene_, rays_[i], masks_[i]), wanted[i]), "single closest",
                       i, hits[i], wanted[i]);
        }
        run_scene(wanted);
    }

private:
    static TestMesh any_ordinary_mesh(Random& random) {
        for (;;) {
            TestMesh made = any_mesh(random, 20);
            const Aabb box = finite_bounds(made.mesh);
            // Instances beyond the range of coordinates are refused.
            const Vec3 size = box.hi - box.lo;
            if (std::max({std::fabs(box.lo.x), std::fabs(box.lo.y), std::fabs(box.lo.z), size.x,
                          size.y, size.z}) < 1e7f)
                return made;
        }
    }

    /// The same instances in a Scene, each way through it.
    void run_scene(const std::vector<typename Kit::AnyHit>& wanted) {
        Random& random = case_.random;
        using Whole = typename Kit::Whole;
        std::vector<Whole> scenes;
        const SceneOptions options{.quality = static_cast<Quality>(random.below(3)),
                                   .usage = static_cast<Usage>(random.below(2)),
                                   .compact = random.chance(0.3),
                                   .threads = 1};
        for (const TestMesh& made : meshes_) {
            if (made.mesh.triangles.empty()) return;
            Model model;
            model.meshes = {made.mesh};
            scenes.emplace_back(model, options);
        }
        for (const auto& shown : shown_) {
            Whole scene;
            for (const auto& placed : shown)
                scene.add(scenes[placed.object], placed.transform, {.mask = placed.mask, .id = {}});
            scene.commit(options);
            scenes.push_back(std::move(scene));
        }
        const Whole& scene = scenes.back();
        const std::vector<std::string> sets = simd_instruction_sets();
        const SceneTraceOptions way{.masks = masks_,
                                    .threads = 1,
                                    .path = static_cast<SimdPath>(random.below(5)),
                                    .isa = sets[random.below(sets.size())]};
        const auto hits = trace(scene, rays_, way);
        std::vector<std::uint8_t> any(rays_.size());
        trace_any(scene, rays_, any, way);
        for (std::size_t i = 0; i < rays_.size(); ++i) {
            const bool hit = wanted[i].hit.hit();
            // Of longer or shorter directions InstancedScene rounds some components to subnormal
            // numbers, or t to infinity, and a Scene does not.
            const auto d = rays_[i].direction;
            const double longest = std::max({std::fabs(d.x), std::fabs(d.y), std::fabs(d.z)});
            if (!(longest > 0x1p-60 && longest < 0x1p60)) continue;
            expect(same_as_scene(scene, hits[i], wanted[i]), "closest of a Scene", i,
                   {hits[i], hits[i].geometry}, wanted[i]);
            expect((any[i] != 0) == hit, "any of a Scene", i, {hits[i]}, wanted[i]);
            if (i % 8 != 0) continue;
            const auto single = closest_hit(scene, rays_[i], masks_[i]);
            expect(same_as_scene(scene, single, wanted[i]), "single closest of a Scene", i,
                   {single, single.geometry}, wanted[i]);
            expect(any_hit(scene, rays_[i], masks_[i]) == hit, "single any of a Scene", i, {single},
                   wanted[i]);
        }
    }
    template <class AnyHit>
    static bool same_as_scene(const typename Kit::Whole& scene, const AnyHit& a,
                              const typename Kit::AnyHit& b) {
        if (a.t != b.hit.t || a.prim != b.hit.prim || a.u != b.hit.u || a.v != b.hit.v)
            return false;
        std::array<std::uint32_t, InstanceHit::max_levels> path = InstanceHit::unused();
        std::ranges::copy(scene.path(a.instance), path.begin());
        return path == b.path;
    }

    void make_scene() {
        Random& random = case_.random;
        std::vector<std::uint32_t> objects, groups;
        for (const Bvh& tree : trees_) objects.push_back(scene_.add_object(tree));
        std::vector<std::vector<Path<Kit>>> paths_of(objects.size());
        for (std::size_t i = 0; i < objects.size(); ++i) paths_of[i].push_back({});
        // Groups show what was made before, the scene itself last.
        const std::uint32_t count = random.below(3);
        auto& shown = shown_;
        for (std::uint32_t g = 0; g <= count; ++g) {
            const std::uint32_t group = g == count ? Kit::Scene::scene : scene_.add_group();
            std::vector<Path<Kit>> paths;
            const std::uint32_t instances = 1 + random.below(5);
            shown.emplace_back();
            for (std::uint32_t k = 0; k < instances; ++k) {
                const std::uint32_t what = random.below(objects.size());
                typename Kit::Placed placed;
                placed.object = objects[what];
                placed.transform = any_transform<typename Kit::Affine>(random);
                placed.mask = random.chance(0.5) ? 0xFFFFFFFFu : random.below(8);
                const std::uint32_t place = scene_.add_instance(group, placed);
                shown.back().push_back(placed);
                shown.back().back().object = what;
                for (const Path<Kit>& below : paths_of[what]) {
                    Path<Kit> path;
                    path.steps.push_back(placed);
                    path.steps.insert(path.steps.end(), below.steps.begin(), below.steps.end());
                    path.places[0] = place;
                    for (std::size_t level = 0; level < below.steps.size(); ++level)
                        path.places[level + 1] = below.places[level];
                    paths.push_back(path);
                }
            }
            if (g == count) {
                paths_ = std::move(paths);
            } else {
                objects.push_back(group);
                paths_of.push_back(std::move(paths));
            }
        }
        objects_ = static_cast<std::uint32_t>(trees_.size());
        first_object_ = objects[0];
        scene_.build(1);
    }

    /// The same path in a scene that has no other.
    typename Kit::Scene scene_of(const Path<Kit>& path) const {
        typename Kit::Scene single;
        std::uint32_t shown = single.add_object(trees_[path.steps.back().object - first_object_]);
        for (std::size_t level = path.steps.size(); level-- > 0;) {
            const std::uint32_t group = level == 0 ? Kit::Scene::scene : single.add_group();
            typename Kit::Placed placed = path.steps[level];
            placed.object = shown;
            single.add_instance(group, placed);
            shown = group;
        }
        single.build(1);
        return single;
    }

    std::vector<typename Kit::AnyHit> least_of_single_paths() const {
        std::vector<typename Kit::AnyHit> least(rays_.size());
        for (const Path<Kit>& path : paths_) {
            const auto single = scene_of(path);
            const auto hits = trace(single, rays_, {.masks = masks_, .threads = 1});
            for (std::size_t i = 0; i < rays_.size(); ++i) {
                if (!hits[i].hit.hit()) continue;
                typename Kit::AnyHit hit = hits[i];
                hit.path = path.places;
                hit.object = path.steps.back().object;
                const bool nearer = !least[i].hit.hit() || hit.hit.t < least[i].hit.t;
                // Ties: the lower path, then the lower primitive.
                if (nearer || (hit.hit.t == least[i].hit.t && hit.path < least[i].path))
                    least[i] = hit;
            }
        }
        return least;
    }

    static bool same(const typename Kit::AnyHit& a, const typename Kit::AnyHit& b) {
        return a.hit.t == b.hit.t && a.hit.prim == b.hit.prim && a.hit.u == b.hit.u &&
               a.hit.v == b.hit.v && a.path == b.path && a.object == b.object;
    }
    void expect(bool right, const char* what, std::size_t i, const typename Kit::AnyHit& got,
                const typename Kit::AnyHit& wanted) {
        case_.expect(right, text("instances/%s", Kit::name), text("%s, %s", what, Kit::name), [&] {
            return text_of(rays_[i]) +
                   text(
                       "    mask %x, %zu paths, first family %s\n    got %s path "
                       "%u %u, wanted %s path %u %u\n",
                       masks_[i], paths_.size(), family_name(meshes_[0].family),
                       text_of(got.hit).c_str(), got.path[0], got.path[1],
                       text_of(wanted.hit).c_str(), wanted.path[0], wanted.path[1]) +
                   text_of(meshes_[0].mesh);
        });
    }

    Case& case_;
    std::vector<TestMesh> meshes_;
    std::vector<Bvh> trees_;
    typename Kit::Scene scene_;
    std::vector<std::vector<typename Kit::Placed>> shown_;  // by groups; objects are counted from 0
    std::vector<Path<Kit>> paths_;
    std::vector<typename Kit::AnyRay> rays_;
    std::vector<std::uint32_t> masks_;
    std::uint32_t objects_ = 0, first_object_ = 0;
};

/// Whole-number moves and mirrors by powers of two: a ray goes into the object without rounding, so
/// its hit is the one of brute force there.
void attack_exact_moves(Case& c) {
    const TestMesh made = closed_mesh(c.random, 40, true);
    const Bvh tree = build_bvh(made.mesh, any_build_options(c.random));
    InstancedScene scene;
    const std::uint32_t object = scene.add_object(tree);
    Instance placed{.object = object};
    Vec3 scale{}, move{};
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
        at(scale, axis) = std::ldexp(c.random.chance(0.5) ? 1.0f : -1.0f, c.random.whole(-2, 2));
        at(move, axis) = static_cast<float>(c.random.whole(-8, 8));
        placed.transform.m[axis] = {0, 0, 0, at(move, axis)};
        placed.transform.m[axis][axis] = at(scale, axis);
    }
    scene.add_instance(InstancedScene::scene, placed);
    scene.build(1);
    std::vector<Ray> rays(60), inside;
    for (Ray& ray : rays) {
        ray = {c.random.whole_point(40), 0, c.random.whole_point(8), infinity};
        Ray moved = ray;
        for (std::uint32_t axis = 0; axis < 3; ++axis) {
            at(moved.origin, axis) = (at(ray.origin, axis) - at(move, axis)) / at(scale, axis);
            at(moved.direction, axis) = at(ray.direction, axis) / at(scale, axis);
        }
        inside.push_back(moved);
    }
    const std::vector<InstanceHit> hits = trace(scene, rays, {.threads = 1});
    const std::vector<Hit> wanted = trace_brute_force(made.mesh, inside, 1);
    for (std::size_t i = 0; i < rays.size(); ++i)
        c.expect(hits[i].hit.t == wanted[i].t && hits[i].hit.prim == wanted[i].prim &&
                     hits[i].hit.u == wanted[i].u && hits[i].hit.v == wanted[i].v,
                 "instances/exact moves", "hit of an exactly moved instance", [&] {
                     return text_of(rays[i]) + "    got " + text_of(hits[i].hit) + ", wanted " +
                            text_of(wanted[i]) + "\n    scale " + text_of(scale) + " move " +
                            text_of(move) + "\n" + text_of(made.mesh);
                 });
}

}  // namespace

static void attack_instances(Case& c) {
    try {
        switch (c.random.below(5)) {
            case 0:
            case 1:
                return InstanceDuel<FloatScenes>(c).run();
            case 2:
            case 3:
                return InstanceDuel<DoubleScenes>(c).run();
            default:
                return attack_exact_moves(c);
        }
    } catch (const InputError&) {
        // Transforms multiply: nearly singular ones and places beyond the range are refused.
        c.compared("instances/refused", 1);
    }
}
static const Kind kind("instances", attack_instances, 1);

}  // namespace raydix::attack
