// What `build` and `check` do with a k-d tree or an octree: one text for both. `Kind` tells what
// the two do not share:
//   Tree, Options               the tree and its options
//   build(mesh, options)        the library's call
//   check(tree, mesh)           its validation
//   figures(tree)               what tables and JSON hold of it
//   add(json, tree), print_more(tree)   what only this kind has
#pragma once

#include <fmt/format.h>
#include <raydix/check.h>
#include <raydix/device_trees.h>
#include <raydix/error.h>

#include <string>
#include <vector>

#include "device_scene.h"
#include "output.h"

namespace raydix::cli {

/// Figures that both kinds have.
struct TreeFigures {
    const char *tree, *layout;  // "kdtree", "binary"
    PrimitiveKind kind;
    int bits, max_leaf, threads;
    std::uint64_t input_count, left_out, nodes, leaves, references, layout_nodes, max_depth;
    Json depth_bound;
    std::uint64_t bytes, peak_bytes;
    std::string tree_hash;
};
/// The `build` object of a document without its times.
[[nodiscard]] Json tree_figures_json(const TreeFigures& figures);
void print_tree_head(const TreeFigures& figures);
void print_tree_tail(const TreeFigures& figures);

/// Usage errors: a .rdx file, which holds a BVH, and options that belong to one.
void refuse_rdx(const std::string& scene);
void refuse_bvh_options(const TreeOptions& tree);

/// Times of the repeats, and the tree of the last.
template <class Tree>
struct TreeBuilds {
    Tree tree;
    std::vector<BuildMs> ms;
    std::uint64_t device_bytes = 0;  // held on a device, tree included
};

/// One warm-up, then `repeat` builds into new memory.
template <class Kind>
TreeBuilds<typename Kind::Tree> build_repeatedly(const Mesh& mesh,
                                                 const typename Kind::Options& options,
                                                 const std::string& device, int repeat) {
    TreeBuilds<typename Kind::Tree> builds;
    if (runs_on_device(device)) {
        const DeviceInput input(mesh);
        auto memory = build_on_device(input, options, nullptr);
        for (int i = 0; i < repeat; ++i) {
            memory = {};
            BuildMs ms;
            memory = build_on_device(input, options, &ms);
            builds.ms.push_back(ms);
        }
        builds.tree = memory.download();
        builds.device_bytes = memory.bytes();
        return builds;
    }
    builds.tree = Kind::build(mesh, options);
    for (int i = 0; i < repeat; ++i) {
        builds.tree = {};
        builds.tree = Kind::build(mesh, options);
        builds.ms.push_back(builds.tree.build_ms());
    }
    return builds;
}

template <class Kind>
Json tree_build_json(const typename Kind::Tree& tree, const std::vector<BuildMs>& builds) {
    Json build = tree_figures_json(Kind::figures(tree));
    Kind::add(build, tree);
    add_build_ms(build, builds);
    return build;
}

template <class Kind>
void run_tree_build(const std::string& scene_name, const TreeOptions& tree_options,
                    const typename Kind::Options& options, const CommonOptions& common,
                    int repeat) {
    Json document = new_document("build");
    const Model scene = load_model_with_cameras(scene_name, tree_options, common);
    document["scene"] = scene_json(scene);
    document["load_ms"] = scene.load_ms;
    const auto builds = about(scene_name, [&] {
        return build_repeatedly<Kind>(scene.mesh(), options, tree_options.device, repeat);
    });
    Json build = tree_build_json<Kind>(builds.tree, builds.ms);
    build["repeat"] = repeat;
    build["device"] = tree_options.device;
    TreeFigures figures = Kind::figures(builds.tree);
    if (is_device(tree_options.device))
        build["peak_bytes"] = figures.peak_bytes = builds.device_bytes;
    document["scene"]["left_out"] = figures.left_out;
    document["build"] = build;
    if (common.prints_tables()) {
        fmt::print("{}: {} triangles, {} vertices, loaded in {:.1f} ms\n", scene.name,
                   grouped(scene.mesh().triangles.size()), grouped(scene.mesh().vertices.size()),
                   scene.load_ms);
        print_stages(document["build"], builds.ms.size());
        print_tree_head(figures);
        Kind::print_more(builds.tree);
        print_tree_tail(figures);
    }
    write_json(document, common);
}

template <class Kind>
void run_tree_check(const std::string& scene_name, const TreeOptions& tree_options,
                    const typename Kind::Options& options, const CommonOptions& common) {
    Json document = new_document("check");
    const Model scene = load_model_with_cameras(scene_name, tree_options, common);
    const CheckReport report = about(scene_name, [&] {
        return Kind::check(
            build_repeatedly<Kind>(scene.mesh(), options, tree_options.device, 0).tree,
            scene.mesh());
    });
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
