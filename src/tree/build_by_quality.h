// A mesh's tree for a quality. No builder is the best one for every mesh, so those of lower
// qualities build too where they may be better: a better word should never mean a higher cost.
#pragma once

#include <raydix/bvh.h>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "exec/parallel.h"
#include "exec/progress.h"

namespace raydix {

/// Trees of so few triangles take so little time that all lower qualities are tried. In larger ones
/// clustering was never seen to cost more than the radix tree.
inline constexpr std::size_t few_triangles = 1024;

/// The quality asked for, and the lower ones that may have a better tree.
inline std::vector<Quality> qualities_to_try(Quality quality, std::size_t triangles) {
    std::vector<Quality> qualities{quality};
    if (quality == Quality::high) qualities.push_back(Quality::balanced);
    if (quality != Quality::fast && triangles <= few_triangles) qualities.push_back(Quality::fast);
    return qualities;
}

/// The tree of the least SAH among those that make(BuildOptions) gives for the quality asked for
/// and lower ones; of equals that of the better word. sah_of(tree): its cost. `threads` as in
/// BuildOptions. All are built at once: what one leaves of the threads another takes.
template <class Make, class SahOf>
auto build_by_quality(Quality quality, int threads, std::size_t triangles, const Make& make,
                      const SahOf& sah_of) {
    const std::vector<Quality> qualities = qualities_to_try(quality, triangles);
    const auto build = [&](Quality one) {
        BuildOptions of_quality = build_options_for(one);
        of_quality.threads = threads;
        return make(of_quality);
    };
    if (qualities.size() == 1) return build(quality);
    using Tree = std::invoke_result_t<Make, const BuildOptions&>;
    std::vector<std::optional<Tree>> trees(qualities.size());
    // The best one takes the longest, and tells how far all are.
    const ProgressSpan progress = progress_span();
    with_threads(threads, [&] {
        for_each_index(
            trees.size(),
            [&](std::size_t k) {
                const ProgressStage stage(k == 0 ? progress : ProgressSpan{});
                trees[k].emplace(build(qualities[k]));
            },
            1);
    });
    return std::move(**std::ranges::min_element(
        trees, {}, [&](const std::optional<Tree>& tree) { return sah_of(*tree); }));
}

}  // namespace raydix
