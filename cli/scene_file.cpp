#include "scene_file.h"

#include <fmt/format.h>
#include <raydix/scene_info.h>

#include <chrono>
#include <utility>
#include <vector>

#include "scene_trace.h"

namespace raydix::cli {

const char* layout_name(const SceneOptions& options) {
    return options.compact ? "compact" : "wide8";
}

const char* quality_name(Quality quality) {
    return quality == Quality::fast ? "fast" : quality == Quality::high ? "high" : "balanced";
}

bool wants_scene_layout(const TreeOptions& tree) {
    return tree.layout == "wide8" || tree.layout == "compact";
}

bool saves_a_scene(const Model& model, const TreeOptions& tree, const CommonOptions& common) {
    return wants_scene_layout(tree) || (!model.is_flat() && serves_a_scene(tree, common));
}

void build_scene_file(Model model, const std::string& scene, const std::string& file, int repeat,
                      const TreeOptions& tree, const CommonOptions& common) {
    CommonOptions of_scene = common;
    of_scene.flatten = false;
    if (!serves_a_scene(tree, of_scene))
        throw CLI::ValidationError("--output", "a scene of layout " + tree.layout +
                                                   " is built on the cpu, as --quality says");
    if (common.flatten) flatten(model, common);
    const SceneOptions options = scene_options(tree, common);
    Scene made;
    CommitReport report;
    std::vector<double> ms;
    about(scene, [&] {
        made = Scene(model, options);
        for (int i = 0; i < repeat; ++i) {
            made = Scene();
            const auto start = std::chrono::steady_clock::now();
            made = Scene(model, options);
            const std::chrono::duration<double, std::milli> spent =
                std::chrono::steady_clock::now() - start;
            ms.push_back(spent.count());
        }
        report = made.commit(options);  // nothing is left to do but to count
    });
    save_rdx(file, made, model.name, model.cameras);
    const Spread spread = spread_of(ms);
    Json document = new_document("build");
    document["scene"] = scene_json(model);
    document["load_ms"] = model.load_ms;
    document["build"] = {
        {"tree", "bvh"},
        {"quality", quality_name(options.quality)},
        {"layout", layout_name(options)},
        {"device", "cpu"},
        {"threads", threads_at_work(common.threads)},
        {"repeat", repeat},
        {"paths", report.paths},
        {"ms", {{"total", spread.median}}},
        {"ms_spread", {{"min", {{"total", spread.min}}}, {"max", {{"total", spread.max}}}}}};
    if (common.prints_tables()) {
        fmt::print("{}: a scene of {} and {}, quality {}, layout {}, loaded in {:.1f} ms\n",
                   model.name, counted(model.meshes.size(), "mesh", "meshes"),
                   counted(model.nodes.size(), "node", "nodes"), quality_name(options.quality),
                   layout_name(options), model.load_ms);
        fmt::print("{:<12} {:>9.2f} {:>9.2f} {:>9.2f}   ms: median, min, max\n", "commit",
                   spread.median, spread.min, spread.max);
        fmt::print("written      {}\n", file);
    }
    tell_left_out(document, left_out_triangles(made), common);
    write_json(document, common);
}

RdxScene load_scene_file(const std::string& file, const TreeOptions& tree,
                         const CommonOptions& common) {
    const auto refuse = [&](const std::string& option) {
        throw CLI::ValidationError(option, "the scene in " + file + " is used as it is");
    };
    for (const CLI::Option* option : tree.of_the_build)
        if (option->count() != 0) refuse(option->get_name());
    if (tree.tree != "bvh") refuse("--tree");
    if (tree.device != "cpu") refuse("--device");
    if (tree.layout_option != nullptr && tree.layout_option->count() != 0) refuse("--layout");
    if (tree.epo_sample) refuse("--epo");
    if (common.flatten) refuse("--flatten");
    RdxScene out = load_rdx_scene(file);
    if (!tree.cameras_file.empty()) out.cameras = load_cameras(tree.cameras_file);
    return out;
}

Model model_of(const RdxScene& file) {
    Model model;
    model.name = file.name;
    model.cameras = file.cameras;
    model.load_ms = file.load_ms;
    return model;
}

Json scene_file_json(const RdxScene& file) {
    return {{"name", file.name},
            {"triangles", file.counts.triangles},
            {"points", 0},
            {"vertices", file.counts.vertices},
            {"geometries", file.counts.meshes},
            {"instances", file.counts.instances},
            {"shapes", file.counts.shapes},
            {"cameras", file.cameras.cameras.size()},
            {"scenes", file.counts.scenes},
            {"nodes", file.counts.nodes},
            {"quality", quality_name(file.options.quality)},
            {"layout", layout_name(file.options)},
            {"bytes", file.counts.bytes}};
}

}  // namespace raydix::cli
