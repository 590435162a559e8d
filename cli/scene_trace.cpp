#include "scene_trace.h"

#include <fmt/format.h>
#include <raydix/wide.h>

#include <algorithm>
#include <chrono>

namespace raydix::cli {

bool serves_a_scene(const TreeOptions& tree, const CommonOptions& common) {
    const auto given = [](const CLI::Option* option) { return option->count() != 0; };
    const bool of_one_tree = std::ranges::any_of(tree.of_the_build, [&](const CLI::Option* option) {
        return given(option) && option->get_name() != "--quality";
    });
    return !common.flatten && tree.tree == "bvh" && tree.device == "cpu" && !of_one_tree &&
           !tree.epo_sample &&
           (!given(tree.layout_option) || tree.layout == "wide8" || tree.layout == "compact");
}

SceneOptions scene_options(const TreeOptions& tree, const CommonOptions& common) {
    SceneOptions options;
    options.quality = tree.quality == "fast"   ? Quality::fast
                      : tree.quality == "high" ? Quality::high
                                               : Quality::balanced;
    options.compact = tree.layout == "compact";
    options.threads = common.threads;
    return options;
}

SceneTracer::SceneTracer(const Model& model, const TreeOptions& tree,
                         const WideTraceOptions& options, const CommonOptions& common)
    : quality_(tree.quality.empty() ? "balanced" : tree.quality),
      isa_(options.isa.empty() ? simd_instruction_sets().front() : options.isa),
      path_(simd_path_from_name(options.path)),
      compact_(tree.layout == "compact"),
      threads_(common.threads) {
    const auto start = std::chrono::steady_clock::now();
    scene_ = Scene(model, scene_options(tree, common));
    ms_ =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

SceneTraceOptions SceneTracer::trace_options() const {
    SceneTraceOptions options;
    options.threads = threads_;
    options.path = path_;
    options.isa = isa_;
    return options;
}

TraceCounts SceneTracer::closest(std::span<const Ray> rays, std::span<Hit> hits) const {
    return trace(scene_, rays, hits, trace_options());
}

TraceCounts SceneTracer::any(std::span<const Ray> rays, std::span<std::uint8_t> occluded) const {
    return trace_any(scene_, rays, occluded, trace_options());
}

AllHits SceneTracer::all(std::span<const Ray> rays, std::uint64_t max_result_bytes) const {
    SceneTraceOptions options = trace_options();
    options.max_result_bytes = max_result_bytes;
    return trace_all(scene_, rays, options);
}

Json SceneTracer::build_json() const {
    return {{"tree", "bvh"},
            {"quality", quality_},
            {"layout", compact_ ? "compact" : "wide8"},
            {"device", "cpu"},
            {"threads", threads_at_work(threads_)},
            {"ms", {{"total", ms_}}}};
}

void SceneTracer::explain(const CommonOptions& common) const {
    if (!common.prints_tables()) return;
    fmt::print(
        "kernel engine: {} layout, nodes of up to 8 children, a tree for the meshes of each node "
        "and one over the nodes, {} code, paths chosen by batch ({})\n",
        compact_ ? "compact" : "wide8", isa_, simd_path_name(path_));
}

}  // namespace raydix::cli
