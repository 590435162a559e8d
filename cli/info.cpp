// raydix info, raydix scenes.
#include <fmt/format.h>
#include <raydix/scene_info.h>

#include <memory>

#include "output.h"
#include "scene_file.h"

namespace raydix::cli {
namespace {

struct InfoOptions {
    CommonOptions common;
    TreeOptions tree;
    std::string scene;
};

/// Triangles, or points of a cloud, that a tree leaves out.
std::uint64_t left_out_of(const MeshInfo& info) {
    return info.points ? info.non_finite_vertices + info.out_of_range_vertices
                       : info.left_out_triangles;
}

void print_counts(const MeshInfo& info) {
    fmt::print("triangles    {}\n", grouped(info.triangles));
    fmt::print("vertices     {}\n", grouped(info.vertices));
    if (info.points) fmt::print("points       {}\n", grouped(info.points));
    if (info.bounds.lo.x <= info.bounds.hi.x)
        fmt::print("bounds       ({:.9g}, {:.9g}, {:.9g}) to ({:.9g}, {:.9g}, {:.9g})\n",
                   info.bounds.lo.x, info.bounds.lo.y, info.bounds.lo.z, info.bounds.hi.x,
                   info.bounds.hi.y, info.bounds.hi.z);
    else
        fmt::print("bounds       none\n");
    fmt::print("zero area    {} triangles, {} of them with a repeated index\n",
               grouped(info.zero_area_triangles), grouped(info.repeated_index_triangles));
    fmt::print("non-finite   {} vertices\n", grouped(info.non_finite_vertices));
    fmt::print("out of range {} vertices (beyond 1e12)\n", grouped(info.out_of_range_vertices));
    fmt::print("unreferenced {} vertices\n", grouped(info.unreferenced_vertices));
    fmt::print("left out     {} {} of a tree\n", grouped(left_out_of(info)),
               info.points ? "points" : "triangles");
}

void print_info(const Model& scene, const MeshInfo& info, std::size_t meshes, std::size_t nodes) {
    fmt::print("scene        {}\n", scene.name);
    if (nodes != 0)
        fmt::print("structure    {} in {}; below: as one mesh\n", counted(meshes, "mesh", "meshes"),
                   counted(nodes, "node", "nodes"));
    print_counts(info);
    if (scene.cameras_fault.empty())
        fmt::print("cameras      {}\n", scene.cameras.cameras.size());
    else
        fmt::print("cameras      one that sees all: {}\n", scene.cameras_fault);
    fmt::print("memory       {:.2f} MB\n", static_cast<double>(info.bytes) / 1e6);
    fmt::print("loaded in    {:.1f} ms\n", scene.load_ms);
}

void print_scene_file(const RdxScene& file, const MeshInfo& info) {
    const RdxCounts& counts = file.counts;
    fmt::print("scene        {}\n", file.name);
    fmt::print("holds        {}, {}, {}; below: as one mesh\n",
               counted(counts.scenes, "scene", "scenes"), counted(counts.meshes, "mesh", "meshes"),
               counted(counts.instances, "instance", "instances"));
    print_counts(info);
    if (counts.shapes != 0) fmt::print("shapes       {}\n", grouped(counts.shapes));
    fmt::print("trees        {} nodes, layout {}, quality {}\n", grouped(counts.nodes),
               layout_name(file.options), quality_name(file.options.quality));
    fmt::print("cameras      {}\n", file.cameras.cameras.size());
    fmt::print("memory       {:.2f} MB\n", static_cast<double>(counts.bytes) / 1e6);
    fmt::print("loaded in    {:.1f} ms\n", file.load_ms);
}

/// What the nodes show, as one mesh, in place of what each geometry holds once.
void add_counts(Json& scene, const MeshInfo& info) {
    for (const auto& [field, count] : {std::pair{"triangles", info.triangles},
                                       {"vertices", info.vertices},
                                       {"points", info.points},
                                       {"left_out", left_out_of(info)}})
        scene[field] = count;
    scene.update(mesh_info_json(info));
}

void run_info_of_scene_file(const InfoOptions& options) {
    const RdxScene file = load_scene_file(options.scene, options.tree, options.common);
    const MeshInfo info = inspect(file.scene);
    Json document = new_document("info");
    document["scene"] = scene_file_json(file);
    add_counts(document["scene"], info);
    document["scene"]["bytes"] = file.counts.bytes;
    document["load_ms"] = file.load_ms;
    if (options.common.prints_tables()) print_scene_file(file, info);
    write_json(document, options.common);
}

void run_info(const InfoOptions& options) {
    if (is_scene_file(options.scene)) return run_info_of_scene_file(options);
    Json document = new_document("info");
    SceneTree input;
    if (is_rdx(options.scene))
        input = load_scene_tree(options.scene, options.tree, options.common);
    else
        input.scene = load_structured_model(options.scene, options.tree, options.common);
    document["scene"] = scene_json(input.scene);
    const std::size_t meshes = input.scene.meshes.size(), nodes = input.scene.nodes.size();
    input.scene.flatten();
    const MeshInfo info = inspect(input.scene.mesh());
    add_counts(document["scene"], info);
    document["load_ms"] = input.scene.load_ms;
    if (options.common.prints_tables()) print_info(input.scene, info, meshes, nodes);
    if (is_rdx(options.scene)) {
        const TreeStats stats = tree_stats(input.bvh, stats_options(options.tree, options.common));
        document["build"] = build_json(input.bvh, stats, {});
        if (options.common.prints_tables()) print_tree_table(input.bvh, stats);
    }
    write_json(document, options.common);
}

void run_scenes(const CommonOptions& common) {
    Json document = new_document("scenes");
    Json scenes = Json::array();
    for (const BuiltinScene& scene : builtin_scenes()) {
        Json parameters = Json::array();
        if (common.prints_tables()) fmt::print("builtin:{}\n    {}\n", scene.name, scene.what);
        for (const BuiltinParameter& p : scene.parameters) {
            parameters.push_back({{"name", p.name},
                                  {"default", p.default_value},
                                  {"min", p.min_value},
                                  {"max", p.max_value},
                                  {"meaning", p.meaning}});
            if (common.prints_tables())
                fmt::print("    {}={:.0f}  ({:.0f} to {:.0f}) {}\n", p.name, p.default_value,
                           p.min_value, p.max_value, p.meaning);
        }
        scenes.push_back({{"name", scene.name}, {"what", scene.what}, {"parameters", parameters}});
    }
    document["scenes"] = scenes;
    write_json(document, common);
}

}  // namespace

void add_info_command(CLI::App& app) {
    auto options = std::make_shared<InfoOptions>();
    CLI::App* command =
        app.add_subcommand("info", "Counts, bounds, degenerate elements and memory of a scene");
    command->add_option("SCENE", options->scene, "A file, or builtin:NAME?key=value&...")
        ->required();
    add_common_options(*command, options->common);
    command->callback([options] {
        require_writable_json(options->common);
        run_info(*options);
    });
}

void add_scenes_command(CLI::App& app) {
    auto common = std::make_shared<CommonOptions>();
    CLI::App* command = app.add_subcommand("scenes", "The built-in scenes and their parameters");
    add_common_options(*command, *common);
    command->callback([common] { run_scenes(*common); });
}

}  // namespace raydix::cli
