// Layouts that `build` makes of a tree: how long they take, the tree included, and their figures.
#pragma once

#include <optional>
#include <vector>

#include "options.h"
#include "output.h"

namespace raydix::cli {

/// The median, the least and the greatest total.
[[nodiscard]] Spread totals(const std::vector<BuildMs>& builds);

/// Builds from a mesh to a tree: into new memory and, if they were timed, into kept memory.
struct TimedBuilds {
    std::vector<BuildMs> fresh, kept;
    std::optional<std::uint64_t> peak_bytes = {};
};

/// A layout that is made from a finished tree counts as a part of the stage `layout`.
[[nodiscard]] BuildMs with_layout(BuildMs of_tree, double layout_ms);
/// Of a tree that stays while a layout is made of it, which takes `layout_bytes` more.
[[nodiscard]] std::uint64_t peak_with_layout(const Bvh& bvh, std::uint64_t layout_bytes);

/// Times and bytes of a `build` object, which are those of the binary tree so far, also stand in
/// its `binary`.
void keep_binary(Json& build);
/// `ms`, `ms_spread`, `kept_ms` and `peak_bytes` become those of the layout.
void set_layout_builds(Json& build, const TimedBuilds& builds);

/// What `build` needs to make the layout once more; `of_tree`: builds of the binary tree alone.
struct LayoutRequest {
    const Bvh& bvh;
    const Mesh& mesh;
    const BuildOptions& options;
    const TimedBuilds& of_tree;
    const std::string& layout;
    bool on_device;  // made there, the layout here
};

/// The compressed wide tree that follows from the binary one; what a trace touches is then its.
[[nodiscard]] TimedBuilds add_cwbvh(Json& build, const LayoutRequest& request);
/// The wide tree. On the CPU it is built from the mesh, without the binary tree where that is
/// possible, else from the binary tree.
[[nodiscard]] TimedBuilds add_wide_builds(Json& build, const LayoutRequest& request);
void print_cwbvh_table(const Json& cwbvh);

}  // namespace raydix::cli
