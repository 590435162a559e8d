// Solids: edges are matched once, then each query is told inside or outside by the rule.
#include <raydix/error.h>
#include <raydix/solid.h>

#include <limits>
#include <optional>

#include "base/float_env.h"
#include "proximity/crossings.h"
#include "proximity/edge_closure.h"
#include "proximity/query_batch.h"
#include "proximity/whole_tree.h"
#include "proximity/winding_tree.h"

namespace raydix {

struct Solid::State {
    const Bvh* bvh;
    std::optional<Bvh> whole;  // where the caller's tree has triangles in several leaves
    EdgeClosure edges;
    InsideRule rule;
    std::optional<WindingTree> winding;

    [[nodiscard]] const Bvh& single() const { return whole ? *whole : *bvh; }
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

struct SolidAccess {
    using State = Solid::State;
    static const State& state(const Solid& solid) { return *solid.state_; }
};

namespace {

/// The winding number by the solid's rule, and whether the point is on the surface.
struct Winding {
    double number;
    bool inside;
};

class InsideTest {
public:
    explicit InsideTest(const Solid& solid)
        : state_(SolidAccess::state(solid)), tree_(state_.single()), stack_(tree_.max_depth) {}

    /// `query` must be finite.
    Winding operator()(Vec3 query) {
        if (tree_.empty) return {0.0, false};
        if (state_.rule == InsideRule::winding) {
            const double number = state_.winding->at(tree_, query, stack_);
            return {number, std::fabs(number) >= 0.5};
        }
        const Crossings c = count_crossings(tree_, query, stack_);
        if (c.on_surface) return {0.0, true};
        if (state_.rule == InsideRule::parity) return {double(c.count % 2), c.count % 2 != 0};
        return {double(c.winding), c.winding != 0};
    }

private:
    const SolidAccess::State& state_;
    TriangleTree tree_;
    WalkStack stack_;
};

/// Calls one(i, winding) for each query and bad(i) for those that are not finite.
template <class One, class Bad>
ClosestCounts for_each_query(const Solid& solid, std::span<const Vec3> queries, const One& one,
                             const Bad& bad) {
    std::vector<ClosestCounts> parts(block_count(queries.size()));
    for_each_query_block(
        solid.bvh(), queries,
        [&](std::size_t block, std::size_t begin, std::size_t end, const auto& at) {
            InsideTest test(solid);
            for (std::size_t k = begin; k < end; ++k) {
                const std::size_t i = at(k);
                if (!is_finite(queries[i])) {
                    ++parts[block].invalid_queries;
                    bad(i);
                    continue;
                }
                const Winding winding = test(queries[i]);
                parts[block].found += winding.inside;
                one(i, winding);
            }
        });
    ClosestCounts sum;
    sum.queries = queries.size();
    for (const ClosestCounts& part : parts) {
        sum.found += part.found;
        sum.invalid_queries += part.invalid_queries;
    }
    return sum;
}

float with_sign(float distance, bool inside) {
    return inside && distance > 0.0f ? -distance : distance;
}

}  // namespace

Solid::Solid(const Bvh& bvh, const SolidOptions& options) : state_(std::make_unique<State>()) {
    require_triangles(bvh, "a solid needs");
    with_threads(options.threads, [&] {
        state_->bvh = &bvh;
        if (bvh.has_split_primitives()) state_->whole = make_whole_tree(bvh);
        state_->edges = match_edges(state_->single().triangles());
        state_->choose(options.rule);
        if (state_->rule == InsideRule::winding) state_->winding.emplace(state_->single());
    });
}
Solid::~Solid() = default;
Solid::Solid(Solid&&) noexcept = default;
Solid& Solid::operator=(Solid&&) noexcept = default;

Closure Solid::closure() const { return state_->closure(); }
InsideRule Solid::rule() const { return state_->rule; }
std::uint64_t Solid::open_edges() const { return state_->edges.odd; }
const Bvh& Solid::bvh() const { return *state_->bvh; }

ClosestCounts contains(const Solid& solid, std::span<const Vec3> queries,
                       std::span<std::uint8_t> inside, int threads) {
    require_room("contains", queries.size(), inside.size());
    ClosestCounts counts;
    with_threads(threads, [&] {
        counts = for_each_query(
            solid, queries, [&](std::size_t i, Winding w) { inside[i] = w.inside; },
            [&](std::size_t i) { inside[i] = 0; });
    });
    return counts;
}

bool contains(const Solid& solid, Vec3 query) {
    const FloatEnvironment plain;
    return is_finite(query) && InsideTest(solid)(query).inside;
}

ClosestCounts signed_distances(const Solid& solid, std::span<const Vec3> queries,
                               std::span<float> distances, const ClosestOptions& options) {
    require_room("signed distances", queries.size(), distances.size());
    std::vector<ClosestPoint> points(queries.size());
    const ClosestCounts counts = closest_points(solid.bvh(), queries, points, options);
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

std::vector<float> signed_distances(const Solid& solid, std::span<const Vec3> queries,
                                    const ClosestOptions& options) {
    std::vector<float> distances(queries.size());
    signed_distances(solid, queries, distances, options);
    return distances;
}

float signed_distance(const Solid& solid, Vec3 query) {
    return with_sign(closest_point(solid.bvh(), query).distance, contains(solid, query));
}

std::vector<double> winding_numbers(const Solid& solid, std::span<const Vec3> queries,
                                    int threads) {
    std::vector<double> numbers(queries.size());
    with_threads(threads, [&] {
        for_each_query(
            solid, queries, [&](std::size_t i, Winding w) { numbers[i] = w.number; },
            [&](std::size_t i) { numbers[i] = std::numeric_limits<double>::quiet_NaN(); });
    });
    return numbers;
}

}  // namespace raydix
