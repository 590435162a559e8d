// Closest points: every builder against the least of all triangles taken alone, and those against
// extended precision.
#include <limits>

#include "attack/attack.h"
#include "attack/parts.h"
#include "attack/precision.h"

namespace raydix::attack {
namespace {

template <class In>
class ClosestDuel {
public:
    explicit ClosestDuel(Case& c)
        : case_(c),
          scenery_(c.random, any_mesh(c.random, 30)),
          group_(text("closest/%s", In::name)) {
        for (int i = 0; i < 50; ++i) queries_.push_back(scenery_.place_or_corner(c.random));
        options_.threads = 1;
        if (c.random.chance(0.3))
            options_.max_distance = scenery_.size() * c.random.power_of_ten(-3, 1);
        find_alone();
    }

    void run() {
        for (const BuildOptions& build : every_builder(case_.random)) {
            const auto tree = build_bvh(scenery_.mesh, build);
            const auto answers = closest_points(tree, queries_, options_);
            for (std::size_t q = 0; q < queries_.size(); ++q) {
                expect(same(answers[q], expected_[q]), "differs from brute force", q, build,
                       answers[q]);
                if (q % 8 == 0)
                    expect(
                        same(closest_point(tree, queries_[q], options_.max_distance), expected_[q]),
                        "single call differs from brute force", q, build, answers[q]);
            }
        }
        for (std::size_t q = 0; q < queries_.size(); ++q) judge(q);
    }

private:
    void find_alone() {
        expected_.resize(queries_.size());
        std::vector<typename In::Scalar> least(
            queries_.size(), std::numeric_limits<typename In::Scalar>::infinity());
        for_each_alone(scenery_.mesh, [&](const auto& tree, std::uint32_t triangle) {
            const auto alone = closest_points(tree, queries_, options_);
            for (std::size_t q = 0; q < queries_.size(); ++q) {
                if (!alone[q].found()) continue;
                const auto d2 = distance_squared(queries_[q], alone[q].position);
                if (expected_[q].found() && !(d2 < least[q])) continue;
                least[q] = d2;
                expected_[q] = alone[q];
                expected_[q].prim = triangle;
            }
        });
    }

    /// The brute force itself: as near as any triangle, up to rounding.
    void judge(std::size_t q) {
        const typename In::Point query = queries_[q];
        if (!is_finite(query)) return;
        const Vec3d at = as_double(query);
        long double nearest = std::numeric_limits<long double>::infinity(), reach = 0, stretch = 1;
        for (const std::uint32_t t : valid_triangles(scenery_.mesh)) {
            const Corners corners = corners_of(scenery_.mesh, t);
            nearest = std::min(nearest, distance_to(corners, at));
            stretch = std::max(stretch, stretch_of(corners));
            for (const Vec3d& p : corners)
                reach = std::max({reach, std::fabs(static_cast<long double>(p.x)),
                                  std::fabs(static_cast<long double>(p.y)),
                                  std::fabs(static_cast<long double>(p.z))});
        }
        const long double rounding = sizeof(typename In::Scalar) == 4 ? 0x1p-23L : 0x1p-50L;
        // Squares below the least number of the scalar vanish.
        const long double vanishing = sizeof(typename In::Scalar) == 4 ? 1e-21L : 1e-140L;
        // A needle loses as many digits of its weights as it is stretched.
        const long double slack = 8 * rounding * (reach + nearest) * stretch + vanishing;
        if (nearest > 1.8e19L && sizeof(typename In::Scalar) == 4) return;  // its square overflows
        if (!expected_[q].found()) {
            expect(!(nearest + slack < options_.max_distance), "near point lost", q, {}, {});
            return;
        }
        const long double distance = expected_[q].distance;
        expect(std::fabs(distance - nearest) <= slack, "not the nearest", q, {}, expected_[q],
               nearest);
    }

    void expect(bool right, const char* what, std::size_t q, const BuildOptions& build,
                const typename In::Closest& got, long double nearest = -1) {
        case_.expect(right, group_, std::string(what) + ", " + In::name, [&] {
            return text(
                       "    query %s, max_distance %a, family %s, nearest %.17Lg\n    %s\n    got "
                       "%s %a prim %u, "
                       "expected %s %a prim %u\n",
                       text_of(queries_[q]).c_str(), double(options_.max_distance),
                       family_name(scenery_.family), nearest, text_of(build).c_str(),
                       text_of(got.position).c_str(), double(got.distance), got.prim,
                       text_of(expected_[q].position).c_str(), double(expected_[q].distance),
                       expected_[q].prim) +
                   text_of(scenery_.mesh);
        });
    }

    Case& case_;
    Scenery<In> scenery_;
    std::string group_;
    std::vector<typename In::Point> queries_;
    typename In::Options options_;
    std::vector<typename In::Closest> expected_;
};

}  // namespace

static void attack_closest(Case& c) {
    if (c.random.chance(0.5))
        ClosestDuel<InFloat>(c).run();
    else
        ClosestDuel<InDouble>(c).run();
}

static const Kind closest_kind("closest", attack_closest, 1);

}  // namespace raydix::attack
