#include "kdtree_commands.h"

#include <fmt/format.h>
#include <raydix/error.h>
#include <raydix/machine.h>

namespace raydix::cli {
namespace {

bool is_given(const TreeOptions& tree, const std::string& name) {
    for (const CLI::Option* option : tree.of_the_build)
        if (option->get_name() == name) return option->count() != 0;
    return false;
}

void refuse_rdx(const std::string& scene) {
    if (is_rdx(scene)) throw CLI::ValidationError("--tree", "the tree in " + scene + " is a bvh");
}

void print_tree(const KdTree& tree) {
    const TreeStats stats = kd_stats(tree);
    fmt::print("\ntree         kdtree over {} {} ({} left out), {} nodes, {} leaves\n",
               grouped(stats.references),
               tree.kind() == PrimitiveKind::points ? "points" : "triangles",
               grouped(tree.left_out()), grouped(stats.nodes), grouped(stats.leaves));
    fmt::print("depth        {} (proven bound {})\n", stats.max_depth,
               stats.depth_bound ? std::to_string(*stats.depth_bound) : "none");
    const double each =
        stats.references ? static_cast<double>(stats.bytes) / static_cast<double>(stats.references)
                         : 0;
    fmt::print("memory       {:.2f} MB ({:.1f} bytes a primitive), peak while building {:.2f} MB\n",
               static_cast<double>(stats.bytes) / 1e6, each,
               static_cast<double>(tree.peak_bytes()) / 1e6);
    fmt::print("hash         {}\n", stats.tree_hash);
}

KdTree build_about(const std::string& scene, const Mesh& mesh, const KdTreeOptions& options) {
    return about(scene, [&] { return build_kdtree(mesh, options); });
}

}  // namespace

KdTreeOptions kdtree_options(const TreeOptions& tree, const CommonOptions& common) {
    refuse_device_of_tree(tree);
    for (const CLI::Option* option : tree.of_a_bvh)
        if (option->count() != 0)
            throw CLI::ValidationError(option->get_name(),
                                       "belongs to --tree bvh; a kdtree has nothing like it");
    if (tree.max_level) throw CLI::ValidationError("--max-level", "belongs to --tree octree");
    KdTreeOptions options;
    options.bits = tree.bits;
    if (is_given(tree, "--max-leaf")) options.max_leaf = tree.max_leaf;
    options.strict = tree.strict;
    options.threads = common.threads;
    return options;
}

Json kdtree_json(const KdTree& tree, const std::vector<BuildMs>& builds) {
    const TreeStats stats = kd_stats(tree);
    const KdTreeOptions& options = tree.options();
    const auto or_null = [](const auto& value) { return value ? Json(*value) : Json(nullptr); };
    Json build{{"tree", "kdtree"},
               {"builder", "karras"},
               {"bits", options.bits},
               {"max_leaf", options.max_leaf},
               {"device", "cpu"},
               {"threads", options.threads > 0 ? options.threads : machine_info().cores},
               {"primitives", tree.input_count()},
               {"left_out", tree.left_out()},
               {"nodes", stats.nodes},
               {"leaves", stats.leaves},
               {"references", stats.references},
               {"layout", "binary"},
               {"layout_nodes", stats.layout_nodes},
               {"max_depth", stats.max_depth},
               {"depth_bound", or_null(stats.depth_bound)},
               {"sah", or_null(stats.sah)},
               {"sah_constants", nullptr},
               {"epo", or_null(stats.epo)},
               {"bytes", stats.bytes},
               {"bytes_referenced", stats.bytes_referenced},
               {"peak_bytes", tree.peak_bytes()},
               {"tree_hash", stats.tree_hash}};
    add_build_ms(build, builds);
    return build;
}

void run_kdtree_build(const std::string& scene_name, const TreeOptions& tree_options,
                      const CommonOptions& common, const KdBuildCommand& command) {
    refuse_rdx(scene_name);
    if (command.wants_file)
        throw CLI::ValidationError("--output", ".rdx files hold a bvh; a kdtree cannot be saved");
    const KdTreeOptions options = kdtree_options(tree_options, common);
    Json document = new_document("build");
    const Scene scene = load_scene_with_cameras(scene_name, tree_options, common);
    document["scene"] = scene_json(scene);
    document["load_ms"] = scene.load_ms;
    KdTree tree = build_about(scene_name, scene.mesh, options);
    std::vector<BuildMs> builds;
    for (int i = 0; i < command.repeat; ++i) {
        tree = KdTree();
        tree = build_kdtree(scene.mesh, options);
        builds.push_back(tree.build_ms());
    }
    document["build"] = kdtree_json(tree, builds);
    if (common.prints_tables()) {
        fmt::print("{}: {} triangles, {} vertices, loaded in {:.1f} ms\n", scene.name,
                   grouped(scene.mesh.triangles.size()), grouped(scene.mesh.vertices.size()),
                   scene.load_ms);
        print_stages(document["build"], builds.size());
        print_tree(tree);
    }
    write_json(document, common);
}

void run_kdtree_check(const std::string& scene_name, const TreeOptions& tree_options,
                      const CommonOptions& common) {
    refuse_rdx(scene_name);
    const KdTreeOptions options = kdtree_options(tree_options, common);
    Json document = new_document("check");
    const Scene scene = load_scene_with_cameras(scene_name, tree_options, common);
    const CheckReport report =
        kd_check(build_about(scene_name, scene.mesh, options), MeshView(scene.mesh));
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

KdTraced load_kdtree_traced(const std::string& scene_name, const TreeOptions& tree,
                            const CommonOptions& common) {
    if (tree.tree != "kdtree") return {load_scene_tree(scene_name, tree, common), {}};
    refuse_rdx(scene_name);
    const KdTreeOptions options = kdtree_options(tree, common);
    KdTraced traced;
    traced.input.scene = load_scene_with_cameras(scene_name, tree, common);
    const Mesh& mesh = traced.input.scene.mesh;
    traced.kdtree = build_about(scene_name, mesh, options);
    traced.input.bvh = build_bvh(mesh, {.strict = tree.strict, .threads = common.threads});
    return traced;
}

void explain_kdtree(const KdTree& kdtree, const CommonOptions& common) {
    if (!common.prints_tables()) return;
    fmt::print(
        "kernel scalar: k-d tree of 16-byte nodes, stack of {} entries, x86-64-v2 code without "
        "vector paths, 1024 rays a block\n",
        kdtree.max_depth());
}

}  // namespace raydix::cli
