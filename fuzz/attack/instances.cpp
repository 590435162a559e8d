// Instances, nested, mirrored, sheared and masked: scenes of many against the least over every mesh
// on every path, and moves that lose nothing against rays moved by hand.
#include <raydix/double.h>
#include <raydix/error.h>
#include <raydix/scene.h>
#include <raydix/trace.h>
#include <raydix/wide.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <tuple>

#include "attack/any_transform.h"
#include "attack/attack.h"
#include "attack/ray_families.h"
#include "attack/vectors.h"
#include "engine/affine.h"
#include "engine/affine_double.h"
#include "trace/ray_frame.h"

namespace raydix::attack {
namespace {

SceneOptions any_scene_options(Random& random) {
    return {.quality = static_cast<Quality>(random.below(3)),
            .usage = static_cast<Usage>(random.below(2)),
            .compact = random.chance(0.3),
            .threads = 1};
}

/// A ray where it meets triangles. t of the caller's ray = scale * t of this one.
template <class AnyRay>
struct Inside {
    AnyRay ray;
    double scale = 1;
};

/// Brings the direction near unit length, by a power of two, as docs/algorithms/scenes.md has it
/// for every level: floats have no less of its smaller components than of a caller's then.
void bring_near_unit_length(WideRayLine& line, double& scale) {
    const Double3 d = line.direction;
    double longest = std::max({std::fabs(d.x), std::fabs(d.y), std::fabs(d.z)});
    if (longest == 0 || !std::isfinite(longest)) return;
    if (longest > 0x1p-3 && longest < 0x1p3)
        longest = static_cast<float>(longest);  // as they see it
    const double by = longest >= 0x1p125 && longest < 0x1p128 ? 0x1p-125 : direction_scale(longest);
    line.direction = d * by;
    scale *= by;
}

struct InstancesFloat {
    static constexpr const char* name = "float";
    using Scene = raydix::Scene;
    using Map = Transform;
    using Inverse = Affine;
    using AnyRay = Ray;
    using AnyHit = Hit;
    using AnyMesh = Mesh;

    static Ray ray(const Ray& made) { return made; }
    static Mesh mesh(const Mesh& made) { return made; }
    static Inside<Ray> inside(const Ray& ray, const std::vector<Inverse>& way) {
        WideRayLine line{Double3(ray.origin), Double3(ray.direction)};
        double scale = 1;
        bring_near_unit_length(line, scale);
        for (const Inverse& inverse : way) {
            line = line.into(inverse);
            bring_near_unit_length(line, scale);
        }
        constexpr float most = std::numeric_limits<float>::max();
        const auto end = static_cast<float>(double{ray.tmax > most ? most : ray.tmax} / scale);
        return {line.rounded(start_in_units(ray.tmin, scale), end), scale};
    }
    static std::vector<Hit> of_all_triangles(const Mesh& mesh, const std::vector<Ray>& rays) {
        return trace_brute_force(mesh, rays, 1);
    }
};
struct InstancesDouble {
    static constexpr const char* name = "double";
    using Scene = SceneD;
    using Map = TransformD;
    using Inverse = InverseD;
    using AnyRay = RayD;
    using AnyHit = HitD;
    using AnyMesh = MeshD;

    static RayD ray(const Ray& made) { return to_double(made); }
    static MeshD mesh(const Mesh& made) {
        MeshD mesh;
        for (const Vec3 p : made.vertices) mesh.vertices.push_back(wide(p));
        mesh.triangles = made.triangles;
        return mesh;
    }
    static Inside<RayD> inside(const RayD& ray, const std::vector<Inverse>& way) {
        LineD line(ray);
        for (const Inverse& inverse : way) line = line.into(inverse);
        return {line.ray(ray.tmin, ray.tmax)};
    }
    static std::vector<HitD> of_all_triangles(const MeshD& mesh, const std::vector<RayD>& rays) {
        return trace_brute_force(mesh, rays, 1);
    }
};

template <class Kit>
class InstanceDuel {
    using AnyHit = typename Kit::AnyHit;
    using AnyRay = typename Kit::AnyRay;

public:
    explicit InstanceDuel(Case& c) : case_(c) {
        const std::uint32_t meshes = 1 + c.random.below(3);
        for (std::uint32_t i = 0; i < meshes; ++i) {
            made_.push_back(any_ordinary_mesh(c.random));
            meshes_.push_back(Kit::mesh(made_.back().mesh));
        }
        for (int i = 0; i < 3; ++i)
            for (const Ray& ray : make_rays(c.random, made_[c.random.below(meshes)].mesh, 40))
                rays_.push_back(Kit::ray(ray));
        for (const Ray& ray : make_extreme_rays(c.random, made_[0].mesh, 24))
            rays_.push_back(Kit::ray(ray));
        for (std::size_t i = 0; i < rays_.size(); ++i)
            masks_.push_back(c.random.chance(0.5) ? 0xFFFFFFFFu : c.random.below(8));
        make_scenes();
    }

