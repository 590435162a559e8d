// Nearest points, points within a radius or a box, and neighbour lists, in all four kinds of index,
// against the formula of the documentation over all points.
#include <raydix/points.h>

#include <algorithm>
#include <limits>

#include "attack/attack.h"
#include "attack/ray_families.h"
#include "attack/vectors.h"

namespace raydix::attack {
namespace {

template <class Point>
constexpr bool is_flat = !Vector<Point>;

template <class Point>
Point point_from(Random& random, Vec3 p) {
    using Scalar = ScalarIn<Point>;
    // Half of the doubles have digits that a float cannot hold.
    const auto digits = [&](float x) {
        const auto d = static_cast<Scalar>(x);
        return sizeof(Scalar) == 8 && random.chance(0.5) ? d + d * Scalar(1e-9 * random.unit()) : d;
    };
    if constexpr (is_flat<Point>)
        return {digits(p.x), digits(p.y)};
    else
        return {digits(p.x), digits(p.y), digits(p.z)};
}

template <class Point>
bool all_axes(const Point& a, const Point& b, bool (*holds)(double, double)) {
    bool all = holds(a.x, b.x) && holds(a.y, b.y);
    if constexpr (!is_flat<Point>) all = all && holds(a.z, b.z);
    return all;
}
template <class Point>
bool finite(const Point& p) {
    return all_axes(p, p, [](double x, double) { return std::isfinite(x); });
}
template <class Point>
bool in_range(const Point& p) {
    return all_axes(p, p, [](double x, double) { return std::fabs(x) <= 1e12; });
}

template <class Scalar>
struct Near {
    Scalar d2;
    std::uint32_t index;
    friend bool operator<(const Near& a, const Near& b) {
        return a.d2 != b.d2 ? a.d2 < b.d2 : a.index < b.index;
    }
};

template <class Index>
class PointsDuel {
public:
    using Point = typename Index::Point;
    using Scalar = typename Index::Scalar;

    PointsDuel(Case& c, const char* group) : case_(c), group_(group) {
        const TestMesh made = any_mesh(c.random, c.random.chance(0.05) ? 1500 : 60);
        family_ = made.family;
        const Aabb bounds = finite_bounds(made.mesh);
        for (const Vec3& p : made.mesh.vertices) points_.push_back(point_from<Point>(c.random, p));
        if (c.random.chance(0.3))
            for (Point& p : points_)
                if (c.random.chance(0.3)) p = points_[c.random.below(points_.size())];
        for (int i = 0; i < 40; ++i)
            queries_.push_back(
                c.random.chance(0.3)
                    ? points_[c.random.below(points_.size())]
                    : point_from<Point>(c.random, make_point(c.random, made.mesh, bounds)));
        PointsOptions options;
        options.tree = static_cast<PointsTree>(c.random.below(3));
        options.threads = c.random.chance(0.9) ? 1 : 2;
        index_ = build_points(std::span<const Point>(points_), options);
        if (c.random.chance(0.3)) index_.rebuild(points_);
        static const std::vector<std::string> sets = point_instruction_sets();
        query_.isa = c.random.chance(0.5) ? sets[c.random.below(sets.size())] : "";
        query_.order = static_cast<QueryOrder>(c.random.below(3));
        query_.threads = 1;
    }

    void run() {
        std::size_t valid = 0;
        for (const Point& p : points_) valid += in_range(p);
        expect(index_.size() == valid && index_.left_out() == points_.size() - valid, "left_out",
               valid);
        nearest();
        within();
        boxes();
        neighbours();
    }

private:
    /// All valid points, nearest first.
    std::vector<Near<Scalar>> ranked(const Point& query) const {
        std::vector<Near<Scalar>> all;
        if (!finite(query)) return all;
        for (std::uint32_t i = 0; i < points_.size(); ++i)
            if (in_range(points_[i])) all.push_back({distance_squared(query, points_[i]), i});
        std::sort(all.begin(), all.end());
        return all;
    }
    void expect(bool right, const char* what, std::size_t query) {
        case_.expect(right, group_, std::string(what) + " of " + group_, [&] {
            std::string made = text("    query %zu of %zu points, family %s, isa %s, tree %u\n",
                                    query, points_.size(), family_name(family_), query_.isa.c_str(),
                                    static_cast<unsigned>(index_.tree()));
            for (std::size_t i = 0; i < std::min<std::size_t>(8, points_.size()); ++i)
                made +=
                    text("    point %zu: %a %a\n", i, double(points_[i].x), double(points_[i].y));
            return made;
        });
    }

    void nearest() {
        const std::uint32_t k = 1 + case_.random.below(case_.random.chance(0.1) ? 100 : 12);
        const NearestPoints<Scalar> rows = knn(index_, queries_, k, query_);
        std::vector<std::uint32_t> ids(k);
        std::vector<Scalar> distances(k);
        for (std::size_t q = 0; q < queries_.size(); ++q) {
            const std::vector<Near<Scalar>> all = ranked(queries_[q]);
            bool right = true;
            for (std::size_t j = 0; j < k; ++j) {
                const bool there = j < all.size();
                const std::uint32_t id = there ? all[j].index : no_primitive;
                const Scalar distance =
                    there ? std::sqrt(all[j].d2) : std::numeric_limits<Scalar>::infinity();
                right =
                    right && rows.indices[q * k + j] == id && rows.distances[q * k + j] == distance;
            }
            expect(right, "knn", q);
            if (q % 4 != 0) continue;
            const std::uint32_t found = knn(index_, queries_[q], ids, distances);
            expect(found == std::min<std::size_t>(k, all.size()) &&
                       std::equal(ids.begin(), ids.begin() + found, &rows.indices[q * k]) &&
                       std::equal(distances.begin(), distances.begin() + found,
                                  &rows.distances[q * k]),
                   "single knn", q);
        }
    }

