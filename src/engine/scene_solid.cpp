// A scene's triangles on all paths -> one tree -> a solid.
#include <raydix/double.h>
#include <raydix/solid.h>

#include <algorithm>
#include <memory>
#include <type_traits>

#include "engine/flat_scene.h"
#include "exec/parallel.h"
#include "exec/result_budget.h"

namespace raydix {
namespace {

/// More than a solid holds for each triangle while it is made: its tree, and first three edges with
/// hashes and numbers, sorted from one place to another, then what nodes look like from afar.
template <class Scalar>
std::uint64_t solid_bytes_a_triangle(InsideRule rule) {
    const std::uint64_t tree = std::is_same_v<Scalar, float> ? 120 : 170;
    const std::uint64_t edges = 3 * 2 * (sizeof(std::uint64_t) + sizeof(std::uint32_t));
    const bool may_wind = rule == InsideRule::winding || rule == InsideRule::automatic;
    return tree + (may_wind ? 350 : edges + 16);
}

template <class Scalar>
auto tree_of_body(const BasicScene<Scalar>& scene, const SceneSolidOptions& options) {
    using Tree = typename FlatTree<Scalar>::Tree;
    std::shared_ptr<const Tree> out;
    with_threads(options.threads, [&] {
        const FlatPlan<Scalar> plan(scene, options.mask, "solid");
        const std::uint64_t solid = saturating_product(
            plan.counts().triangles, solid_bytes_a_triangle<Scalar>(options.rule));
        ResultBudget("solid", options.max_result_bytes)
            .take_last(std::max(plan.tree_bytes(), solid));
        out = std::make_shared<const Tree>(plan.tree(options.threads).tree);
    });
    return out;
}

}  // namespace

template <class Scalar>
BasicSolid<Scalar>::BasicSolid(const BasicScene<Scalar>& scene, const SceneSolidOptions& options)
    : BasicSolid(tree_of_body(scene, options), {.rule = options.rule, .threads = options.threads}) {
}

template BasicSolid<float>::BasicSolid(const Scene& scene, const SceneSolidOptions& options);
template BasicSolid<double>::BasicSolid(const SceneD& scene, const SceneSolidOptions& options);

}  // namespace raydix
