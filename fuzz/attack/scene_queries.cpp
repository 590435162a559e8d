// Distance, overlap, solids and pairs of whole scenes, nested, mirrored, sheared and masked,
// against the same calls on one tree over all triangles, which are moved to the world by a walk of
// its own. In float and in double.
#include <raydix/overlap.h>
#include <raydix/pairs.h>
#include <raydix/scene.h>
#include <raydix/scene_pairs.h>
#include <raydix/scene_queries.h>
#include <raydix/solid.h>
#include <raydix/transform.h>
#include <raydix/wide.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "attack/any_transform.h"
#include "attack/attack.h"
#include "attack/parts.h"
#include "attack/precision.h"
#include "attack/ray_families.h"
#include "attack/vectors.h"

namespace raydix::attack {
namespace {

/// What a scene holds, by ascending id.
template <class In>
struct Holder {
    using Scalar = typename In::Scalar;

    struct Placed {
        std::size_t holder;
        BasicTransform<Scalar> transform;
        std::uint32_t id, mask;
    };
    struct Held {
        typename In::AnyMesh mesh;
        std::uint32_t id, mask;
    };
    std::vector<Held> meshes;
    std::vector<Placed> placed;
    BasicScene<Scalar> scene;
    std::uint32_t paths = 0;
};

template <class In>
class SceneDuel {
    using Scalar = typename In::Scalar;
    using Point = typename In::Point;
    using Map = BasicTransform<Scalar>;
    using Tree = typename In::Tree;

public:
    explicit SceneDuel(Case& c) : case_(c) {
        mask_ = c.random.chance(0.6) ? 0xFFFFFFFFu : 1 + c.random.below(7);
        const std::uint32_t levels = c.random.below(3);
        for (std::uint32_t level = 0; level <= levels; ++level) make_holder();
        std::vector<Map> way;
        flatten(holders_.back(), 0, way);
        near_ = to_float(flat_);
        bounds_ = finite_bounds(near_);
        const std::vector<std::string> sets = simd_instruction_sets();
        isa_ = sets[c.random.below(sets.size())];
        build_ = any_build_options(c.random);
        build_.threads = 1;
    }

    void run() {
        const Tree tree = build_bvh(flat_, build_);
        closest(tree);
        std::vector<typename In::AnySegment> segments;
        std::vector<typename In::AnySphere> spheres;
        for (int i = 0; i < 12; ++i) {
            const Point a = place();
            segments.push_back({a, random().chance(0.1) ? a : place()});
            spheres.push_back({place(), random().chance(0.1) ? 0 : any_radius()});
        }
        touch(tree, segments, "segment");
        touch(tree, spheres, "sphere");
        sweeps(tree);
        bodies(tree);
        pairs(tree);
    }

private:
    [[nodiscard]] Random& random() { return case_.random; }
    [[nodiscard]] const BasicScene<Scalar>& scene() const { return holders_.back().scene; }
    /// Now and then a corner, bit for bit.
    Point place() {
        if (!flat_.vertices.empty() && random().chance(0.2))
            return flat_.vertices[random().below(flat_.vertices.size())];
        return In::point(random(), make_point(random(), near_, bounds_));
    }
    Scalar any_radius() {
        const Vec3 size = bounds_.hi - bounds_.lo;
        return std::max({size.x, size.y, size.z}) * random().power_of_ten(-4, 0.3f);
    }
    std::uint32_t any_mask() { return random().chance(0.6) ? 0xFFFFFFFFu : random().below(8); }

