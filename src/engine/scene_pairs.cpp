// Pairs of triangles of scenes: trees over the triangles on all paths, and names for their numbers,
// which ascend by (instance, geometry, prim).
#include <raydix/double.h>
#include <raydix/error.h>
#include <raydix/result_limit.h>
#include <raydix/scene_pairs.h>

#include <optional>

#include "engine/flat_scene.h"
#include "exec/parallel.h"
#include "exec/result_budget.h"

namespace raydix {
namespace {

constexpr const char* call_of_pairs = "overlapping_pairs";

/// Trees over one scene or two, and what they leave of the call's memory.
template <class Scalar>
class FlatSides {
public:
    using Scene = BasicScene<Scalar>;

    /// `b` null: within `a`.
    FlatSides(const Scene& a, const Scene* b, bool keeps_pairs, const ScenePairOptions& options)
        : options_(options) {
        const FlatPlan<Scalar> plan_a(a, options.mask, call_of_pairs);
        std::optional<FlatPlan<Scalar>> plan_b;
        std::uint64_t bytes = plan_a.tree_bytes();
        if (b != nullptr) {
            plan_b.emplace(*b, options.mask, call_of_pairs);
            bytes = saturating_sum(bytes, plan_b->tree_bytes());
        }
        require_trees(bytes, keeps_pairs);
        first = plan_a.tree(options.threads);
        if (plan_b) second = plan_b->tree(options.threads);
    }

    FlatTree<Scalar> first;
    std::optional<FlatTree<Scalar>> second;

    [[nodiscard]] std::uint64_t bytes() const {
        return bytes_of(first) + (second ? bytes_of(*second) : 0);
    }

    /// call(options) of the pairs of trees; what it may hold is what the trees leave.
    template <class Call>
    auto within(const Call& call) const {
        PairOptions left{.narrow = options_.narrow, .threads = options_.threads};
        if (options_.max_result_bytes != 0)
            left.max_result_bytes = options_.max_result_bytes - bytes();
        try {
            return call(left);
        } catch (const ResultTooLarge& error) {
            if (options_.max_result_bytes == 0 && !error.is_exact()) throw;
            refuse(bytes() + error.bytes(), error.is_exact());
        }
    }

private:
    void require_trees(std::uint64_t bytes, bool keeps_pairs) const {
        try {
            require_result_bytes(call_of_pairs, bytes, options_.max_result_bytes);
        } catch (const ResultTooLarge&) {
            if (!keeps_pairs) throw;
            refuse(bytes, true);
        }
    }
    /// A step needs `bytes`, or more than these. The names of pairs, which come later, may need
    /// more than all before.
    [[noreturn]] void refuse(std::uint64_t bytes, bool exact) const {
        const std::uint64_t limit = options_.max_result_bytes;
        throw ResultTooLarge(call_of_pairs, exact ? bytes - 1 : bytes, false,
                             limit != 0 ? limit : usual_result_bytes());
    }
    static std::uint64_t bytes_of(const FlatTree<Scalar>& side) {
        return side.tree.bytes() + side.names.runs.size() * sizeof(FlatNames::Run);
    }

    const ScenePairOptions& options_;
};

template <class Scalar>
ScenePairs pairs_of_scenes(const BasicScene<Scalar>& a, const BasicScene<Scalar>* b,
                           const ScenePairOptions& options) {
    ScenePairs out;
    with_threads(options.threads, [&] {
        const FlatSides<Scalar> sides(a, b, true, options);
        const std::vector<PrimitivePair> found = sides.within([&](const PairOptions& how) {
            return sides.second ? overlapping_pairs(sides.first.tree, sides.second->tree, how)
                                : overlapping_pairs(sides.first.tree, how);
        });
        const std::uint64_t held = sides.bytes() + found.size() * sizeof(PrimitivePair);
        require_result_bytes(
            call_of_pairs,
            found.size() * sizeof(ScenePair) + (options.max_result_bytes != 0 ? held : 0),
            options.max_result_bytes);
        out.pairs.resize(found.size());
        const FlatNames &first = sides.first.names,
                        &second = sides.second ? sides.second->names : first;
        for_each_index(found.size(), [&](std::size_t i) {
            out.pairs[i] = {first.name(found[i].first), second.name(found[i].second)};
        });
        out.first = {sides.first.tree.input_count(), sides.first.tree.left_out()};
        if (sides.second)
            out.second = {sides.second->tree.input_count(), sides.second->tree.left_out()};
    });
    return out;
}

template <class Scalar>
std::uint64_t count_of_scenes(const BasicScene<Scalar>& a, const BasicScene<Scalar>* b,
                              const ScenePairOptions& options) {
    std::uint64_t count = 0;
    with_threads(options.threads, [&] {
        const FlatSides<Scalar> sides(a, b, false, options);
        count = sides.within([&](const PairOptions& how) {
            return sides.second ? count_overlapping_pairs(sides.first.tree, sides.second->tree, how)
                                : count_overlapping_pairs(sides.first.tree, how);
        });
    });
    return count;
}

}  // namespace

ScenePairs overlapping_pairs(const Scene& scene, const ScenePairOptions& options) {
    return pairs_of_scenes<float>(scene, nullptr, options);
}
ScenePairs overlapping_pairs(const SceneD& scene, const ScenePairOptions& options) {
    return pairs_of_scenes<double>(scene, nullptr, options);
}
ScenePairs overlapping_pairs(const Scene& a, const Scene& b, const ScenePairOptions& options) {
    return pairs_of_scenes<float>(a, &b, options);
}
ScenePairs overlapping_pairs(const SceneD& a, const SceneD& b, const ScenePairOptions& options) {
    return pairs_of_scenes<double>(a, &b, options);
}

std::uint64_t count_overlapping_pairs(const Scene& scene, const ScenePairOptions& options) {
    return count_of_scenes<float>(scene, nullptr, options);
}
std::uint64_t count_overlapping_pairs(const SceneD& scene, const ScenePairOptions& options) {
    return count_of_scenes<double>(scene, nullptr, options);
}
std::uint64_t count_overlapping_pairs(const Scene& a, const Scene& b,
                                      const ScenePairOptions& options) {
    return count_of_scenes<float>(a, &b, options);
}
std::uint64_t count_overlapping_pairs(const SceneD& a, const SceneD& b,
                                      const ScenePairOptions& options) {
    return count_of_scenes<double>(a, &b, options);
}

}  // namespace raydix
