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

/// Trees of so few triangles take so little time that all lower qualities are tried.
inline constexpr std::size_t few_triangles = 1024;
inline constexpr std::size_t too_few_to_share = 128;  // for threads
/// In larger ones clustering was seen to cost more than the radix tree only where boxes lie in each
/// other a hundredfold, as those of nested shells do. Wide trees of scans and rooms cost 5 to 28.
/// Of binary trees the like is not known.
inline constexpr double costly_sah = 100.0;

/// The quality asked for, and the lower ones that may have a better tree.
inline std::vector<Quality> qualities_to_try(Quality quality, std::size_t triangles) {
    std::vector<Quality> qualities{quality};
    if (quality == Quality::high) qualities.push_back(Quality::balanced);
    if (quality != Quality::fast && triangles <= few_triangles) qualities.push_back(Quality::fast);
    return qualities;
}

/// The tree of the least SAH among those that make(BuildOptions) gives for the quality asked for
/// and lower ones; of equals that of the better word. sah_of(tree): its cost. `threads` as in
/// BuildOptions. All are built at once: what one leaves of the threads another takes. Of more than
/// few_triangles the tree of `fast` is tried afterwards, where the others cost more than `costly`.
template <class Make, class SahOf>
auto build_by_quality(Quality quality, int threads, std::size_t triangles, const Make& make,
                      const SahOf& sah_of, double costly = costly_sah) {
    const std::vector<Quality> qualities = qualities_to_try(quality, triangles);
    const auto build = [&](Quality one) {
        BuildOptions of_quality = build_options_for(one);
        of_quality.threads = threads;
        return make(of_quality);
    };
    using Tree = std::invoke_result_t<Make, const BuildOptions&>;
    const auto or_fast = [&](Tree tree) {
        if (qualities.back() == Quality::fast || !(sah_of(tree) > costly)) return tree;
        const ProgressStage silent(ProgressSpan{});
        Tree fast = build(Quality::fast);
        return sah_of(fast) < sah_of(tree) ? std::move(fast) : std::move(tree);
    };
    if (qualities.size() == 1) return or_fast(build(quality));
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
            triangles <= too_few_to_share ? trees.size() : 1);
    });
    return or_fast(std::move(**std::ranges::min_element(
        trees, {}, [&](const std::optional<Tree>& tree) { return sah_of(*tree); })));
}

}  // namespace raydix