    void make_holder() {
        const bool first = holders_.empty();
        Holder<In> made;
        const SceneOptions options{.quality = static_cast<Quality>(random().below(3)),
                                   .usage = static_cast<Usage>(random().below(2)),
                                   .compact = random().chance(0.3),
                                   .threads = 1};
        const std::uint32_t meshes = first ? 1 + random().below(3) : random().below(2);
        for (std::uint32_t k = 0; k < meshes; ++k) {
            typename In::AnyMesh mesh = ordinary_mesh();
            const std::uint32_t mask = any_mask();
            const std::uint32_t id = made.scene.add(mesh, {.mask = mask, .id = {}});
            made.meshes.push_back({std::move(mesh), id, mask});
        }
        for (std::uint32_t k = 0; !first && k < 1 + random().below(3); ++k) {
            const std::size_t inner = random().below(holders_.size());
            const auto transform = any_transform<Map>(random());
            const std::uint32_t mask = any_mask();
            const std::uint32_t id =
                made.scene.add(holders_[inner].scene, transform, {.mask = mask, .id = {}});
            made.placed.push_back({inner, transform, id, mask});
            made.paths += 1 + holders_[inner].paths;
        }
        made.scene.commit(options);
        holders_.push_back(std::move(made));
    }
    /// Instances beyond the range of coordinates are refused.
    typename In::AnyMesh ordinary_mesh() {
        for (;;) {
            typename In::AnyMesh made = In::mesh(random(), any_mesh(random(), 14).mesh);
            const Aabb box = float_bounds(to_float(made));
            const Vec3 size = box.hi - box.lo;
            const float most = std::max({std::fabs(box.lo.x), std::fabs(box.lo.y),
                                         std::fabs(box.lo.z), size.x, size.y, size.z});
            if (most < 1e6f && !made.triangles.empty()) return made;
        }
    }

    static bool mirrors(const Map& t) {
        const auto m = [&](std::size_t r, std::size_t k) { return double{t.m[r][k]}; };
        return m(0, 0) * (m(1, 1) * m(2, 2) - m(1, 2) * m(2, 1)) -
                   m(0, 1) * (m(1, 0) * m(2, 2) - m(1, 2) * m(2, 0)) +
                   m(0, 2) * (m(1, 0) * m(2, 1) - m(1, 1) * m(2, 0)) <
               0;
    }
    static Point moved(const std::vector<Map>& way, Point p) {
        Vec3d at = as_double(p);
        for (auto t = way.rbegin(); t != way.rend(); ++t) {
            const auto row = [&](std::size_t r) {
                return ((at.x * t->m[r][0] + at.y * t->m[r][1]) + at.z * t->m[r][2]) + t->m[r][3];
            };
            at = {row(0), row(1), row(2)};
        }
        return {static_cast<Scalar>(at.x), static_cast<Scalar>(at.y), static_cast<Scalar>(at.z)};
    }
    void flatten(const Holder<In>& holder, std::uint32_t number, std::vector<Map>& way) {
        bool turned = false;
        for (const Map& t : way) turned ^= mirrors(t);
        for (const auto& held : holder.meshes) {
            if ((held.mask & mask_) == 0) continue;
            const auto first = static_cast<std::uint32_t>(flat_.vertices.size());
            for (const Point& p : held.mesh.vertices)
                flat_.vertices.push_back(way.empty() ? p : moved(way, p));
            // A triangle that its own mesh leaves out is nowhere.
            const auto nowhere = static_cast<std::uint32_t>(flat_.vertices.size());
            flat_.vertices.push_back({NAN, NAN, NAN});
            std::vector<bool> valid(held.mesh.triangles.size());
            for (const std::uint32_t t : valid_triangles(held.mesh)) valid[t] = true;
            for (std::uint32_t i = 0; i < held.mesh.triangles.size(); ++i) {
                Triangle t = held.mesh.triangles[i];
                if (!valid[i]) t = {nowhere - first, nowhere - first, nowhere - first};
                if (turned) std::swap(t[1], t[2]);
                flat_.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
                names_.push_back({number, held.id, i});
                turned_.push_back(turned);
            }
        }
        std::uint32_t next = number + 1;
        for (const auto& placed : holder.placed) {
            if ((placed.mask & mask_) != 0) {
                way.push_back(placed.transform);
                flatten(holders_[placed.holder], next, way);
                way.pop_back();
            }
            next += 1 + holders_[placed.holder].paths;
        }
    }

