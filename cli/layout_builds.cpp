#include "layout_builds.h"

#include <fmt/format.h>
#include <raydix/cwbvh.h>
#include <raydix/wide.h>

#include <algorithm>
#include <chrono>

#include "wide_trace.h"

namespace raydix::cli {

Spread totals(const std::vector<BuildMs>& builds) {
    std::vector<double> values;
    for (const BuildMs& b : builds) values.push_back(b.total);
    return spread_of(values);
}

BuildMs with_layout(BuildMs of_tree, double layout_ms) {
    of_tree.layout += layout_ms;
    of_tree.total += layout_ms;
    return of_tree;
}

std::uint64_t peak_with_layout(const Bvh& bvh, std::uint64_t layout_bytes) {
    return std::max(bvh.peak_bytes(), bvh.bytes() + layout_bytes);
}

void keep_binary(Json& build) {
    Json binary = Json::object();
    for (const char* field : {"ms", "ms_spread", "kept_ms", "bytes", "peak_bytes"})
        if (build.contains(field)) binary[field] = build[field];
    build["binary"] = binary;
}

void set_layout_builds(Json& build, const TimedBuilds& builds) {
    add_build_ms(build, builds.fresh);
    if (!builds.kept.empty()) build["kept_ms"] = spread_json(totals(builds.kept));
    if (builds.peak_bytes) build["peak_bytes"] = *builds.peak_bytes;
}

namespace {

/// `layout_ms`: of each repeat.
TimedBuilds after_trees(const TimedBuilds& of_tree, const std::vector<double>& layout_ms) {
    TimedBuilds builds;
    for (std::size_t i = 0; i < layout_ms.size(); ++i) {
        builds.fresh.push_back(with_layout(of_tree.fresh[i], layout_ms[i]));
        builds.kept.push_back(with_layout(of_tree.kept[i], layout_ms[i]));
    }
    return builds;
}

/// From the mesh. Returns the tree of the last build.
WideBvh build_wide_repeatedly(const LayoutRequest& request, const WideBvhOptions& wide,
                              TimedBuilds& builds) {
    const std::size_t repeat = request.of_tree.fresh.size();
    WideBvh tree = build_wide_bvh(request.mesh, request.options, wide);
    for (std::size_t i = 0; i < repeat; ++i) {
        tree = WideBvh();
        tree = build_wide_bvh(request.mesh, request.options, wide);
        builds.fresh.push_back(tree.stats().stages);
        builds.peak_bytes = std::max(builds.peak_bytes.value_or(0), tree.stats().peak_bytes);
    }
    WideBvhBuilder builder;
    builder.build(request.mesh, request.options, tree, wide);
    for (std::size_t i = 0; i < repeat; ++i) {
        builder.build(request.mesh, request.options, tree, wide);
        builds.kept.push_back(tree.stats().stages);
    }
    return tree;
}

}  // namespace

TimedBuilds add_wide_builds(Json& build, const LayoutRequest& request) {
    const WideBvhOptions wide = wide_options(request.layout, request.options.threads);
    TimedBuilds builds;
    WideBvh tree;
    if (!request.on_device) {
        tree = build_wide_repeatedly(request, wide, builds);
    } else {
        std::vector<double> ms;
        for (std::size_t i = 0; i < request.of_tree.fresh.size(); ++i) {
            tree = WideBvh(request.bvh, wide);
            ms.push_back(tree.stats().ms);
        }
        builds = after_trees(request.of_tree, ms);
    }
    add_wide(build, tree);
    build["wide"]["build_ms"] = spread_json(totals(builds.fresh));
    build["wide"]["kept_ms"] = spread_json(totals(builds.kept));
    return builds;
}

TimedBuilds add_cwbvh(Json& build, const LayoutRequest& request) {
    std::vector<double> ms;
    CwbvhStats s;
    for (std::size_t i = 0; i < request.of_tree.fresh.size(); ++i) {
        const auto start = std::chrono::steady_clock::now();
        const Cwbvh tree(request.bvh, request.options.threads);
        const std::chrono::duration<double, std::milli> spent =
            std::chrono::steady_clock::now() - start;
        ms.push_back(spent.count());
        s = tree.stats();
    }
    build["layout"] = "cwbvh";
    build["layout_nodes"] = s.nodes;
    build["bytes"] = s.bytes;
    Json& figures = build["cwbvh"] = wide_figures_json(s, s.leaf_children);
    figures["bytes_per_triangle"] = s.bytes_per_triangle;
    figures["ms"] = spread_of(ms).median;
    TimedBuilds builds = after_trees(request.of_tree, ms);
    if (!request.on_device) builds.peak_bytes = peak_with_layout(request.bvh, s.peak_bytes);
    return builds;
}

void print_cwbvh_table(const Json& cwbvh) {
    fmt::print("\ncwbvh        {} nodes of {:.2f} children, {} leaves, depth {}, in {:.2f} ms\n",
               grouped(cwbvh["nodes"].get<std::uint64_t>()),
               cwbvh["children_per_node"].get<double>(),
               grouped(cwbvh["leaves"].get<std::uint64_t>()),
               cwbvh["max_depth"].get<std::uint32_t>(), cwbvh["ms"].get<double>());
    fmt::print(
        "SAH          {:.3f}   (node 1, primitive 1), boxes widened to {:.3f} x their area\n",
        cwbvh["sah"].get<double>(), cwbvh["widening"].get<double>());
    fmt::print("memory       {:.1f} bytes a triangle\n", cwbvh["bytes_per_triangle"].get<double>());
}

}  // namespace raydix::cli
