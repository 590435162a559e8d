// Inside or outside of closed meshes against whole-number crossings, signed distances, winding
// numbers of open meshes against sums of solid angles, and crossings of rays.
#include <raydix/solid.h>
#include <raydix/trace.h>

#include <map>
#include <numbers>
#include <tuple>

#include "attack/attack.h"
#include "attack/exact.h"
#include "attack/parts.h"
#include "attack/precision.h"

namespace raydix::attack {
namespace {

/// How often each edge, named by its places, is run through one way less the other, and in all.
struct EdgeCounts {
    std::uint64_t odd = 0;
    bool oriented = true;
};
template <class AnyMesh>
EdgeCounts count_edges(const AnyMesh& mesh) {
    using Place = std::tuple<double, double, double>;
    std::map<std::pair<Place, Place>, std::pair<int, int>> edges;
    for (const std::uint32_t t : valid_triangles(mesh)) {
        const Corners corners = corners_of(mesh, t);
        for (std::size_t k = 0; k < 3; ++k) {
            // Adding 0 turns -0 into 0.
            const auto place = [](Vec3d p) { return Place{p.x + 0, p.y + 0, p.z + 0}; };
            const Place a = place(corners[k]), b = place(corners[(k + 1) % 3]);
            if (a == b) continue;
            auto& [turn, total] = edges[std::minmax(a, b)];
            turn += a < b ? 1 : -1;
            ++total;
        }
    }
    EdgeCounts counts;
    for (const auto& [edge, count] : edges) {
        counts.odd += count.second % 2 != 0;
        counts.oriented = counts.oriented && count.first == 0;
    }
    return counts;
}

/// The generalized winding number: solid angles (Van Oosterom and Strackee 1983) over 4 pi.
template <class AnyMesh>
double winding_of(const AnyMesh& mesh, Vec3d p) {
    long double sum = 0;
    for (const std::uint32_t t : valid_triangles(mesh)) {
        const Corners corners = corners_of(mesh, t);
        const Vec3d a = corners[0] - p, b = corners[1] - p, c = corners[2] - p;
        const double x = std::sqrt(dot(a, a)), y = std::sqrt(dot(b, b)), z = std::sqrt(dot(c, c));
        sum += 2 * std::atan2(dot(a, cross(b, c)),
                              x * y * z + dot(a, b) * z + dot(b, c) * x + dot(c, a) * y);
    }
    return static_cast<double>(sum / (4 * std::numbers::pi_v<long double>));
}

template <class In>
class SolidDuel {
public:
    explicit SolidDuel(Case& c)
        : case_(c),
          closed_(c.random.chance(0.8)),
          scenery_(c.random, closed_ ? closed_mesh(c.random, 40, c.random.chance(0.5))
                                     : any_mesh(c.random, 40)),
          group_(text("solids/%s", In::name)) {
        for (int i = 0; i < 24; ++i) queries_.push_back(scenery_.place_or_corner(c.random));
    }

    void run() {
        const BuildOptions build = any_build_options(case_.random);
        const auto tree = build_bvh(scenery_.mesh, build);
        const EdgeCounts edges = count_edges(scenery_.mesh);
        SolidOptions options{.threads = 1};
        // Signed crossings say something of oriented meshes only, and their number of closed ones.
        if (edges.odd == 0 && case_.random.chance(0.5)) options.rule = InsideRule::parity;
        if (edges.odd == 0 && edges.oriented && case_.random.chance(0.5))
            options.rule = InsideRule::crossings;
        const typename In::Body solid(tree, options);
        expect(solid.open_edges() == edges.odd, "open_edges", 0, build);
        expect(solid.closure() == (edges.odd != 0   ? Closure::open
                                   : edges.oriented ? Closure::oriented
                                                    : Closure::closed),
               "closure", 0, build);
        compare(solid, tree, build);
    }

private:
    void compare(const typename In::Body& solid, const typename In::Tree& tree,
                 const BuildOptions& build) {
        std::vector<std::uint8_t> inside(queries_.size());
        contains(solid, queries_, inside, 1);
        const auto winding = winding_numbers(solid, queries_, 1);
        const auto distances = signed_distances(solid, queries_, {.threads = 1});
        const auto nearest = closest_points(tree, queries_, {.threads = 1});
        for (std::size_t q = 0; q < queries_.size(); ++q) {
            expect(contains(solid, queries_[q]) == (inside[q] != 0), "single contains", q, build);
            if (!is_finite(queries_[q])) {
                expect(inside[q] == 0, "contains what is not finite", q, build);
                continue;
            }
            const auto distance = nearest[q].distance;
            expect(distances[q] == (inside[q] ? -distance : distance), "signed_distances", q,
                   build);
            if (solid.rule() == InsideRule::winding)
                judge_winding(q, inside[q] != 0, winding[q], build);
            else
                judge_exactly(solid.rule(), q, inside[q] != 0, winding[q], build);
        }
    }

