#include "engine/near_body.h"

#include <algorithm>
#include <exception>
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

/// The place of what is made for a mask; the first one goes where there are too many.
std::shared_ptr<KeptBodies::Body> kept_for(KeptBodies& kept, std::uint32_t mask) {
    const std::lock_guard lock(kept.asked);
    const auto known =
        std::ranges::find_if(kept.known, [&](const auto& k) { return k->mask == mask; });
    if (known != kept.known.end()) return *known;
    if (kept.known.size() == most_bodies) kept.known.erase(kept.known.begin());
    auto made = std::make_shared<KeptBodies::Body>();
    made->mask = mask;
    kept.known.push_back(made);
    return made;
}

void forget(KeptBodies& kept, const std::shared_ptr<KeptBodies::Body>& body) {
    const std::lock_guard lock(kept.asked);
    std::erase(kept.known, body);
}

}  // namespace

std::shared_ptr<const NearBodyD> near_body_of(const SceneD& scene, std::uint32_t mask,
                                              NearCall call, ResultBudget* budget) {
    const SceneTreeD& tree = *SceneInternalsD::tree(scene);
    const std::uint32_t shown = same_for_all(tree, mask);
    while (true) {
        const std::shared_ptr<KeptBodies::Body> found = kept_for(*tree.bodies, shown);
        bool mine = false;
        std::call_once(found->made, [&] {
            mine = true;
            try {
                // A thread that waits for loops in it must not take up another query of the same
                // scene.
                isolated([&] { found->body = make_body(scene, shown, call, budget); });
            } catch (...) {
                found->failed = std::current_exception();
            }
        });
        if (!found->failed) {
            found->body->shapes.require_answers(call);
            return found->body;
        }
        forget(*tree.bodies, found);
        // Whoever waited for another one's body has limits of its own.
        if (mine) std::rethrow_exception(found->failed);
    }
}

}  // namespace raydix