    Scalar any_radius() {
        Random& random = case_.random;
        switch (random.below(5)) {
            case 0:
                return 0;
            case 1: {  // the very distance of two points: the boundary
                const Point &a = points_[random.below(points_.size())],
                            &b = queries_[random.below(queries_.size())];
                const Scalar d = std::sqrt(distance_squared(a, b));
                return std::isfinite(d) ? d : 1;
            }
            case 2:
                return std::numeric_limits<Scalar>::infinity();
            default:
                return static_cast<Scalar>(random.power_of_ten(-6, 6));
        }
    }

    void within() {
        std::vector<Scalar> radii;
        for (std::size_t q = 0; q < queries_.size(); ++q) radii.push_back(any_radius());
        query_.sort = case_.random.chance(0.5);
        const PointLists<Scalar> lists =
            radius_search(index_, queries_, std::span<const Scalar>(radii), query_);
        const Scalar common = any_radius();
        std::vector<std::uint32_t> counts(queries_.size());
        radius_count(index_, queries_, common, counts, query_);
        for (std::size_t q = 0; q < queries_.size(); ++q) {
            std::vector<Near<Scalar>> wanted;
            std::uint32_t in_common = 0;
            for (const Near<Scalar>& near : ranked(queries_[q])) {
                if (near.d2 <= radii[q] * radii[q]) wanted.push_back(near);
                in_common += near.d2 <= common * common;
            }
            if (!query_.sort)
                std::sort(wanted.begin(), wanted.end(),
                          [](const auto& a, const auto& b) { return a.index < b.index; });
            expect(matches(lists, q, wanted), "radius", q);
            expect(counts[q] == in_common, "radius_count", q);
            if (q % 4 != 0) continue;
            expect(radius_count(index_, queries_[q], common) == in_common, "single radius_count",
                   q);
            std::uint32_t visited = 0;
            for_each_in_radius(index_, queries_[q], common, [&](std::uint32_t, Scalar) {
                ++visited;
                return true;
            });
            expect(visited == in_common, "for_each_in_radius", q);
        }
    }

    static bool matches(const PointLists<Scalar>& lists, std::size_t row,
                        const std::vector<Near<Scalar>>& wanted) {
        const std::uint64_t from = lists.offsets[row];
        bool right = lists.offsets[row + 1] - from == wanted.size();
        for (std::size_t j = 0; right && j < wanted.size(); ++j)
            right = lists.indices[from + j] == wanted[j].index &&
                    lists.distances[from + j] == std::sqrt(wanted[j].d2);
        return right;
    }

    void boxes() {
        std::vector<typename Index::Box> boxes;
        for (std::size_t q = 0; q + 1 < queries_.size(); q += 2) {
            typename Index::Box box{queries_[q], queries_[q + 1]};
            if (case_.random.chance(0.8)) put_in_order(box);
            boxes.push_back(box);
        }
        query_.sort = false;
        const PointLists<Scalar> lists = box_search(index_, boxes, query_);
        for (std::size_t q = 0; q < boxes.size(); ++q) {
            std::vector<Near<Scalar>> wanted;
            const auto not_above = [](double x, double y) { return x <= y; };
            for (std::uint32_t i = 0; i < points_.size(); ++i)
                if (finite(boxes[q].lo) && finite(boxes[q].hi) && in_range(points_[i]) &&
                    all_axes(boxes[q].lo, points_[i], not_above) &&
                    all_axes(points_[i], boxes[q].hi, not_above))
                    wanted.push_back({0, i});
            expect(matches(lists, q, wanted), "box", q);
        }
    }
    static void put_in_order(typename Index::Box& box) {
        if (box.hi.x < box.lo.x) std::swap(box.lo.x, box.hi.x);
        if (box.hi.y < box.lo.y) std::swap(box.lo.y, box.hi.y);
        if constexpr (!is_flat<Point>)
            if (box.hi.z < box.lo.z) std::swap(box.lo.z, box.hi.z);
    }

    void neighbours() {
        if (points_.size() > 400) return;
        const Scalar radius = any_radius();
        const PairRows rows = case_.random.chance(0.5) ? PairRows::half : PairRows::full;
        const PointLists<Scalar> lists = neighbour_lists(index_, radius, rows, query_);
        for (std::uint32_t i = 0; i < points_.size(); ++i) {
            std::vector<Near<Scalar>> wanted;
            for (std::uint32_t j = rows == PairRows::half ? i + 1 : 0; j < points_.size(); ++j) {
                if (j == i || !in_range(points_[i]) || !in_range(points_[j])) continue;
                const Scalar d2 = distance_squared(points_[i], points_[j]);
                if (d2 <= radius * radius) wanted.push_back({d2, j});
            }
            expect(matches(lists, i, wanted), "neighbour_lists", i);
        }
    }

    Case& case_;
    const char* group_;
    Family family_ = Family::soup;
    std::vector<Point> points_, queries_;
    Index index_;
    PointQueryOptions query_;
};

}  // namespace

static void attack_points(Case& c) {
    switch (c.random.below(4)) {
        case 0:
            return PointsDuel<Points>(c, "points/float 3").run();
        case 1:
            return PointsDuel<Points2>(c, "points/float 2").run();
        case 2:
            return PointsDuel<PointsD>(c, "points/double 3").run();
        default:
            return PointsDuel<Points2D>(c, "points/double 2").run();
    }
}

static const Kind points_kind("points", attack_points, 1);

}  // namespace raydix::attack