    void judge_exactly(InsideRule rule, std::size_t q, bool inside, double winding,
                       const BuildOptions& build) {
        // Only what builders keep bounds the body.
        const ExactPlace place = exact_place(kept(), as_double(queries_[q]));
        const bool parity = rule == InsideRule::parity;
        const bool wanted =
            place.on_surface || (parity ? place.crossings % 2 != 0 : place.winding != 0);
        expect(inside == wanted, parity ? "contains by parity" : "contains by crossings", q, build);
        if (place.on_surface) return;
        expect(winding == (parity ? double(place.crossings % 2) : double(place.winding)),
               parity ? "winding_numbers by parity" : "winding_numbers by crossings", q, build);
    }
    const MeshD& kept() {
        if (kept_.triangles.empty())
            for (const std::uint32_t t : valid_triangles(scenery_.mesh)) {
                const auto first = static_cast<std::uint32_t>(kept_.vertices.size());
                for (const Vec3d& p : corners_of(scenery_.mesh, t)) kept_.vertices.push_back(p);
                kept_.triangles.push_back({first, first + 1, first + 2});
            }
        return kept_;
    }

    void judge_winding(std::size_t q, bool inside, double winding, const BuildOptions& build) {
        const double exact = winding_of(scenery_.mesh, as_double(queries_[q]));
        // Near surfaces, and where squares overflow or vanish, angles mean little.
        if (!std::isfinite(exact) || scenery_.family == Family::subnormal ||
            scenery_.size() > 1e9f || scenery_.size() < 1e-9f)
            return;
        long double nearest = infinity;
        for (const std::uint32_t t : valid_triangles(scenery_.mesh))
            nearest = std::min(nearest,
                               distance_to(corners_of(scenery_.mesh, t), as_double(queries_[q])));
        if (nearest < 1e-3L * scenery_.size()) return;
        expect(std::fabs(winding - exact) < 0.1, "generalized winding number", q, build);
        if (std::fabs(std::fabs(exact) - 0.5) > 0.1)
            expect(inside == (std::fabs(exact) > 0.5), "contains by winding", q, build);
    }

    void expect(bool right, const char* what, std::size_t q, const BuildOptions& build) {
        case_.expect(right, group_, text("%s, %s", what, In::name), [&] {
            return text("    query %s, family %s\n    %s\n", text_of(queries_[q]).c_str(),
                        family_name(scenery_.family), text_of(build).c_str()) +
                   text_of(scenery_.mesh);
        });
    }

    Case& case_;
    bool closed_;
    Scenery<In> scenery_;
    std::string group_;
    std::vector<typename In::Point> queries_;
    MeshD kept_;
};

/// Small whole numbers and directions that shear them without rounding: the library's floats are
/// exact, so even rays through edges and corners must cross as often as the exact ones.
void attack_crossings(Case& c) {
    const TestMesh made = closed_mesh(c.random, 30, true);
    const MeshD exact = [&] {
        MeshD wider;
        wider.triangles = made.mesh.triangles;
        for (const Vec3& p : made.mesh.vertices) wider.vertices.push_back(wide(p));
        return wider;
    }();
    constexpr float steps[] = {-1, -0.5f, 0, 0, 0.5f, 1};
    std::vector<Ray> rays;
    std::vector<unsigned> wanted;
    while (rays.size() < 40) {
        Vec3 d{c.random.one_of(steps), c.random.one_of(steps), c.random.one_of(steps)};
        at(d, c.random.below(3)) = c.random.chance(0.5) ? 1.0f : -1.0f;
        const Vec3 from = c.random.whole_point(6) +
                          (c.random.chance(0.5) ? Vec3{0.5f, 0.25f, 0.5f} : Vec3{0, 0, 0});
        const ExactPlace place = exact_place(exact, wide(from));
        if (place.on_surface) continue;
        rays.push_back({from, 0, d, infinity});
        wanted.push_back(place.crossings % 2);
    }
    for (const BuildOptions& build : every_builder(c.random)) {
        const AllHits all = trace_all(build_bvh(made.mesh, build), rays, {.threads = 1});
        for (std::size_t i = 0; i < rays.size(); ++i)
            c.expect((all.offsets[i + 1] - all.offsets[i]) % 2 == wanted[i],
                     "solids/crossings of rays",
                     "parity of trace_all differs from exact arithmetic", [&] {
                         return "    " + text_of(build) +
                                text(", family %s\n", family_name(made.family)) + text_of(rays[i]) +
                                text_of(made.mesh);
                     });
    }
}

}  // namespace

static void attack_solids(Case& c) {
    switch (c.random.below(3)) {
        case 0:
            return SolidDuel<InFloat>(c).run();
        case 1:
            return SolidDuel<InDouble>(c).run();
        default:
            return attack_crossings(c);
    }
}

static const Kind solids_kind("solids", attack_solids, 1);

}  // namespace raydix::attack
