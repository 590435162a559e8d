// A scene's triangles on all paths -> one tree -> a solid.
#include <raydix/double.h>
#include <raydix/solid.h>

#include <memory>

#include "engine/flat_scene.h"
#include "exec/parallel.h"
#include "exec/result_budget.h"

namespace raydix {
namespace {

/// More than a solid holds beside its tree while it is made: three edges a triangle with hashes and
/// numbers, sorted from one place to another, and before that or after it, what nodes look like
/// from afar.
constexpr std::uint64_t solid_bytes_a_triangle = 3 * 2 * (sizeof(std::uint64_t) + 4) + 160;

template <class Scalar>
auto tree_of_body(const BasicScene<Scalar>& scene, const SceneSolidOptions& options) {
    using Tree = typename FlatTree<Scalar>::Tree;
    std::shared_ptr<const Tree> out;
    with_threads(options.threads, [&] {
        const FlatPlan<Scalar> plan(scene, options.mask, "solid");
        ResultBudget("solid", options.max_result_bytes)
            .take_last(saturating_sum(
                plan.tree_bytes(),
                saturating_product(plan.counts().triangles, solid_bytes_a_triangle)));
        out = std::make_shared<const Tree>(plan.tree(options.threads).tree);
    });
    return out;
}

}  // namespace

Solid::Solid(const BasicScene<float>& scene, const SceneSolidOptions& options)
    : Solid(tree_of_body(scene, options), {.rule = options.rule, .threads = options.threads}) {}

SolidD::SolidD(const BasicScene<double>& scene, const SceneSolidOptions& options)
    : SolidD(tree_of_body(scene, options), {.rule = options.rule, .threads = options.threads}) {}

}  // namespace raydix
