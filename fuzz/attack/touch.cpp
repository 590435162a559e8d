// What segments and spheres touch: segments against whole-number geometry, spheres against the
// closest points of triangles taken alone.
#include <raydix/overlap.h>

#include "attack/attack.h"
#include "attack/exact.h"
#include "attack/parts.h"
#include "attack/precision.h"

namespace raydix::attack {
namespace {

using Lists = std::vector<std::vector<std::uint32_t>>;

template <class In>
class TouchDuel {
public:
    using Point = typename In::Point;
    using AnySegment = typename In::AnySegment;
    using AnySphere = typename In::AnySphere;

    explicit TouchDuel(Case& c)
        : case_(c), scenery_(c.random, any_mesh(c.random, 16)), group_(text("touch/%s", In::name)) {
        options_.threads = 1;
    }

    void run() {
        std::vector<AnySegment> segments;
        std::vector<AnySphere> spheres;
        for (int i = 0; i < 16; ++i) {
            const Point a = scenery_.place_or_corner(case_.random);
            segments.push_back(
                {a, case_.random.chance(0.1) ? a : scenery_.place_or_corner(case_.random)});
            spheres.push_back({scenery_.place_or_corner(case_.random), any_radius()});
        }
        compare(segments, touched_by(segments), "segment");
        compare(spheres, touched_by(spheres), "sphere");
    }

private:
    typename In::Scalar any_radius() {
        const float size = scenery_.size();
        if (case_.random.chance(0.1)) return 0;
        if (case_.random.chance(0.02)) return -1;
        return static_cast<typename In::Scalar>(size * case_.random.power_of_ten(-4, 0.5));
    }

    Lists touched_by(const std::vector<AnySegment>& segments) const {
        Lists lists(segments.size());
        for (const std::uint32_t t : valid_triangles(scenery_.mesh)) {
            const Corners corners = corners_of(scenery_.mesh, t);
            for (std::size_t q = 0; q < segments.size(); ++q) {
                const Vec3d a = as_double(segments[q].a), b = as_double(segments[q].b);
                if (!is_finite(a) || !is_finite(b) || too_far(a) || too_far(b)) continue;
                if (boxes_meet(corners, a, b) && exact_touch(corners, {a, b, b}))
                    lists[q].push_back(t);
            }
        }
        return lists;
    }
    static bool too_far(Vec3d p) {
        return sizeof(typename In::Scalar) == 8 &&
               (std::fabs(p.x) > 1e12 || std::fabs(p.y) > 1e12 || std::fabs(p.z) > 1e12);
    }
    static bool boxes_meet(const Corners& corners, Vec3d a, Vec3d b) {
        for (std::uint32_t axis = 0; axis < 3; ++axis) {
            double lo = at(corners[0], axis), hi = lo;
            for (const Vec3d& p : corners) {
                lo = std::min(lo, at(p, axis));
                hi = std::max(hi, at(p, axis));
            }
            if (std::max(at(a, axis), at(b, axis)) < lo || std::min(at(a, axis), at(b, axis)) > hi)
                return false;
        }
        return true;
    }

    Lists touched_by(const std::vector<AnySphere>& spheres) const {
        Lists lists(spheres.size());
        std::vector<Point> centers;
        for (const AnySphere& s : spheres) centers.push_back(s.center);
        for_each_alone(scenery_.mesh, [&](const auto& tree, std::uint32_t triangle) {
            const auto alone = closest_points(tree, centers, {.threads = 1});
            for (std::size_t q = 0; q < spheres.size(); ++q) {
                const auto radius = spheres[q].radius;
                if (alone[q].found() && radius >= 0 && std::isfinite(radius) &&
                    distance_squared(centers[q], alone[q].position) <= radius * radius)
                    lists[q].push_back(triangle);
            }
        });
        return lists;
    }

    template <class Query>
    void compare(const std::vector<Query>& queries, const Lists& wanted, const char* what) {
        for (const BuildOptions& build : every_builder(case_.random)) {
            const auto tree = build_bvh(scenery_.mesh, build);
            const OverlapLists lists = touch_all(tree, queries, options_);
            std::vector<std::uint8_t> touched(queries.size());
            touch_any(tree, queries, touched, options_);
            for (std::size_t q = 0; q < queries.size(); ++q) {
                const std::span<const std::uint32_t> row =
                    std::span(lists.prims)
                        .subspan(lists.offsets[q], lists.offsets[q + 1] - lists.offsets[q]);
                expect(same_bytes(row, std::span<const std::uint32_t>(wanted[q])), "touch_all",
                       what, q, queries[q], build);
                expect(touched[q] == !wanted[q].empty(), "touch_any", what, q, queries[q], build);
                if (q % 4 == 0)
                    expect(touches(tree, queries[q]) == !wanted[q].empty(), "touches", what, q,
                           queries[q], build);
            }
        }
    }

    static std::string text_of_query(const AnySegment& s) {
        return "segment " + text_of(s.a) + " " + text_of(s.b);
    }
    static std::string text_of_query(const AnySphere& s) {
        return "sphere " + text_of(s.center) + text(" %a", double(s.radius));
    }
    template <class Query>
    void expect(bool right, const char* call, const char* what, std::size_t q, const Query& query,
                const BuildOptions& build) {
        case_.expect(right, group_, text("%s of %s, %s", call, what, In::name), [&] {
            return text("    query %zu: %s, family %s\n    %s\n", q, text_of_query(query).c_str(),
                        family_name(scenery_.family), text_of(build).c_str()) +
                   text_of(scenery_.mesh);
        });
    }

    Case& case_;
    Scenery<In> scenery_;
    std::string group_;
    OverlapOptions options_;
};

}  // namespace

static void attack_touch(Case& c) {
    if (c.random.chance(0.5))
        TouchDuel<InFloat>(c).run();
    else
        TouchDuel<InDouble>(c).run();
}

static const Kind touch_kind("touch", attack_touch, 1);

}  // namespace raydix::attack