    /// Whether an answer of the scene is one of the flat mesh, with the same place on the triangle.
    template <class InScene, class InFlat>
    bool same_place(const InScene& got, const InFlat& wanted) const {
        if (wanted.prim == no_primitive) return got.prim == no_primitive;
        if (got.prim == no_primitive) return false;
        if (ScenePrimitive{got.instance, got.geometry, got.prim} != names_[wanted.prim])
            return false;
        const bool turned = turned_[wanted.prim];
        return got.u == (turned ? wanted.v : wanted.u) && got.v == (turned ? wanted.u : wanted.v) &&
               got.position.x == wanted.position.x && got.position.y == wanted.position.y &&
               got.position.z == wanted.position.z;
    }

    void closest(const Tree& tree) {
        std::vector<Point> queries;
        for (int i = 0; i < 40; ++i) queries.push_back(place());
        Scalar limit = infinity;
        if (random().chance(0.3)) limit = any_radius();
        const auto wanted = closest_points(
            tree, queries, typename In::Options{.max_distance = limit, .threads = 1});
        const auto got =
            closest_points(scene(), queries,
                           BasicSceneClosestOptions<Scalar>{
                               .max_distance = limit, .mask = mask_, .threads = 1, .isa = isa_});
        for (std::size_t q = 0; q < queries.size(); ++q) {
            const auto right = [&](const BasicSceneClosestPoint<Scalar>& point) {
                return same_place(point, wanted[q]) && point.distance == wanted[q].distance;
            };
            const auto text_of_both = [&] {
                return text(
                    "    query %s, limit %a\n    got %a at %s prim %u u %a v %a, wanted %a "
                    "at %s u %a v %a\n",
                    text_of(queries[q]).c_str(), double{limit}, double{got[q].distance},
                    text_of(got[q].position).c_str(), got[q].prim, double{got[q].u},
                    double{got[q].v}, double{wanted[q].distance},
                    text_of(wanted[q].position).c_str(), double{wanted[q].u}, double{wanted[q].v});
            };
            expect(right(got[q]), "closest point", text_of_both);
            if (q % 8 == 0)
                expect(right(closest_point(scene(), queries[q], limit, mask_)),
                       "single closest point", text_of_both);
        }
    }

    template <class Query>
    void touch(const Tree& tree, const std::vector<Query>& queries, const char* what) {
        const OverlapLists wanted = touch_all(tree, queries, OverlapOptions{.threads = 1});
        const SceneOverlapOptions options{.mask = mask_, .threads = 1, .isa = isa_};
        const SceneOverlapLists got = touch_all(scene(), queries, options);
        std::vector<std::uint8_t> touched(queries.size());
        touch_any(scene(), queries, touched, options);
        for (std::size_t q = 0; q < queries.size(); ++q) {
            const auto row =
                std::span(got.prims).subspan(got.offsets[q], got.offsets[q + 1] - got.offsets[q]);
            const auto wanted_row =
                std::span(wanted.prims)
                    .subspan(wanted.offsets[q], wanted.offsets[q + 1] - wanted.offsets[q]);
            expect(std::ranges::equal(row, wanted_row, {}, {},
                                      [&](std::uint32_t prim) { return names_[prim]; }),
                   text("touch_all of %s", what), [&] {
                       std::string out =
                           text("    %zu touched, wanted %zu\n", row.size(), wanted_row.size());
                       for (const std::uint32_t prim : wanted_row) {
                           if (std::ranges::count(row, names_[prim]) != 0) continue;
                           const auto [path, geometry, lost] = names_[prim];
                           out += text("    lost: path %u geometry %u prim %u\n", path, geometry,
                                       lost);
                           for (const std::uint32_t v : flat_.triangles[prim])
                               out += "        " + text_of(flat_.vertices[v]) + "\n";
                       }
                       return out;
                   });
            expect((touched[q] != 0) == !wanted_row.empty(), text("touch_any of %s", what));
            expect(touches(scene(), queries[q], mask_) == !wanted_row.empty(),
                   text("touches of %s", what));
        }
    }

