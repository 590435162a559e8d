// study_hierarchy: bounds, codes and sort as in any build, then the counted and the timed launches.
#include <raydix/error.h>
#include <raydix/hierarchy_study.h>

#include <algorithm>

#include "base/options.h"
#include "exec/parallel.h"
#include "keys/host_encode.h"
#include "primitives/bounds.h"
#include "sort/radix_sort.h"
#include "tree/counted_builds.h"
#include "tree/lbvh_family.h"

namespace raydix {
namespace {

template <class Key>
struct SortedScene {
    std::vector<Key> keys;
    std::vector<Aabb> boxes;  // in key order
};

template <class Key, class Source>
SortedScene<Key> sort_scene(const Source& source, std::uint32_t n) {
    const Bounds bounds = scene_bounds(source, n);
    if (bounds.first_unreadable != no_primitive)
        throw InputError("triangle " + std::to_string(bounds.first_unreadable) +
                         ": an index is past the last vertex");
    const auto valid = static_cast<std::uint32_t>(n - bounds.left_out);
    SortedScene<Key> scene;
    scene.keys.resize(n);
    std::vector<std::uint32_t> order(n);
    host_encode(source, make_grid(bounds.box, CodeFormat<Key>::axis_bits), valid == n, n,
                scene.keys.data());
    SortScratch<Key> scratch;
    sort_keys<Key>(scene.keys, order, static_cast<int>(8 * sizeof(Key)), scratch);
    scene.keys.resize(valid);
    scene.boxes.resize(valid);
    for_each_index(valid, [&](std::size_t k) { source.box(order[k], scene.boxes[k]); });
    return scene;
}

/// Inner nodes by depth, as builders that go by levels meet them.
std::vector<std::uint64_t> level_items(const std::vector<LaunchRecord>& launches) {
    std::vector<std::uint64_t> items;
    for (const LaunchRecord& launch : launches)
        if (launch.label == "fit.level") items.push_back(launch.items);
    std::ranges::reverse(items);
    return items;
}

template <class Key, class Source>
void study(const Source& source, std::uint32_t n, const BuildOptions& options, int repeat,
           HierarchyRun& run) {
    const SortedScene<Key> scene = sort_scene<Key>(source, n);
    run.keys = static_cast<std::uint32_t>(scene.keys.size());
    if (run.keys == 0) return;
    const std::span<const Key> keys = scene.keys;
    CountedBuild counted;
    try {
        counted =
            count_build<Key>(options.builder, options.fit, keys, scene.boxes, options.max_leaf);
    } catch (const InputError& error) {  // more memory than the builder may take
        run.refusal = error.what();
        return;
    }
    run.inner_nodes = counted.inner_count;
    run.max_depth = counted.max_depth;
    for (const LaunchRecord& r : counted.launches)
        run.launches.push_back({r.label, r.items, r.bytes, r.steps, r.longest_chain, 0});
    run.items_per_level = level_items(counted.launches);
    std::vector<std::vector<double>> times(run.launches.size());
    for (int k = 0; k <= repeat; ++k) {  // the first one warms up
        const CountedBuild timed =
            time_build<Key>(options.builder, options.fit, keys, scene.boxes, options.max_leaf);
        for (std::size_t l = 0; k > 0 && l < times.size(); ++l)
            times[l].push_back(timed.launches[l].ms);
    }
    for (std::size_t l = 0; l < times.size(); ++l) {
        std::ranges::sort(times[l]);
        if (!times[l].empty()) run.launches[l].ms = times[l][times[l].size() / 2];
    }
}

}  // namespace

HierarchyRun study_hierarchy(const MeshView& mesh, const BuildOptions& options, int repeat) {
    HierarchyRun run;
    run.builder = options.builder;
    run.fit = options.fit;
    run.bits = options.bits;
    run.max_leaf = options.max_leaf;
    check_enum("builder", options.builder, Builder::sbvh);
    check_enum("fit", options.fit, Fit::atomic);
    if (!in_lbvh_family(options.builder))
        throw InputError("builder " + std::string(builder_name(options.builder)) +
                         " is not of the LBVH family");
    if (options.reinsertion_rounds != 0)
        throw InputError("reinsertion_rounds is " + std::to_string(options.reinsertion_rounds) +
                         "; the study is of builds without reinsertion");
    const auto go = [&](const auto& source, std::size_t n) {
        const auto count = static_cast<std::uint32_t>(n);
        with_threads(options.threads, [&] {
            if (options.bits == 30)
                study<std::uint32_t>(source, count, options, repeat, run);
            else
                study<std::uint64_t>(source, count, options, repeat, run);
        });
    };
    if (mesh.triangles.empty())
        go(PointSource{mesh.vertices.data()}, mesh.vertices.size());
    else
        go(TriangleSource{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()},
           mesh.triangles.size());
    return run;
}

}  // namespace raydix
