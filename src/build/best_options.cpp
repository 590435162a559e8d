// Which quality has the best tree of a mesh.
#include <raydix/bvh.h>
#include <raydix/wide.h>

#include "tree/build_by_quality.h"

namespace raydix {
namespace {

/// cost(options): of the tree that they make.
template <class Cost>
BuildOptions cheapest(const MeshView& mesh, Quality quality, const BuildOptions& options,
                      const Cost& cost) {
    struct Tried {
        BuildOptions options;
        double sah = 0;
    };
    const bool alone = qualities_to_try(quality, mesh.triangles.size()).size() == 1;
    return build_by_quality(
               quality, options.threads, mesh.triangles.size(),
               [&](const BuildOptions& of_quality) {
                   Tried tried{options};
                   tried.options.builder = of_quality.builder;
                   tried.options.reinsertion_rounds = of_quality.reinsertion_rounds;
                   if (!alone) tried.sah = cost(tried.options);
                   return tried;
               },
               [](const Tried& tried) { return tried.sah; }, infinity)
        .options;
}

}  // namespace

BuildOptions best_build_options(const MeshView& mesh, Quality quality,
                                const BuildOptions& options) {
    return cheapest(mesh, quality, options, [&](const BuildOptions& build) {
        return tree_stats(build_bvh(mesh, build), {.with_hash = false, .threads = build.threads})
            .sah.value_or(0);
    });
}

BuildOptions best_wide_build_options(const MeshView& mesh, Quality quality,
                                     const BuildOptions& options, const WideBvhOptions& wide) {
    return cheapest(mesh, quality, options, [&](const BuildOptions& build) {
        return build_wide_bvh(mesh, build, wide).stats().sah;
    });
}

}  // namespace raydix