    void run() {
        const std::vector<AnyHit> wanted = least_of_all_paths();
        const std::vector<std::string> sets = simd_instruction_sets();
        Random& random = case_.random;
        const typename Kit::Scene::TraceOptions way{.masks = masks_,
                                                    .threads = 1,
                                                    .path = static_cast<SimdPath>(random.below(5)),
                                                    .isa = sets[random.below(sets.size())]};
        const typename Kit::Scene& scene = scenes_.back();
        const std::vector<AnyHit> hits = trace(scene, rays_, way);
        std::vector<std::uint8_t> any(rays_.size());
        trace_any(scene, rays_, any, way);
        for (std::size_t i = 0; i < rays_.size(); ++i) {
            const bool hit = wanted[i].hit();
            expect(!hit || std::isfinite(hits[i].t), "a hit at infinity", i, hits[i], wanted[i]);
            expect(same(hits[i], wanted[i]), "closest", i, hits[i], wanted[i]);
            expect((any[i] != 0) == hit, "any", i, hits[i], wanted[i]);
            if (i % 8 != 0) continue;
            const AnyHit single = closest_hit(scene, rays_[i], masks_[i]);
            expect(same(single, wanted[i]), "single closest", i, single, wanted[i]);
            expect(any_hit(scene, rays_[i], masks_[i]) == hit, "single any", i, single, wanted[i]);
        }
    }

private:
    /// A mesh on one way to it.
    struct Shown {
        std::size_t mesh;
        std::uint32_t number = 0;  // of the path
        std::vector<typename Kit::Inverse> way;
        std::vector<std::uint32_t> masks;

        [[nodiscard]] bool seen_by(std::uint32_t mask) const {
            return std::ranges::all_of(masks, [&](std::uint32_t m) { return (m & mask) != 0; });
        }
    };

    static TestMesh any_ordinary_mesh(Random& random) {
        for (;;) {
            TestMesh made = any_mesh(random, 20);
            const Aabb box = finite_bounds(made.mesh);
            // Instances beyond the range of coordinates are refused.
            const Vec3 size = box.hi - box.lo;
            if (!made.mesh.triangles.empty() &&
                std::max({std::fabs(box.lo.x), std::fabs(box.lo.y), std::fabs(box.lo.z), size.x,
                          size.y, size.z}) < 1e7f)
                return made;
        }
    }

    struct Member {
        std::size_t what;  // of scenes_
        typename Kit::Map map;
        std::uint32_t mask;
    };
    Member any_member(std::size_t what) {
        Random& random = case_.random;
        const auto map = any_transform<typename Kit::Map>(random);
        return {what, map, random.chance(0.5) ? 0xFFFFFFFFu : random.below(8)};
    }

    /// Commits after few changes; those of the last one are still to be committed.
    void move_some(typename Kit::Scene& scene, const SceneOptions& options,
                   std::vector<Member>& members) {
        for (std::uint32_t round = 0; round < 6; ++round) {
            scene.commit(options);
            const std::uint32_t k = case_.random.below(static_cast<std::uint32_t>(members.size()));
            members[k] = any_member(members[k].what);
            scene.set_transform(k, members[k].map);
            scene.set_mask(k, members[k].mask);
        }
    }

    /// The meshes, then scenes that show what was made before; the last is what rays go through.
    void make_scenes() {
        Random& random = case_.random;
        SceneOptions options = any_scene_options(random);
        std::vector<std::vector<Shown>> lists;
        std::vector<std::uint32_t> paths(meshes_.size(), 0);
        for (std::size_t i = 0; i < meshes_.size(); ++i) {
            scenes_.emplace_back(meshes_[i], options);
            lists.push_back({{i, 0, {}, {}}});
        }
        const std::uint32_t count = random.below(3);
        for (std::uint32_t g = 0; g <= count; ++g) {
            typename Kit::Scene scene;
            std::vector<Shown> list;
            std::uint32_t number = 0;
            // Of many that each place one mesh a few may move within the tree of the last commit.
            const bool moves = g == count && random.chance(0.3);
            const std::uint32_t instances = moves ? 16 + random.below(24) : 1 + random.below(5);
            std::vector<Member> members;
            for (std::uint32_t k = 0; k < instances; ++k) {
                const std::size_t shown = moves ? meshes_.size() : scenes_.size();
                members.push_back(any_member(random.below(static_cast<std::uint32_t>(shown))));
                scene.add(scenes_[members[k].what], members[k].map,
                          {.mask = members[k].mask, .id = {}});
            }
            if (moves) {
                options.usage = Usage::moving;
                options.refit_limit = random.chance(0.5) ? 1e30 : 1.5;
                move_some(scene, options, members);
            }
            for (const Member& member : members) {
                ++number;
                for (Shown shown : lists[member.what]) {
                    shown.number += number;
                    shown.way.insert(shown.way.begin(), *inverse_of(affine_of(member.map)));
                    shown.masks.push_back(member.mask);
                    list.push_back(std::move(shown));
                }
                number += paths[member.what];
            }
            scene.commit(options);
            scenes_.push_back(std::move(scene));
            lists.push_back(std::move(list));
            paths.push_back(number);
        }
        shown_ = std::move(lists.back());
    }

