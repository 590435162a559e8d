// What commands do with --tree octree.
#pragma once

#include <raydix/octree.h>

#include <string>

#include "output.h"

namespace raydix::cli {

/// Options of the library from those of the command. Options that belong to a BVH are a usage
/// error, never ignored.
[[nodiscard]] OctreeOptions octree_options(const TreeOptions& tree, const CommonOptions& common);

/// Octrees are built and checked; .rdx files and rays are for a BVH.
void run_octree_build(const std::string& scene, const TreeOptions& tree,
                      const CommonOptions& common, int repeat);
void run_octree_check(const std::string& scene, const TreeOptions& tree,
                      const CommonOptions& common);

}  // namespace raydix::cli