    void sweeps(const Tree& tree) {
        std::vector<typename In::Sweep> all;
        for (const Ray& path : make_rays(random(), near_, 16))
            all.push_back({In::ray(path), random().chance(0.1) ? 0 : any_radius()});
        const auto wanted = sweep_spheres(tree, all, OverlapOptions{.threads = 1});
        const auto got = sweep_spheres(
            scene(), all, SceneOverlapOptions{.mask = mask_, .threads = 1, .isa = isa_});
        for (std::size_t q = 0; q < all.size(); ++q)
            for (const auto& hit : {got[q], sweep_sphere(scene(), all[q], mask_)})
                expect(same_place(hit, wanted[q]) && hit.t == wanted[q].t,
                       all[q].radius == 0 ? "sweep without a radius" : "sweep", [&] {
                           return text_of(all[q].path) +
                                  text("    radius %a, got t %a prim %u, wanted t %a prim %u\n",
                                       double{all[q].radius}, double{hit.t}, hit.prim,
                                       double{wanted[q].t}, wanted[q].prim);
                       });
    }

    void bodies(const Tree& tree) {
        const typename In::Body wanted(tree, {.rule = InsideRule::automatic, .threads = 1});
        const typename In::Body got(scene(),
                                    {.rule = InsideRule::automatic, .mask = mask_, .threads = 1});
        expect(got.closure() == wanted.closure() && got.rule() == wanted.rule() &&
                   got.open_edges() == wanted.open_edges(),
               "closure of a body");
        for (int i = 0; i < 12; ++i) {
            const Point query = place();
            // Far triangles are summed by the tree, which another builder may have made.
            if (wanted.rule() != InsideRule::winding)
                expect(contains(got, query) == contains(wanted, query), "inside of a body");
            expect(
                std::fabs(signed_distance(got, query)) == std::fabs(signed_distance(wanted, query)),
                "distance of a body");
        }
    }

    void pairs(const Tree& tree) {
        const bool narrow = random().chance(0.5);
        const auto wanted = overlapping_pairs(tree, {.narrow = narrow, .threads = 1});
        const ScenePairs got = overlapping_pairs(
            scene(), ScenePairOptions{.narrow = narrow, .mask = mask_, .threads = 1});
        expect(std::ranges::equal(got.pairs, wanted, {}, {},
                                  [&](const PrimitivePair& pair) {
                                      return ScenePair{names_[pair.first], names_[pair.second]};
                                  }),
               narrow ? "pairs of triangles" : "pairs of boxes");
    }

    void expect(bool right, const std::string& what,
                const std::function<std::string()>& reproducer = {}) {
        case_.expect(right, text("scene_queries/%s", In::name), what + ", " + In::name, [&] {
            return (reproducer ? reproducer() : std::string()) +
                   text("    %s, mask %u, %s\n", isa_.c_str(), mask_, text_of(build_).c_str());
        });
    }

    Case& case_;
    std::vector<Holder<In>> holders_;
    std::uint32_t mask_;
    typename In::AnyMesh flat_;
    Mesh near_;                          // the same in float
    std::vector<ScenePrimitive> names_;  // [triangles]
    std::vector<bool> turned_;           // [triangles]: two corners change places
    Aabb bounds_;
    std::string isa_;
    BuildOptions build_;
};

}  // namespace

static void attack_scene_queries(Case& c) {
    if (c.random.chance(0.5))
        SceneDuel<InFloat>(c).run();
    else
        SceneDuel<InDouble>(c).run();
}

static const Kind scene_queries_kind("scene_queries", attack_scene_queries, 1);

}  // namespace raydix::attack
