#include "scene_trace.h"

#include <fmt/format.h>
#include <raydix/wide.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "scene_file.h"

namespace raydix::cli {

bool serves_a_scene(const TreeOptions& tree, const CommonOptions& common) {
    const auto given = [](const CLI::Option* option) { return option->count() != 0; };
    const bool of_one_tree = std::ranges::any_of(tree.of_the_build, [&](const CLI::Option* option) {
        const std::string name = option->get_name();
        return given(option) && name != "--quality" && name != "--strict";
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
    options.strict = tree.strict;
    options.threads = common.threads;
    return options;
}

SceneTracer::SceneTracer(const WideTraceOptions& options, const CommonOptions& common)
    : isa_(options.isa.empty() ? simd_instruction_sets().front() : options.isa),
      path_(simd_path_from_name(options.path)),
      threads_(common.threads) {}

SceneTracer::SceneTracer(const Model& model, const TreeOptions& tree,
                         const WideTraceOptions& options, const CommonOptions& common)
    : SceneTracer(options, common) {
    made_with_ = scene_options(tree, common);
    scene_json_ = cli::scene_json(model);
    const auto start = std::chrono::steady_clock::now();
    scene_ = Scene(model, made_with_);
    ms_ =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

SceneTracer::SceneTracer(RdxScene file, const WideTraceOptions& options,
                         const CommonOptions& common)
    : SceneTracer(options, common) {
    made_with_ = file.options;
    scene_json_ = scene_file_json(file);
    scene_ = std::move(file.scene);
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
            {"quality", quality_name(made_with_.quality)},
            {"layout", made_with_.compact ? "compact" : "wide8"},
            {"device", "cpu"},
            {"threads", threads_at_work(threads_)},
            {"ms", ms_ ? Json{{"total", *ms_}} : Json(nullptr)}};
}

HitFields SceneTracer::hit_fields() const {
    const bool one_mesh = scene_json_["geometries"] == 1 && scene_json_["instances"] == 0 &&
                          scene_json_.value("shapes", 0) == 0;
    return one_mesh ? HitFields::tree : HitFields::scene;
}

void SceneTracer::explain(const CommonOptions& common) const {
    if (!common.prints_tables()) return;
    fmt::print(
        "kernel engine: {} layout, nodes of up to 8 children, a tree for the meshes of each node "
        "and one over the nodes, {} code, paths chosen by batch ({})\n",
        made_with_.compact ? "compact" : "wide8", isa_, simd_path_name(path_));
}

}  // namespace raydix::cli
