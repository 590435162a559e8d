// What commands do with --tree kdtree.
#pragma once

#include <raydix/kdtree.h>

#include <optional>
#include <vector>

#include "output.h"

namespace raydix::cli {

/// Options of the library from those of the command. max_leaf is the k-d tree's own default unless
/// given. Options that belong to a BVH are a usage error, never ignored.
[[nodiscard]] KdTreeOptions kdtree_options(const TreeOptions& tree, const CommonOptions& common);

/// k-d trees are built and checked; .rdx files are for a BVH.
void run_kdtree_build(const std::string& scene, const TreeOptions& tree,
                      const CommonOptions& common, int repeat);
void run_kdtree_check(const std::string& scene, const TreeOptions& tree,
                      const CommonOptions& common);

/// What `trace` works on: a scene with a BVH, from which secondary rays start, and with --tree
/// kdtree the tree that is traced in its place.
struct KdTraced {
    SceneTree input;
    std::optional<KdTree> kdtree;
};
[[nodiscard]] KdTraced load_kdtree_traced(const std::string& scene, const TreeOptions& tree,
                                          const CommonOptions& common);
void explain_kdtree(const KdTree& kdtree, const CommonOptions& common);

/// The `build` object of a document; `builds` are the times of each repeat, at least one.
[[nodiscard]] Json kdtree_json(const KdTree& tree, const std::vector<BuildMs>& builds);

}  // namespace raydix::cli
