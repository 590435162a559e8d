#include "kdtree_commands.h"

#include "octree_or_kdtree.h"

namespace raydix::cli {
namespace {

bool is_given(const TreeOptions& tree, const std::string& name) {
    for (const CLI::Option* option : tree.of_the_build)
        if (option->get_name() == name) return option->count() != 0;
    return false;
}

struct KdKind {
    using Tree = KdTree;
    using Options = KdTreeOptions;

    static KdTree build(const Mesh& mesh, const Options& options) {
        return build_kdtree(mesh, options);
    }
    static CheckReport check(const KdTree& tree, const Mesh& mesh) { return kd_check(tree, mesh); }
    static TreeFigures figures(const KdTree& tree) {
        const TreeStats stats = kd_stats(tree);
        const KdTreeOptions& options = tree.options();
        return {"kdtree",           "binary",
                tree.kind(),        options.bits,
                options.max_leaf,   options.threads,
                tree.input_count(), tree.left_out(),
                stats.nodes,        stats.leaves,
                stats.references,   stats.layout_nodes,
                stats.max_depth,    stats.depth_bound ? Json(*stats.depth_bound) : Json(nullptr),
                stats.bytes,        tree.peak_bytes(),
                stats.tree_hash};
    }
    static void add(Json&, const KdTree&) {}
    static void print_more(const KdTree& tree) {
        const TreeStats stats = kd_stats(tree);
        fmt::print("depth        {} (proven bound {})\n", stats.max_depth,
                   stats.depth_bound ? std::to_string(*stats.depth_bound) : "none");
    }
};

}  // namespace

KdTreeOptions kdtree_options(const TreeOptions& tree, const CommonOptions& common) {
    refuse_bvh_options(tree);
    if (tree.max_level) throw CLI::ValidationError("--max-level", "belongs to --tree octree");
    KdTreeOptions options;
    options.bits = tree.bits;
    if (is_given(tree, "--max-leaf")) options.max_leaf = tree.max_leaf;
    options.strict = tree.strict;
    options.threads = common.threads;
    return options;
}

Json kdtree_json(const KdTree& tree, const std::vector<BuildMs>& builds) {
    return tree_build_json<KdKind>(tree, builds);
}

void run_kdtree_build(const std::string& scene, const TreeOptions& tree,
                      const CommonOptions& common, int repeat) {
    refuse_rdx(scene);
    run_tree_build<KdKind>(scene, tree, kdtree_options(tree, common), common, repeat);
}

void run_kdtree_check(const std::string& scene, const TreeOptions& tree,
                      const CommonOptions& common) {
    refuse_rdx(scene);
    run_tree_check<KdKind>(scene, tree, kdtree_options(tree, common), common);
}

KdTraced load_kdtree_traced(const std::string& scene_name, const TreeOptions& tree,
                            const CommonOptions& common) {
    if (tree.tree != "kdtree") return {load_scene_tree(scene_name, tree, common), {}};
    refuse_rdx(scene_name);
    const KdTreeOptions options = kdtree_options(tree, common);
    KdTraced traced;
    traced.input.scene = load_model_with_cameras(scene_name, tree, common);
    const Mesh& mesh = traced.input.scene.mesh();
    traced.kdtree = about(scene_name, [&] { return build_kdtree(mesh, options); });
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
