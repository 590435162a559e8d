#include "octree_commands.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <raydix/error.h>
#include <raydix/machine.h>

namespace raydix::cli {
namespace {

void refuse_rdx(const std::string& scene) {
    if (is_rdx(scene)) throw CLI::ValidationError("--tree", "the tree in " + scene + " is a bvh");
}

void print_octree(const Octree& octree, const OctreeStats& stats) {
    fmt::print("\ntree         octree over {} {} ({} left out), {} nodes, {} leaves\n",
               grouped(stats.references),
               octree.kind() == PrimitiveKind::points ? "points" : "triangles",
               grouped(octree.left_out()), grouped(stats.nodes), grouped(stats.leaves));
    fmt::print("depth        {} (max_level {}), at most {} in a leaf\n", stats.max_depth,
               stats.max_level, grouped(stats.largest_leaf));
    fmt::print("levels       {}\n", fmt::join(stats.nodes_per_level, " "));
    const double each =
        stats.references ? static_cast<double>(stats.bytes) / static_cast<double>(stats.references)
                         : 0;
    fmt::print("memory       {:.2f} MB ({:.1f} bytes a point), peak while building {:.2f} MB\n",
               static_cast<double>(stats.bytes) / 1e6, each,
               static_cast<double>(octree.peak_bytes()) / 1e6);
    fmt::print("hash         {}\n", stats.tree_hash);
}

Octree build_about(const std::string& scene, const Mesh& mesh, const OctreeOptions& options) {
    return about(scene, [&] { return build_octree(mesh, options); });
}

}  // namespace

OctreeOptions octree_options(const TreeOptions& tree, const CommonOptions& common) {
    refuse_device_of_tree(tree);
    for (const CLI::Option* option : tree.of_a_bvh)
        if (option->count() != 0)
            throw CLI::ValidationError(option->get_name(),
                                       "belongs to --tree bvh; an octree has nothing like it");
    if (tree.max_level.value_or(0) > tree.bits / 3)
        throw CLI::ValidationError("--max-level", "with --bits " + std::to_string(tree.bits) +
                                                      " it is at most " +
                                                      std::to_string(tree.bits / 3));
    OctreeOptions options;
    options.bits = tree.bits;
    options.max_level = tree.max_level.value_or(-1);
    options.max_leaf = tree.max_leaf;
    options.strict = tree.strict;
    options.threads = common.threads;
    return options;
}

Json octree_json(const Octree& octree, const OctreeStats& stats,
                 const std::vector<BuildMs>& builds) {
    const OctreeOptions& options = octree.options();
    Json build{{"tree", "octree"},
               {"builder", "karras"},
               {"bits", options.bits},
               {"max_leaf", options.max_leaf},
               {"max_level", options.max_level},
               {"device", "cpu"},
               {"threads", options.threads > 0 ? options.threads : machine_info().cores},
               {"primitives", octree.input_count()},
               {"left_out", octree.left_out()},
               {"nodes", stats.nodes},
               {"leaves", stats.leaves},
               {"references", stats.references},
               {"layout", "levels"},
               {"layout_nodes", stats.nodes},
               {"max_depth", stats.max_depth},
               {"depth_bound", options.max_level},
               {"nodes_per_level", stats.nodes_per_level},
               {"largest_leaf", stats.largest_leaf},
               {"sah", nullptr},
               {"sah_constants", nullptr},
               {"epo", nullptr},
               {"bytes", stats.bytes},
               {"bytes_referenced", 0},
               {"peak_bytes", octree.peak_bytes()},
               {"tree_hash", stats.tree_hash}};
    add_build_ms(build, builds);
    return build;
}

void run_octree_build(const std::string& scene_name, const TreeOptions& tree,
                      const CommonOptions& common, int repeat) {
    refuse_rdx(scene_name);
    const OctreeOptions options = octree_options(tree, common);
    Json document = new_document("build");
    const Scene scene = load_scene_with_cameras(scene_name, tree, common);
    document["scene"] = scene_json(scene);
    document["load_ms"] = scene.load_ms;
    Octree octree = build_about(scene_name, scene.mesh, options);
    std::vector<BuildMs> builds;
    for (int i = 0; i < repeat; ++i) {
        octree = Octree();
        octree = build_octree(scene.mesh, options);
        builds.push_back(octree.build_ms());
    }
    const OctreeStats stats = octree_stats(octree);
    document["build"] = octree_json(octree, stats, builds);
    if (common.prints_tables()) {
        fmt::print("{}: {} triangles, {} vertices, loaded in {:.1f} ms\n", scene.name,
                   grouped(scene.mesh.triangles.size()), grouped(scene.mesh.vertices.size()),
                   scene.load_ms);
        print_stages(document["build"], builds.size());
        print_octree(octree, stats);
    }
    write_json(document, common);
}

void run_octree_check(const std::string& scene_name, const TreeOptions& tree,
                      const CommonOptions& common) {
    refuse_rdx(scene_name);
    const OctreeOptions options = octree_options(tree, common);
    Json document = new_document("check");
    const Scene scene = load_scene_with_cameras(scene_name, tree, common);
    const CheckReport report = check(build_about(scene_name, scene.mesh, options), scene.mesh);
    document["check"] = {{"ok", report.ok},
                         {"broken", report.ok ? Json(nullptr) : Json(report.broken)},
                         {"nodes", report.nodes},
                         {"primitives", report.primitives}};
    write_json(document, common);
    if (!report.ok) throw InputError(scene_name + ": " + report.broken);
    if (common.prints_tables())
        fmt::print("{}: every invariant holds, {} nodes, {} primitives\n", scene_name,
                   grouped(report.nodes), grouped(report.primitives));
}

}  // namespace raydix::cli
