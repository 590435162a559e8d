// raydix build, raydix check.
#include <fmt/format.h>
#include <raydix/check.h>
#include <raydix/error.h>
#include <raydix/rdx.h>

#include <memory>
#include <utility>

#include "device_scene.h"
#include "kdtree_commands.h"
#include "layout_builds.h"
#include "octree_commands.h"
#include "option_checks.h"
#include "output.h"
#include "scene_file.h"
#include "wide_trace.h"

namespace raydix::cli {
namespace {

struct BuildCommand {
    CommonOptions common;
    TreeOptions tree;
    std::string scene, out_file;
    int repeat = 5;
};

/// One warm-up, then `repeat` builds into new memory, and as many into kept memory.
struct BuiltTree {
    Bvh bvh;
    TimedBuilds builds;
};

BuiltTree build_repeatedly(const Mesh& mesh, const BuildOptions& options, int repeat) {
    BuiltTree built{build_bvh(mesh, options), {}};
    for (int i = 0; i < repeat; ++i) {
        built.bvh = Bvh();
        built.bvh = build_bvh(mesh, options);
        built.builds.fresh.push_back(built.bvh.build_ms());
    }
    built.builds.peak_bytes = built.bvh.peak_bytes();
    BvhBuilder builder;
    Bvh again;
    builder.build(mesh, options, again);
    for (int i = 0; i < repeat; ++i) {
        builder.build(mesh, options, again);
        built.builds.kept.push_back(again.build_ms());
    }
    return built;
}

/// The peak is what is held on the device, tree included.
BuiltTree build_repeatedly_on_device(const Mesh& mesh, const BuildOptions& options, int repeat) {
    DeviceScene device(mesh, options);
    TimedBuilds builds;
    static_cast<void>(device.build_fresh());
    for (int i = 0; i < repeat; ++i) builds.fresh.push_back(device.build_fresh());
    for (int i = 0; i < repeat; ++i) builds.kept.push_back(device.build_again());
    builds.peak_bytes = device.tree_bytes();
    return {device.download(), builds};
}

void print_build_table(const Json& build, int repeat) {
    print_stages(build, static_cast<std::size_t>(repeat));
    const auto line = [](const char* name, const Json& ms, const char* what) {
        fmt::print("{:<12} {:>9.2f} {:>9.2f} {:>9.2f}   {}\n", name, ms["median"].get<double>(),
                   ms["min"].get<double>(), ms["max"].get<double>(), what);
    };
    line("rebuild", build["kept_ms"], "total into kept memory");
    if (!build.contains("binary")) return;
    const Json& binary = build["binary"];
    line("binary",
         {{"median", binary["ms"]["total"]},
          {"min", binary["ms_spread"]["min"]["total"]},
          {"max", binary["ms_spread"]["max"]["total"]}},
         "total of the binary tree alone");
}

/// --tree octree or kdtree.
void run_octree_or_kdtree(const BuildCommand& options) {
    const bool octree = options.tree.tree == "octree";
    if (!options.out_file.empty())
        throw CLI::ValidationError("--output", std::string(".rdx files hold a bvh; ") +
                                                   (octree ? "an octree" : "a kdtree") +
                                                   " cannot be saved");
    const auto run = octree ? run_octree_build : run_kdtree_build;
    run(options.scene, options.tree, options.common, options.repeat);
}

void run_build(const BuildCommand& options) {
    if (options.tree.tree != "bvh") refuse_layout(options.tree);
    if (options.tree.layout != "binary" && !wants_scene_layout(options.tree) &&
        !options.out_file.empty())
        throw CLI::ValidationError("--output",
                                   ".rdx files hold the binary layout, or scenes of wide8 or "
                                   "compact, not " +
                                       options.tree.layout);
    if (options.tree.tree != "bvh") return run_octree_or_kdtree(options);
    Model scene = load_structured_model(options.scene, options.tree, options.common);
    if (!options.out_file.empty() && saves_a_scene(scene, options.tree, options.common))
        return build_scene_file(std::move(scene), options.scene, options.out_file, options.repeat,
                                options.tree, options.common);
    flatten(scene, options.common);
    Json document = new_document("build");
    document["scene"] = scene_json(scene);
    document["load_ms"] = scene.load_ms;
    const BuildOptions how = about(
        options.scene, [&] { return options.tree.build_options(scene.mesh(), options.common); });
    const BuiltTree built = about(options.scene, [&] {
        const auto build =
            runs_on_device(options.tree.device) ? build_repeatedly_on_device : build_repeatedly;
        return build(scene.mesh(), how, options.repeat);
    });
    const Bvh& bvh = built.bvh;
    const TreeStats stats = tree_stats(bvh, stats_options(options.tree, options.common));
    document["scene"]["left_out"] = bvh.left_out();
    Json build = build_json(bvh, stats, built.builds.fresh, options.tree.epo_sample);
    build["repeat"] = options.repeat;
    build["device"] = options.tree.device;
    if (is_device(options.tree.device)) build["device_name"] = device_name();
    build["peak_bytes"] = *built.builds.peak_bytes;
    build["kept_ms"] = spread_json(totals(built.builds.kept));
    if (options.tree.layout != "binary")
        about(options.scene, [&] {
            const LayoutRequest request{
                bvh,          scene.mesh(),        how,
                built.builds, options.tree.layout, is_device(options.tree.device)};
            keep_binary(build);
            set_layout_builds(build, options.tree.layout == "cwbvh"
                                         ? add_cwbvh(build, request)
                                         : add_wide_builds(build, request));
        });
    document["build"] = build;
    if (options.common.prints_tables()) {
        fmt::print("{}: {} triangles, {} vertices, loaded in {:.1f} ms\n", scene.name,
                   grouped(scene.mesh().triangles.size()), grouped(scene.mesh().vertices.size()),
                   scene.load_ms);
        print_build_table(build, options.repeat);
        print_tree_table(bvh, stats);
        if (build.contains("cwbvh")) print_cwbvh_table(build["cwbvh"]);
        if (build.contains("wide")) print_wide_table(build["wide"]);
        if (build.contains("binary"))
            fmt::print("peak         {:.2f} MB while building, layout included\n",
                       build["peak_bytes"].get<double>() / 1e6);
    }
    if (!options.out_file.empty()) {
        save_rdx(options.out_file, bvh, scene);
        if (options.common.prints_tables()) fmt::print("written      {}\n", options.out_file);
    }
    write_json(document, options.common);
}

struct CheckCommand {
    CommonOptions common;
    TreeOptions tree;
    std::string scene;
    std::vector<std::string> same;
};

void run_check(const CheckCommand& options) {
    refuse_layout(options.tree);
    if (options.tree.tree == "octree" && options.same.empty())
        return run_octree_check(options.scene, options.tree, options.common);
    if (options.tree.tree == "kdtree" && options.same.empty())
        return run_kdtree_check(options.scene, options.tree, options.common);
    const bool compares = !options.same.empty();
    Json document = new_document("check");
    CheckReport report;
    std::string what = options.scene;
    if (compares) {
        for (const std::string& file : options.same)
            if (is_scene_file(file))
                throw InputError(file + ": it holds a scene, and --same compares trees");
        const SceneTree a = load_scene_tree(options.same[0], options.tree, options.common);
        const SceneTree b = load_scene_tree(options.same[1], options.tree, options.common);
        report = check_same(a.bvh, b.bvh);
        what = options.same[0] + " and " + options.same[1];
    } else if (is_scene_file(options.scene)) {
        const RdxScene file = load_scene_file(options.scene, options.tree, options.common);
        report.ok = true;  // it is not loaded else
        report.nodes = file.counts.nodes;
        report.primitives = file.counts.triangles;
    } else {
        refuse_build_options(options.scene, options.tree);
        const SceneTree input = load_scene_tree(options.scene, options.tree, options.common);
        report = check(input.bvh, input.scene.mesh());
    }
    const Json reason = report.ok ? Json(nullptr) : Json(report.broken);
    document["check"] = {{"ok", report.ok}};
    if (compares)
        document["check"].update(
            {{"compared", options.same}, {"same", report.ok}, {"difference", reason}});
    else
        document["check"]["broken"] = reason;
    document["check"].update({{"nodes", report.nodes}, {"primitives", report.primitives}});
    write_json(document, options.common);
    if (!report.ok) throw InputError(what + ": " + report.broken);
    if (options.common.prints_tables())
        fmt::print("{}: {}, {} nodes, {} primitives\n", what,
                   compares ? "the same" : "every invariant holds", grouped(report.nodes),
                   grouped(report.primitives));
}

}  // namespace

void add_build_command(CLI::App& app) {
    auto options = std::make_shared<BuildCommand>();
    CLI::App* command =
        app.add_subcommand("build", "Build a tree; print times and statistics; save it");
    command->add_option("SCENE", options->scene, "A file, or builtin:NAME?key=value&...")
        ->required();
    command->add_option("--repeat", options->repeat, "Builds to time after a warm-up")
        ->transform(whole_number(1, 10000))
        ->capture_default_str();
    command
        ->add_option("-o,--output", options->out_file,
                     "Save the tree with its geometry; of a scene of several meshes or nodes, or "
                     "with --layout wide8 or compact, the whole scene")
        ->check(file_name())
        ->type_name("FILE.rdx");
    add_tree_options(*command, options->tree);
    offer_builders(*command);
    add_tree_figure_options(*command, options->tree);
    add_flatten_option(*command, options->common);
    add_common_options(*command, options->common);
    command->callback([options] {
        require_writable(options->out_file);
        require_writable_json(options->common);
        run_build(*options);
    });
}

void add_check_command(CLI::App& app) {
    auto options = std::make_shared<CheckCommand>();
    CLI::App* command =
        app.add_subcommand("check", "Validate every invariant of a tree, or compare two trees");
    CLI::Option* scene =
        command->add_option("SCENE", options->scene, "A .rdx file, or a scene to build first");
    CLI::Option* same =
        command->add_option("--same", options->same, "Compare the trees of A and B in full")
            ->expected(2)
            ->type_name("A B");
    scene->excludes(same);
    add_tree_options(*command, options->tree);
    offer_builds(*command);
    add_flatten_option(*command, options->common);
    add_common_options(*command, options->common);
    command->callback([options, scene, same] {
        if (scene->count() + same->count() == 0) throw CLI::RequiredError("SCENE or --same A B");
        require_writable_json(options->common);
        run_check(*options);
    });
}

}  // namespace raydix::cli
