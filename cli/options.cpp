// The shared options, and scenes and trees from what the user named.
#include "options.h"

#include <raydix/error.h>
#include <raydix/rdx.h>

#include <algorithm>
#include <charconv>

namespace raydix::cli {

void add_common_options(CLI::App& command, CommonOptions& options) {
    command
        .add_option("--json", options.json_file,
                    "Write one JSON document to FILE ('-': standard output)")
        ->type_name("FILE");
    command.add_option("--threads", options.threads, "Threads to use (0: all the machine has)")
        ->check(CLI::Range(0, 1024));
    command.add_flag("--quiet", options.quiet, "Print no tables and no progress");
    command.add_option("--seed", options.seed, "Seed of built-in scenes and sampling")
        ->capture_default_str();
}

void add_tree_options(CLI::App& command, TreeOptions& options) {
    const char* group = "Tree";
    command.add_option("--tree", options.tree, "Kind of tree")
        ->check(CLI::IsMember({"bvh"}))
        ->capture_default_str()
        ->group(group);
    options.builder_option = command.add_option("--builder", options.builder, "Builder")
                                 ->check(CLI::IsMember({"karras"}))
                                 ->capture_default_str()
                                 ->group(group);
    command.add_option("--quality", options.quality, "Picks a builder: fast")
        ->check(CLI::IsMember({"fast"}))
        ->excludes(options.builder_option)
        ->group(group);
    command.add_option("--bits", options.bits, "Bits of the Morton codes")
        ->check(CLI::IsMember({30, 63}))
        ->capture_default_str()
        ->group(group);
    command.add_option("--max-leaf", options.max_leaf, "Most primitives in a leaf")
        ->check(CLI::Range(1, 255))
        ->capture_default_str()
        ->group(group);
    command.add_option("--layout", options.layout, "Memory layout that is traced")
        ->check(CLI::IsMember({"binary"}))
        ->capture_default_str()
        ->group(group);
    command.add_option("--device", options.device, "Where to build and trace")
        ->check(CLI::IsMember({"cpu"}))
        ->capture_default_str()
        ->group(group);
    command
        .add_flag("--strict", options.strict,
                  "Invalid primitives are an error instead of being left out")
        ->group(group);
    command.add_option("--sah-node", options.sah.node, "SAH cost of an inner node")
        ->check(CLI::NonNegativeNumber)
        ->capture_default_str()
        ->group(group);
    command.add_option("--sah-primitive", options.sah.primitive, "SAH cost of a primitive")
        ->check(CLI::NonNegativeNumber)
        ->capture_default_str()
        ->group(group);
    command
        .add_option("--epo", options.epo_sample,
                    "Also compute end-point overlap, over this part of the triangles")
        ->expected(0, 1)
        ->default_str("1")
        ->check(CLI::Range(1e-9, 1.0))
        ->type_name("SAMPLE")
        ->group(group);
    command
        .add_option("--cameras", options.cameras_file,
                    "Cameras file instead of cameras.json beside the scene")
        ->type_name("FILE")
        ->group(group);
}

BuildOptions TreeOptions::build_options(const CommonOptions& common) const {
    BuildOptions result;
    result.builder = builder_from_name(builder);
    result.bits = bits;
    result.max_leaf = max_leaf;
    result.strict = strict;
    result.threads = common.threads;
    return result;
}

bool is_rdx(const std::string& scene) { return scene.ends_with(".rdx"); }

namespace {

void override_cameras(Scene& scene, const TreeOptions& tree) {
    if (!tree.cameras_file.empty()) scene.cameras = load_cameras(tree.cameras_file);
}

}  // namespace

Scene load_scene_with_cameras(const std::string& name, const TreeOptions& tree,
                              const CommonOptions& common) {
    Scene scene = is_rdx(name) ? load_rdx(name).scene : load_scene(name, common.seed);
    override_cameras(scene, tree);
    return scene;
}

SceneTree load_scene_tree(const std::string& name, const TreeOptions& tree,
                          const CommonOptions& common) {
    if (is_rdx(name)) {
        RdxFile file = load_rdx(name);
        override_cameras(file.scene, tree);
        return {std::move(file.scene), std::move(file.bvh)};
    }
    SceneTree result{load_scene_with_cameras(name, tree, common), {}};
    result.bvh = build_bvh(result.scene.mesh, tree.build_options(common));
    return result;
}

Size parse_size(const std::string& text) {
    Size size;
    const char* end = text.data() + text.size();
    const auto [x, width_error] = std::from_chars(text.data(), end, size.width);
    if (width_error == std::errc() && x != end && *x == 'x') {
        const auto [rest, height_error] = std::from_chars(x + 1, end, size.height);
        const auto fits = [](std::uint32_t n) { return n >= 1 && n <= 16384; };
        if (height_error == std::errc() && rest == end && fits(size.width) && fits(size.height))
            return size;
    }
    throw CLI::ValidationError("--size",
                               "'" + text + "' is not WIDTHxHEIGHT with 1 to 16384 pixels each");
}

}  // namespace raydix::cli
