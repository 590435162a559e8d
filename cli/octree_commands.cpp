#include "octree_commands.h"

#include <fmt/ranges.h>

#include "octree_or_kdtree.h"

namespace raydix::cli {
namespace {

struct OctreeKind {
    using Tree = Octree;
    using Options = OctreeOptions;

    static Octree build(const Mesh& mesh, const Options& options) {
        return build_octree(mesh, options);
    }
    static CheckReport check(const Octree& octree, const Mesh& mesh) {
        return raydix::check(octree, mesh);
    }
    static TreeFigures figures(const Octree& octree) {
        const OctreeStats stats = octree_stats(octree);
        const OctreeOptions& options = octree.options();
        return {"octree",         "levels",          octree.kind(),        options.bits,
                options.max_leaf, options.threads,   octree.input_count(), octree.left_out(),
                stats.nodes,      stats.leaves,      stats.references,     stats.nodes,
                stats.max_depth,  options.max_level, stats.bytes,          octree.peak_bytes(),
                stats.tree_hash};
    }
    static void add(Json& build, const Octree& octree) {
        const OctreeStats stats = octree_stats(octree);
        build["max_level"] = octree.options().max_level;
        build["nodes_per_level"] = stats.nodes_per_level;
        build["largest_leaf"] = stats.largest_leaf;
    }
    static void print_more(const Octree& octree) {
        const OctreeStats stats = octree_stats(octree);
        fmt::print("depth        {} (max_level {}), at most {} in a leaf\n", stats.max_depth,
                   stats.max_level, grouped(stats.largest_leaf));
        fmt::print("levels       {}\n", fmt::join(stats.nodes_per_level, " "));
    }
};

}  // namespace

OctreeOptions octree_options(const TreeOptions& tree, const CommonOptions& common) {
    refuse_bvh_options(tree);
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

void run_octree_build(const std::string& scene, const TreeOptions& tree,
                      const CommonOptions& common, int repeat) {
    refuse_rdx(scene);
    run_tree_build<OctreeKind>(scene, tree, octree_options(tree, common), common, repeat);
}

void run_octree_check(const std::string& scene, const TreeOptions& tree,
                      const CommonOptions& common) {
    refuse_rdx(scene);
    run_tree_check<OctreeKind>(scene, tree, octree_options(tree, common), common);
}

}  // namespace raydix::cli
