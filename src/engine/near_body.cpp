#include "engine/near_body.h"

#include <algorithm>
#include <utility>

#include "engine/scene_state.h"
#include "exec/parallel.h"
#include "exec/result_memory.h"

namespace raydix {
namespace {

/// For so many masks that show different things.
constexpr std::size_t most_bodies = 4;

/// The largest mask that shows what `mask` shows: without the bits of all that it does not.
std::uint32_t same_for_all(const SceneTreeD& tree, std::uint32_t mask) {
    std::uint32_t hidden = 0;
    for (const std::uint32_t m : tree.masks)
        if ((m & mask) == 0) hidden |= m;
    return ~hidden;
}

std::shared_ptr<const NearBodyD> make_body(const SceneD& scene, std::uint32_t mask, NearCall call,
                                           ResultBudget* budget) {
    const FlatPlan<double> plan(scene, mask, name_of(call), FlatShapes::left_out);
    const NearShapesPlan shapes(*SceneInternalsD::tree(scene), mask, call);
    const std::uint64_t peak = saturating_sum(plan.tree_bytes(), shapes.bytes());
    ResultBudget own(name_of(call), 0);
    ResultBudget& charged = budget == nullptr ? own : *budget;
    charged.take(peak);
    auto body = std::make_shared<const NearBodyD>(plan.tree(0), shapes.make());
    const std::uint64_t kept = body->triangles.tree.bytes() +
                               body->triangles.names.runs.size() * sizeof(FlatNames::Run) +
                               shapes.bytes();
    charged.give_back(peak - std::min(peak, kept));
    return body;
}

}  // namespace

std::shared_ptr<const NearBodyD> near_body_of(const SceneD& scene, std::uint32_t mask,
                                              NearCall call, ResultBudget* budget) {
    const SceneTreeD& tree = *SceneInternalsD::tree(scene);
    KeptBodies& kept = *tree.bodies;
    const std::uint32_t shown = same_for_all(tree, mask);
    const std::lock_guard lock(kept.asked);
    const auto known = std::ranges::find(kept.known, shown, &KeptBodies::Body::mask);
    if (known != kept.known.end()) {
        known->body->shapes.require_answers(call);
        return known->body;
    }
    std::shared_ptr<const NearBodyD> body;
    // A thread that waits for loops in it must not take up another query of the same scene.
    isolated([&] { body = make_body(scene, shown, call, budget); });
    if (kept.known.size() == most_bodies) kept.known.erase(kept.known.begin());
    kept.known.push_back({shown, body});
    return body;
}

}  // namespace raydix
