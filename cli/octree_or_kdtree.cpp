#include "octree_or_kdtree.h"

namespace raydix::cli {

Json tree_figures_json(const TreeFigures& f) {
    return {{"tree", f.tree},
            {"builder", "karras"},
            {"bits", f.bits},
            {"max_leaf", f.max_leaf},
            {"device", "cpu"},
            {"threads", threads_at_work(f.threads)},
            {"primitives", f.input_count},
            {"left_out", f.left_out},
            {"nodes", f.nodes},
            {"leaves", f.leaves},
            {"references", f.references},
            {"layout", f.layout},
            {"layout_nodes", f.layout_nodes},
            {"max_depth", f.max_depth},
            {"depth_bound", f.depth_bound},
            {"sah", nullptr},
            {"sah_constants", nullptr},
            {"epo", nullptr},
            {"bytes", f.bytes},
            {"bytes_referenced", 0},
            {"peak_bytes", f.peak_bytes},
            {"tree_hash", f.tree_hash}};
}

void print_tree_head(const TreeFigures& f) {
    fmt::print("\ntree         {} over {} {} ({} left out), {} nodes, {} leaves\n", f.tree,
               grouped(f.references), f.kind == PrimitiveKind::points ? "points" : "triangles",
               grouped(f.left_out), grouped(f.nodes), grouped(f.leaves));
}

void print_tree_tail(const TreeFigures& f) {
    const double each =
        f.references ? static_cast<double>(f.bytes) / static_cast<double>(f.references) : 0;
    fmt::print("memory       {:.2f} MB ({:.1f} bytes a {}), peak while building {:.2f} MB\n",
               static_cast<double>(f.bytes) / 1e6, each,
               f.kind == PrimitiveKind::points ? "point" : "triangle",
               static_cast<double>(f.peak_bytes) / 1e6);
    fmt::print("hash         {}\n", f.tree_hash);
}

void refuse_rdx(const std::string& scene) {
    if (is_rdx(scene)) throw CLI::ValidationError("--tree", "the tree in " + scene + " is a bvh");
}

void refuse_bvh_options(const TreeOptions& tree) {
    for (const CLI::Option* option : tree.of_a_bvh)
        if (option->count() != 0)
            throw CLI::ValidationError(option->get_name(),
                                       "belongs to --tree bvh; --tree " + tree.tree + " has none");
}

}  // namespace raydix::cli