    std::vector<AnyHit> least_of_all_paths() const {
        std::vector<AnyHit> least(rays_.size());
        for (const Shown& shown : shown_) {
            std::vector<AnyRay> inside;
            std::vector<double> scales;
            for (const AnyRay& ray : rays_) {
                // Invalid ones may be valid once they are moved.
                const auto moved =
                    is_valid(ray) ? Kit::inside(ray, shown.way) : Inside<AnyRay>{ray};
                inside.push_back(moved.ray);
                scales.push_back(moved.scale);
            }
            const auto hits = Kit::of_all_triangles(meshes_[shown.mesh], inside);
            for (std::size_t i = 0; i < rays_.size(); ++i) {
                if (!hits[i].hit() || !shown.seen_by(masks_[i])) continue;
                AnyHit hit{hits[i], 0, shown.number};
                hit.t = static_cast<decltype(hit.t)>(double{hit.t} * scales[i]);
                const auto order = [](const AnyHit& h) { return std::tuple(h.t, h.instance); };
                if (!least[i].hit() || order(hit) < order(least[i])) least[i] = hit;
            }
        }
        return least;
    }

    static bool same(const AnyHit& a, const AnyHit& b) {
        return a.t == b.t && a.prim == b.prim && a.u == b.u && a.v == b.v &&
               a.geometry == b.geometry && a.instance == b.instance;
    }
    void expect(bool right, const char* what, std::size_t i, const AnyHit& got,
                const AnyHit& wanted) {
        case_.expect(right, text("instances/%s", Kit::name), text("%s, %s", what, Kit::name), [&] {
            return text_of(rays_[i]) +
                   text(
                       "    mask %x, %zu meshes on their paths, first family %s\n    got %s path "
                       "%u, "
                       "wanted %s path %u\n",
                       masks_[i], shown_.size(), family_name(made_[0].family), text_of(got).c_str(),
                       got.instance, text_of(wanted).c_str(), wanted.instance) +
                   text_of(made_[0].mesh);
        });
    }

    Case& case_;
    std::vector<TestMesh> made_;
    std::vector<typename Kit::AnyMesh> meshes_;
    std::vector<typename Kit::Scene> scenes_;
    std::vector<Shown> shown_;
    std::vector<AnyRay> rays_;
    std::vector<std::uint32_t> masks_;
};

/// Whole-number moves and mirrors by powers of two: a ray goes into the object without rounding, so
/// its hit is the one of brute force there.
void attack_exact_moves(Case& c) {
    const TestMesh made = closed_mesh(c.random, 40, true);
    Transform transform;
    Vec3 scale{}, move{};
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
        at(scale, axis) = std::ldexp(c.random.chance(0.5) ? 1.0f : -1.0f, c.random.whole(-2, 2));
        at(move, axis) = static_cast<float>(c.random.whole(-8, 8));
        transform.m[axis] = {0, 0, 0, at(move, axis)};
        transform.m[axis][axis] = at(scale, axis);
    }
    Scene scene;
    scene.add(Scene(made.mesh, any_scene_options(c.random)), transform);
    scene.commit({.threads = 1});
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
    const std::vector<Hit> hits = trace(scene, rays, {.threads = 1});
    const std::vector<Hit> wanted = trace_brute_force(made.mesh, inside, 1);
    for (std::size_t i = 0; i < rays.size(); ++i)
        c.expect(hits[i].t == wanted[i].t && hits[i].prim == wanted[i].prim &&
                     hits[i].u == wanted[i].u && hits[i].v == wanted[i].v,
                 "instances/exact moves", "hit of an exactly moved instance", [&] {
                     return text_of(rays[i]) + "    got " + text_of(hits[i]) + ", wanted " +
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
                return InstanceDuel<InstancesFloat>(c).run();
            case 2:
            case 3:
                return InstanceDuel<InstancesDouble>(c).run();
            default:
                return attack_exact_moves(c);
        }
    } catch (const InputError&) {
        // Transforms multiply: nearly singular ones and places beyond the range are refused.
        c.compared("instances/refused", 1);
    }
}
static const Kind instances_kind("instances", attack_instances, 1);

}  // namespace raydix::attack
