// Moving spheres: every builder against the first contact of all triangles taken alone, and those
// against extended precision.
#include <raydix/overlap.h>

#include <limits>

#include "attack/attack.h"
#include "attack/parts.h"
#include "attack/precision.h"

namespace raydix::attack {
namespace {

template <class In>
class SweepDuel {
public:
    explicit SweepDuel(Case& c)
        : case_(c),
          scenery_(c.random, any_mesh(c.random, 20)),
          group_(text("sweeps/%s", In::name)) {
        for (const typename In::AnyRay& path : scenery_.rays(c.random, 40)) {
            typename In::Scalar radius = scenery_.size() * c.random.power_of_ten(-4, 0);
            if (c.random.chance(0.1)) radius = 0;
            sweeps_.push_back({path, radius});
        }
        find_alone();
    }

    void run() {
        for (const BuildOptions& build : every_builder(case_.random)) {
            const auto tree = build_bvh(scenery_.mesh, build);
            const auto answers = sweep_spheres(tree, sweeps_, {.threads = 1});
            for (std::size_t q = 0; q < sweeps_.size(); ++q) {
                expect(same(answers[q], expected_[q]), "differs from brute force", q, build,
                       answers[q]);
                if (q % 8 == 0)
                    expect(same(sweep_sphere(tree, sweeps_[q]), expected_[q]),
                           "single call differs from brute force", q, build, answers[q]);
            }
        }
        for (std::size_t q = 0; q < sweeps_.size(); ++q) judge(q);
    }

private:
    /// Without a radius a sweep is its ray, whose triangle the kinds `rays` and `doubles` judge.
    /// Its t cannot be compared here: long directions are scaled, and what differs there may be
    /// equal, and 0, in the caller's units.
    void find_alone() {
        expected_.resize(sweeps_.size());
        const auto whole = build_bvh(scenery_.mesh, {.threads = 1});
        std::vector<std::uint32_t> of_ray;
        for (const auto& sweep : sweeps_) of_ray.push_back(closest_hit(whole, sweep.path).prim);
        for_each_alone(scenery_.mesh, [&](const auto& tree, std::uint32_t triangle) {
            const auto alone = sweep_spheres(tree, sweeps_, {.threads = 1});
            for (std::size_t q = 0; q < sweeps_.size(); ++q) {
                const auto& best = expected_[q];
                const bool first = sweeps_[q].radius == 0 ? triangle == of_ray[q]
                                                          : !best.hit() || alone[q].t < best.t;
                if (!alone[q].hit() || !first) continue;
                expected_[q] = alone[q];
                expected_[q].prim = triangle;
            }
        });
    }

    /// At t the ball is as far from its triangle as its radius, and not well within another before.
    void judge(std::size_t q) {
        const auto& contact = expected_[q];
        const auto& path = sweeps_[q].path;
        if (!contact.hit() || !(contact.t < 1e30) || scenery_.family == Family::subnormal) return;
        const Vec3d from = as_double(path.origin), along = as_double(path.direction);
        const double speed = std::sqrt(dot(along, along));
        // Where the path itself is lost in rounding there is nothing to say.
        if (!(speed > 1e-15 && speed < 1e15)) return;
        const Vec3d center = from + along * double(contact.t);
        const double reach =
            std::sqrt(dot(from, from)) + speed * double(contact.t) + double(sweeps_[q].radius);
        const double slack =
            (sizeof(typename In::Scalar) == 4 ? 0x1p-20 : 0x1p-44) * (reach + scenery_.size());
        const long double there = distance_to(corners_of(scenery_.mesh, contact.prim), center);
        const bool at_start = double(contact.t) <= std::max(0.0, double(path.tmin));
        expect(
            there <= sweeps_[q].radius + slack && (at_start || there + slack >= sweeps_[q].radius),
            "contact is not at the radius", q, {}, contact, there);
        const Vec3d earlier = from + along * (0.5 * double(contact.t));
        if (at_start || 0.5 * double(contact.t) < double(path.tmin)) return;
        for (const std::uint32_t t : valid_triangles(scenery_.mesh))
            expect(distance_to(corners_of(scenery_.mesh, t), earlier) + slack >= sweeps_[q].radius,
                   "earlier contact lost", q, {}, contact);
    }

    void expect(bool right, const char* what, std::size_t q, const BuildOptions& build,
                const typename In::Contact& got, long double distance = -1) {
        case_.expect(right, group_, std::string(what) + ", " + In::name, [&] {
            return text_of(sweeps_[q].path) +
                   text(
                       "    radius %a, family %s, distance %.17Lg\n    %s\n    got t %a prim %u, "
                       "expected t %a prim "
                       "%u\n",
                       double(sweeps_[q].radius), family_name(scenery_.family), distance,
                       text_of(build).c_str(), double(got.t), got.prim, double(expected_[q].t),
                       expected_[q].prim) +
                   text_of(scenery_.mesh);
        });
    }

    Case& case_;
    Scenery<In> scenery_;
    std::string group_;
    std::vector<typename In::Sweep> sweeps_;
    std::vector<typename In::Contact> expected_;
};

}  // namespace

static void attack_sweeps(Case& c) {
    if (c.random.chance(0.5))
        SweepDuel<InFloat>(c).run();
    else
        SweepDuel<InDouble>(c).run();
}

static const Kind sweeps_kind("sweeps", attack_sweeps, 1);

}  // namespace raydix::attack
