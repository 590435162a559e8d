// Whole builds into kept memory, stage by stage: what a user of each builder gets here.
#include <fmt/format.h>
#include <raydix/error.h>

#include <cmath>

#include "hierarchy_bench.h"

namespace raydix::cli {
namespace {

void print_head(const std::string& scene, int bits) {
    fmt::print("\n{}, {} bits: whole builds into kept memory, ms\n{:<18} {:>8}", scene, bits,
               "builder", "threads");
    for (const auto& [stage, member] : build_stages) fmt::print(" {:>9}", stage);
    fmt::print("\n");
}

/// After one to warm up. Empty if the builder refuses.
std::vector<BuildMs> rebuilds(const Mesh& mesh, const BuildOptions& build, int repeat) {
    BvhBuilder builder;
    Bvh tree;
    std::vector<BuildMs> times;
    try {
        builder.build(mesh, build, tree);
        for (int k = 0; k < repeat; ++k) {
            builder.build(mesh, build, tree);
            times.push_back(tree.build_ms());
        }
    } catch (const InputError&) {  // more memory than it may take; the launches say why
    }
    return times;
}

Json one_build(const std::vector<BuildMs>& times, bool print) {
    Json all = Json::object();
    for (const auto& stage : build_stages) {
        std::vector<double> values;
        for (const BuildMs& ms : times) values.push_back(ms.*stage.second);
        all[stage.first] = times.empty() ? Json(nullptr) : spread_json(spread_of(values));
        if (print) fmt::print(" {:>9}", or_dash(times.empty() ? NAN : spread_of(values).median, 2));
    }
    return all;
}

}  // namespace

Json whole_builds(const HierarchyBench& options, const Model& scene, int bits,
                  const std::vector<int>& thread_counts) {
    const bool print = options.common.prints_tables();
    if (print) print_head(scene.name, bits);
    Json all = Json::array();
    for (const char* name : {"karras", "apetrei", "garanzha", "lauterbach"})
        for (const int threads : thread_counts) {
            const BuildOptions build{.builder = builder_from_name(name),
                                     .bits = bits,
                                     .max_leaf = options.max_leaf,
                                     .threads = threads};
            if (print) fmt::print("{:<18} {:>8}", name, threads);
            all.push_back(
                {{"scene", scene.name},
                 {"builder", name},
                 {"bits", bits},
                 {"threads", threads},
                 {"ms", one_build(rebuilds(scene.mesh(), build, options.repeat), print)}});
            if (print) fmt::print("\n");
        }
    return all;
}

}  // namespace raydix::cli
