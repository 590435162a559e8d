// Whether a commit has anything to do, and what it tells if not.
#pragma once

#include <raydix/scene.h>

#include <algorithm>
#include <type_traits>
#include <utility>
#include <vector>

namespace raydix {

/// Whether a commit would make the tree of the last one again if the scene itself had not changed.
template <class State>
bool is_settled_below(const State& state, const SceneOptions& options) {
    if (!state.report || options.quality != state.tree->quality ||
        options.usage != state.tree->usage || options.compact != state.tree->compact ||
        options.refit_limit != state.refit_limit || (options.strict && state.report->left_out != 0))
        return false;
    return std::ranges::all_of(state.below,
                               [](const auto& one) { return one.first->tree.get() == one.second; });
}

/// Whether a commit would make the tree of the last one again.
template <class State>
bool is_settled(const State& state, const SceneOptions& options) {
    return !state.changed && is_settled_below(state, options);
}

/// State::below of a scene that has these geometries and this tree.
template <class Geometries, class Tree>
auto scenes_below(const Geometries& geometries, const Tree& tree) {
    using State = std::remove_cvref_t<decltype(*geometries.begin()->second.scene)>;
    std::vector<std::pair<const State*, const void*>> scenes;
    const void* last = nullptr;  // most instances place what the one before them places
    for (const auto& instance : tree.instances) {
        if (instance.scene.get() == last) continue;
        last = instance.scene.get();
        scenes.emplace_back(geometries.at(instance.id).scene.get(), last);
    }
    std::ranges::sort(scenes);
    scenes.erase(std::unique(scenes.begin(), scenes.end()), scenes.end());
    return scenes;
}

/// What a commit tells that changes nothing.
inline CommitReport report_of_no_change(CommitReport report) {
    report.trees_built = report.trees_refitted = 0;
    report.sah_ratio = 1;
    report.parts_refitted = false;
    return report;
}

}  // namespace raydix
