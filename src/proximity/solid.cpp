// Solids: edges are matched once, then each query is told inside or outside by the rule. In float
// and in double by the same templates.
#include <raydix/double.h>
#include <raydix/error.h>
#include <raydix/solid.h>

#include <limits>
#include <memory>
#include <optional>
#include <type_traits>
#include <utility>

#include "base/float_env.h"
#include "base/options.h"
#include "proximity/crossings.h"
#include "proximity/edge_closure.h"
#include "proximity/query_batch.h"
#include "proximity/unsplit_tree.h"
#include "proximity/winding_tree.h"

namespace raydix {

namespace {

/// What is known of a tree of triangles, each of which is in one leaf.
struct Inside {
    EdgeClosure edges;
    InsideRule rule;
    std::optional<WindingTree> winding;

    template <class Tree>
    Inside(const Tree& tree, std::span<const typename Tree::Corners> triangles,
           std::span<const BvhNode> nodes, InsideRule wanted)
        : edges(match_edges(triangles)) {
        choose(wanted);
        if (rule == InsideRule::winding) winding.emplace(tree, nodes);
    }
    [[nodiscard]] Closure closure() const {
        return edges.odd != 0          ? Closure::open
               : edges.unbalanced != 0 ? Closure::closed
                                       : Closure::oriented;
    }
    void choose(InsideRule wanted) {
        rule = wanted;
        if (rule != InsideRule::automatic) return;
        rule = closure() == Closure::oriented ? InsideRule::crossings
               : closure() == Closure::closed ? InsideRule::parity
                                              : InsideRule::winding;
    }
};

}  // namespace

namespace {

std::span<const BvhNode> nodes_of(const Bvh& bvh) { return bvh.nodes(); }
std::span<const BvhNode> nodes_of(const BvhD& bvh) { return bvh.tree().nodes(); }

template <class AnyTree, class AnyBvh>
struct SolidState {
    using Tree = AnyTree;
    const AnyBvh* bvh;
    std::shared_ptr<const AnyBvh> kept = {};  // the same, if it is the solid's
    std::optional<AnyBvh> whole;  // where the caller's tree has triangles in several leaves
    std::optional<Inside> inside;

    [[nodiscard]] const AnyBvh& single() const { return whole ? *whole : *bvh; }

    void prepare(const AnyBvh& given, InsideRule rule) {
        check_enum("rule", rule, InsideRule::winding);
        bvh = &given;
        if (has_parts(given)) whole = make_unsplit_tree(given);
        inside.emplace(Tree(single()), single().triangles(), nodes_of(single()), rule);
    }
};

}  // namespace

template <class Scalar>
struct BasicSolid<Scalar>::State
    : SolidState<std::conditional_t<std::is_same_v<Scalar, float>, TriangleTree, TriangleTreeD>,
                 Tree> {};

struct SolidInternals {
    template <class AnySolid>
    static const auto& state(const AnySolid& solid) {
        return *solid.state_;
    }
};

namespace {

/// The winding number by the solid's rule, and whether the point is on the surface.
struct Winding {
    double number;
    bool inside;
};

template <class State>
class InsideTest {
    using Tree = typename State::Tree;

public:
    explicit InsideTest(const State& state)
        : inside_(*state.inside), tree_(state.single()), stack_(tree_.max_depth) {}

