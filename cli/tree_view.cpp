#include "tree_view.h"

#include <fmt/format.h>
#include <raydix/error.h>

#include <algorithm>
#include <charconv>

#include "kdtree_commands.h"
#include "octree_commands.h"

namespace raydix::cli {
namespace {

/// Levels of wire frames unless given: more hide each other.
constexpr LevelRange few_levels{0, 7};

/// "A-B" or "A".
LevelRange parse_levels(const std::string& text) {
    LevelRange levels;
    const char* end = text.data() + text.size();
    const auto [first_end, error] = std::from_chars(text.data(), end, levels.first);
    if (error == std::errc()) {
        if (first_end == end) return {levels.first, levels.first};
        const auto [rest, last_error] = std::from_chars(first_end + 1, end, levels.last);
        if (*first_end == '-' && last_error == std::errc() && rest == end &&
            levels.first <= levels.last)
            return levels;
    }
    throw CLI::ValidationError("--levels", "'" + text + "' is neither a level nor FIRST-LAST");
}

/// An octree, and a BVH of the same scene to show it with.
TreeScene load_octree_scene(const std::string& name, LevelRange levels, const TreeOptions& tree,
                            const CommonOptions& common) {
    if (is_rdx(name)) throw CLI::ValidationError("--tree", "the tree in " + name + " is a bvh");
    const OctreeOptions options = octree_options(tree, common);
    TreeOptions shown = tree;
    shown.tree = "bvh";
    shown.max_leaf = BuildOptions().max_leaf;
    shown.max_level.reset();
    TreeScene scene{load_scene_tree(name, shown, common), {}};
    const Octree octree =
        about(name, [&] { return build_octree(scene.input.scene.mesh(), options); });
    scene.boxes = level_boxes(octree, levels);
    return scene;
}

}  // namespace

void add_tree_view_options(CLI::App& command, TreeViewOptions& options) {
    const char* group = "Views tree and slice";
    options.given.push_back(
        command
            .add_option("--levels", options.levels,
                        "Levels to draw: FIRST-LAST or one (default: 0-7 for tree, all for slice)")
            ->check([](const std::string& text) {
                return text.empty() ? "'' is neither a level nor FIRST-LAST" : "";
            })
            ->type_name("RANGE")
            ->group(group));
    options.given.push_back(
        command.add_option("--axis", options.axis, "Axis that a slice is perpendicular to")
            ->check(CLI::IsMember({"x", "y", "z"}))
            ->capture_default_str()
            ->group(group));
    options.given.push_back(
        command
            .add_option("--at", options.at,
                        "Where a slice cuts the scene's box: 0 at its lower end, 1 at its upper")
            ->check(number_up_to(1, true))
            ->capture_default_str()
            ->group(group));
}

bool is_tree_view(const std::string& view) { return view == "tree" || view == "slice"; }

void refuse_tree_view_options(const TreeViewOptions& options) {
    for (const CLI::Option* option : options.given)
        if (option->count() != 0)
            throw CLI::ValidationError(option->get_name(), "belongs to --view tree and slice");
}

TreeScene load_tree_scene(const std::string& name, const std::string& view,
                          const TreeViewOptions& options, const TreeOptions& tree,
                          const CommonOptions& common) {
    if (view == "tree" && (options.given[1]->count() != 0 || options.given[2]->count() != 0))
        throw CLI::ValidationError("--axis, --at", "belong to --view slice");
    const LevelRange levels = !options.levels.empty() ? parse_levels(options.levels)
                              : view == "tree"        ? few_levels
                                                      : LevelRange{};
    if (tree.tree == "octree") return load_octree_scene(name, levels, tree, common);
    if (tree.tree != "kdtree") {
        TreeScene scene{load_scene_tree(name, tree, common), {}};
        scene.boxes = level_boxes(scene.input.bvh, levels);
        return scene;
    }
    KdTraced traced = load_kdtree_traced(name, tree, common);
    return {std::move(traced.input), level_boxes(*traced.kdtree, levels)};
}

Picture draw_slice(const TreeScene& scene, const TreeViewOptions& options, Size size) {
    SliceOptions slice;
    slice.axis = static_cast<std::uint32_t>(options.axis[0] - 'x');
    slice.at = options.at;
    slice.width = size.width;
    slice.height = size.height;
    return render_slice(scene.input.bvh, scene.boxes, slice);
}

void print_levels(const TreeScene& scene) {
    if (scene.boxes.empty()) return fmt::print("no boxes on these levels\n");
    const auto [first, last] =
        std::minmax_element(scene.boxes.begin(), scene.boxes.end(),
                            [](const LevelBox& a, const LevelBox& b) { return a.level < b.level; });
    fmt::print("{} boxes, levels {} to {}\n", grouped(scene.boxes.size()), first->level,
               last->level);
}

}  // namespace raydix::cli
