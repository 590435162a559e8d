// raydix render --view tree and --view slice: pictures of a tree.
#pragma once

#include <raydix/picture.h>
#include <raydix/tree_view.h>

#include <optional>

#include "output.h"

namespace raydix::cli {

struct TreeViewOptions {
    std::string levels, axis = "z";
    float at = 0.5f;
    std::vector<const CLI::Option*> given;  // that only these views have
};
void add_tree_view_options(CLI::App& command, TreeViewOptions& options);

[[nodiscard]] bool is_tree_view(const std::string& view);

/// Other views draw what rays see: options of a tree's picture are a usage error there.
void refuse_tree_view_options(const TreeViewOptions& options);

/// A scene, the BVH that shows it, and the boxes of the tree that was asked for.
struct TreeScene {
    SceneTree input;
    std::vector<LevelBox> boxes;
};
[[nodiscard]] TreeScene load_tree_scene(const std::string& scene, const std::string& view,
                                        const TreeViewOptions& options, const TreeOptions& tree,
                                        const CommonOptions& common);

[[nodiscard]] Picture draw_slice(const TreeScene& scene, const TreeViewOptions& options, Size size);
void print_levels(const TreeScene& scene);

}  // namespace raydix::cli