    /// `query` must be finite.
    Winding operator()(BasicVec3<typename Tree::Scalar> query) {
        if (tree_.empty) return {0.0, false};
        if (inside_.rule == InsideRule::winding) {
            const double number = inside_.winding->at(tree_, query, stack_);
            return {number, std::fabs(number) >= 0.5};
        }
        const Crossings c = count_crossings(tree_, query, stack_);
        if (c.on_surface) return {0.0, true};
        if (inside_.rule == InsideRule::parity) return {double(c.count % 2), c.count % 2 != 0};
        return {double(c.winding), c.winding != 0};
    }

private:
    const Inside& inside_;
    Tree tree_;
    BasicWalkStack<typename Tree::Scalar> stack_;
};

/// A query as the signs of exact_sign_double.h want it.
Vec3 prepared(Vec3 query) { return query; }
Vec3d prepared(Vec3d query) { return without_tiny(query); }

template <class AnySolid, class Vec>
Winding test_one(const AnySolid& solid, Vec query) {
    return InsideTest(SolidInternals::state(solid))(prepared(query));
}

/// Calls one(i, winding) for each query and bad(i) for those that are not finite.
template <class AnySolid, class Vec, class One, class Bad>
QueryCounts for_each_query(const AnySolid& solid, std::span<const Vec> queries, const One& one,
                           const Bad& bad) {
    std::vector<QueryCounts> parts(block_count(queries.size()));
    for_each_query_block(
        solid.bvh(), queries,
        [&](std::size_t block, std::size_t begin, std::size_t end, const auto& at) {
            InsideTest test(SolidInternals::state(solid));
            for (std::size_t k = begin; k < end; ++k) {
                const std::size_t i = at(k);
                if (!is_finite(queries[i])) {
                    ++parts[block].invalid_queries;
                    bad(i);
                    continue;
                }
                const Winding winding = test(prepared(queries[i]));
                parts[block].found += winding.inside;
                one(i, winding);
            }
        });
    return sum_of(parts, queries.size());
}

template <class Scalar>
Scalar with_sign(Scalar distance, bool inside) {
    return inside && distance > 0 ? -distance : distance;
}

template <class AnySolid, class Vec>
QueryCounts contains_batch(const AnySolid& solid, std::span<const Vec> queries,
                           std::span<std::uint8_t> inside, int threads) {
    require_room("contains", queries.size(), inside.size());
    QueryCounts counts;
    with_threads(threads, [&] {
        counts = for_each_query(
            solid, queries, [&](std::size_t i, Winding w) { inside[i] = w.inside; },
            [&](std::size_t i) { inside[i] = 0; });
    });
    return counts;
}

template <class Result, class AnySolid, class Vec, class Scalar, class Options>
QueryCounts signed_batch(const AnySolid& solid, std::span<const Vec> queries,
                         std::span<Scalar> distances, const Options& options) {
    require_room("signed distances", queries.size(), distances.size());
    std::vector<Result> points(queries.size());
    const QueryCounts counts =
        closest_points(solid.bvh(), queries, std::span<Result>(points), options);
    with_threads(options.threads, [&] {
        for_each_query(
            solid, queries,
            [&](std::size_t i, Winding w) {
                distances[i] = with_sign(points[i].distance, w.inside);
            },
            [&](std::size_t i) { distances[i] = infinity; });
    });
    return counts;
}

template <class AnySolid, class Vec>
std::vector<double> winding_batch(const AnySolid& solid, std::span<const Vec> queries,
                                  int threads) {
    std::vector<double> numbers(queries.size());
    with_threads(threads, [&] {
        for_each_query(
            solid, queries, [&](std::size_t i, Winding w) { numbers[i] = w.number; },
            [&](std::size_t i) { numbers[i] = std::numeric_limits<double>::quiet_NaN(); });
    });
    return numbers;
}

}  // namespace

template <class Scalar>
BasicSolid<Scalar>::BasicSolid(const Tree& bvh, const SolidOptions& options)
    : state_(std::make_unique<State>()) {
    require_triangles(bvh, "a solid needs");
    with_threads(options.threads, [&] { state_->prepare(bvh, options.rule); });
}
template <class Scalar>
BasicSolid<Scalar>::BasicSolid(std::shared_ptr<const Tree> bvh, const SolidOptions& options)
    : BasicSolid(*bvh, options) {
    state_->kept = std::move(bvh);
}
template <class Scalar>
BasicSolid<Scalar>::~BasicSolid() = default;
template <class Scalar>
BasicSolid<Scalar>::BasicSolid(BasicSolid&&) noexcept = default;
template <class Scalar>
BasicSolid<Scalar>& BasicSolid<Scalar>::operator=(BasicSolid&&) noexcept = default;

template <class Scalar>
Closure BasicSolid<Scalar>::closure() const {
    return state_->inside->closure();
}
template <class Scalar>
InsideRule BasicSolid<Scalar>::rule() const {
    return state_->inside->rule;
}
template <class Scalar>
std::uint64_t BasicSolid<Scalar>::open_edges() const {
    return state_->inside->edges.odd;
}
template <class Scalar>
const typename BasicSolid<Scalar>::Tree& BasicSolid<Scalar>::bvh() const {
    return *state_->bvh;
}

template class BasicSolid<float>;
template class BasicSolid<double>;

QueryCounts contains(const Solid& solid, std::span<const Vec3> queries,
                     std::span<std::uint8_t> inside, int threads) {
    return contains_batch(solid, queries, inside, threads);
}
QueryCounts contains(const SolidD& solid, std::span<const Vec3d> queries,
                     std::span<std::uint8_t> inside, int threads) {
    return contains_batch(solid, queries, inside, threads);
}

bool contains(const Solid& solid, Vec3 query) {
    const FloatEnvironment plain;
    return is_finite(query) && test_one(solid, query).inside;
}
bool contains(const SolidD& solid, Vec3d query) {
    const FloatEnvironment plain;
    return is_finite(query) && test_one(solid, query).inside;
}

QueryCounts signed_distances(const Solid& solid, std::span<const Vec3> queries,
                             std::span<float> distances, const ClosestOptions& options) {
    return signed_batch<ClosestPoint>(solid, queries, distances, options);
}
QueryCounts signed_distances(const SolidD& solid, std::span<const Vec3d> queries,
                             std::span<double> distances, const ClosestOptionsD& options) {
    return signed_batch<ClosestPointD>(solid, queries, distances, options);
}

std::vector<float> signed_distances(const Solid& solid, std::span<const Vec3> queries,
                                    const ClosestOptions& options) {
    std::vector<float> distances(queries.size());
    signed_distances(solid, queries, distances, options);
    return distances;
}
std::vector<double> signed_distances(const SolidD& solid, std::span<const Vec3d> queries,
                                     const ClosestOptionsD& options) {
    std::vector<double> distances(queries.size());
    signed_distances(solid, queries, distances, options);
    return distances;
}

float signed_distance(const Solid& solid, Vec3 query) {
    return with_sign(closest_point(solid.bvh(), query).distance, contains(solid, query));
}
double signed_distance(const SolidD& solid, Vec3d query) {
    return with_sign(closest_point(solid.bvh(), query).distance, contains(solid, query));
}

std::vector<double> winding_numbers(const Solid& solid, std::span<const Vec3> queries,
                                    int threads) {
    return winding_batch(solid, queries, threads);
}
std::vector<double> winding_numbers(const SolidD& solid, std::span<const Vec3d> queries,
                                    int threads) {
    return winding_batch(solid, queries, threads);
}

}  // namespace raydix
