// The shared options, and scenes and trees from what the user named.
#include "options.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>

#include "device_scene.h"
#include "option_checks.h"
#include "output.h"
#include "program.h"
#include "wide_trace.h"

namespace raydix::cli {
namespace {

constexpr const char* tree_group = "Tree";

/// "" or why --device may not be this.
std::string device_fault(std::string& device) {
    for (const char* word : {"cpu", "cuda", "sim", "opencl", "hip"})
        if (device == word) return {};
    for (const std::string_view numbered : {"opencl:", "hip:"}) {
        const bool number =
            device.size() > numbered.size() && device.size() < numbered.size() + 5 &&
            device.find_first_not_of("0123456789", numbered.size()) == std::string::npos;
        if (device.starts_with(numbered) && number) return {};
    }
    return "'" + device + "' is not cpu, cuda, opencl, opencl:N, hip, hip:N or sim";
}

}  // namespace

void add_result_limit(CLI::App& command, std::uint64_t& max_result_bytes) {
    command
        .add_option("--max-result-bytes", max_result_bytes,
                    "Memory that a result of any length may take, with all it needs on the way "
                    "(0: half of what is left); more is an error")
        ->transform(whole_number(0))
        ->type_name("BYTES");
}

void add_common_options(CLI::App& command, CommonOptions& options) {
    command
        .add_option("--json", options.json_file,
                    "Write one JSON document to FILE ('-': standard output)")
        ->check(file_name())
        ->type_name("FILE");
    command
        .add_option("--threads", options.threads,
                    "Threads to use, 0 to 1024 (0, or more than the machine has: all it has)")
        ->transform(whole_number(0, 1024));
    command.add_flag("--quiet", options.quiet, "Print no tables and no progress");
    command.add_option("--seed", options.seed, "Seed of built-in scenes and sampling")
        ->transform(whole_number(0))
        ->capture_default_str();
}

void add_flatten_option(CLI::App& command, CommonOptions& options) {
    command.add_flag("--flatten", options.flatten,
                     "Make one mesh of the scene's meshes and nodes: prim counts through");
}

void add_tree_options(CLI::App& command, TreeOptions& options) {
    const auto of_the_build = [&](CLI::Option* option) {
        options.of_the_build.push_back(option);
        return option->group(tree_group);
    };
    command.add_option("--tree", options.tree, "Kind of tree")
        ->check(CLI::IsMember({"bvh", "octree", "kdtree"}))
        ->capture_default_str()
        ->group(tree_group);
    CLI::Option* builder =
        of_the_build(command.add_option("--builder", options.builder,
                                        "Builder (default: that of --quality; on a GPU karras)"))
            ->check(CLI::IsMember({"karras", "lauterbach", "garanzha", "apetrei", "ploc", "hploc",
                                   "binned", "sweep", "split", "sbvh"}));
    of_the_build(
        command.add_option("--quality", options.quality,
                           "Picks a builder and its rounds of reinsertion: fast is apetrei, "
                           "balanced is ploc and 2, high is sbvh and 4 (default: balanced)"))
        ->check(CLI::IsMember({"fast", "balanced", "high"}))
        ->excludes(builder);
    of_the_build(command.add_option("--bits", options.bits, "Bits of the Morton codes"))
        ->transform(whole_number(30, 63).description(""))
        ->check(CLI::IsMember({30, 63}))
        ->capture_default_str();
    of_the_build(command.add_option("--max-leaf", options.max_leaf, "Most primitives in a leaf"))
        ->transform(whole_number(1, 255))
        ->capture_default_str();
    of_the_build(command.add_option("--reinsertion-rounds", options.reinsertion_rounds,
                                    "Rounds of reinsertion after the build, 0 to 255. Each round "
                                    "moves large subtrees to cheaper places and stops early when "
                                    "none moves (default: none, or those of --quality)"))
        ->transform(whole_number(0, 255))
        ->type_name("ROUNDS");
    of_the_build(command.add_option("--max-level", options.max_level,
                                    "Octree: the level that is not divided any more, 0 to 21 (10 "
                                    "with 30 bits; default: the highest)"))
        ->transform(whole_number(0, 21))
        ->type_name("LEVEL");
    options.layout_option =
        command
            .add_option(
                "--layout", options.layout,
                "Memory layout that is traced: binary, or of the engine wide8, wide4 or compact, "
                "which is wide8 with shared vertices; cwbvh: build only (default: binary, of the "
                "engine wide8)")
            ->check(CLI::IsMember({"binary", "wide4", "wide8", "compact", "cwbvh"}))
            ->group(tree_group);
    command
        .add_option(
            "--device", options.device,
            "Where to build (cpu, cuda, opencl, opencl:N, hip or hip:N) and trace (these and sim)")
        ->check(CLI::Validator(device_fault, "cpu|cuda|opencl[:N]|hip[:N]|sim"))
        ->capture_default_str()
        ->group(tree_group);
    of_the_build(
        command.add_option("--fit", options.fit, "Boxes: level by level, or bottom-up in one pass"))
        ->check(CLI::IsMember({"levels", "atomic"}));
    of_the_build(command.add_flag("--strict", options.strict,
                                  "Invalid primitives are an error instead of being left out"));
    command
        .add_option("--cameras", options.cameras_file,
                    "Cameras file instead of cameras.json beside the scene")
        ->check(file_name())
        ->type_name("FILE")
        ->group(tree_group);
    for (const char* name : {"--builder", "--quality", "--reinsertion-rounds", "--fit"})
        options.of_a_bvh.push_back(command.get_option(name));
}

namespace {

/// What the help says of an option, and the values that it names.
void offer(CLI::App& command, const char* name, const char* what, const std::string& values) {
    CLI::Option* option = command.get_option(name);
    option->description(what);
    option->get_validator(0)->description(values);
}

}  // namespace

void offer_binary_layout(CLI::App& command) {
    offer(command, "--layout", "Memory layout that is traced (default: binary)", "{binary}");
    offer(command, "--device", "Where to build and trace", "{cpu}");
}

void offer_builders(CLI::App& command) {
    offer(command, "--device", "Where to build", "cpu|cuda|opencl[:N]|hip[:N]");
}

void offer_builds(CLI::App& command) {
    offer(command, "--layout", "Memory layout (default: binary)", "{binary}");
    offer_builders(command);
}

void offer_binary_tree(CLI::App& command, TreeOptions& options, const std::string& devices) {
    offer_binary_layout(command);
    offer(command, "--tree", "Kind of tree", "{bvh}");
    if (!devices.empty())
        offer(command, "--device", "Where rays are also traced and timed (cpu: nowhere)", devices);
    CLI::Option* of_octrees = command.get_option("--max-level");
    std::erase(options.of_the_build, of_octrees);
    command.remove_option(of_octrees);
}

void add_tree_figure_options(CLI::App& command, TreeOptions& options) {
    command.add_option("--sah-node", options.sah.node, "SAH cost of an inner node")
        ->check(finite_number(true))
        ->capture_default_str()
        ->group(tree_group);
    command.add_option("--sah-primitive", options.sah.primitive, "SAH cost of a primitive")
        ->check(finite_number(true))
        ->capture_default_str()
        ->group(tree_group);
    command
        .add_option("--epo", options.epo_sample,
                    "Also compute end-point overlap, over this part of the triangles")
        ->expected(0, 1)
        ->default_str("1")
        ->check(number_up_to(1, false))
        ->type_name("SAMPLE")
        ->group(tree_group);
    for (const char* name : {"--sah-node", "--sah-primitive", "--epo"})
        options.of_a_bvh.push_back(command.get_option(name));
}

namespace {

/// Builder and rounds of reinsertion, as far as the user named them.
BuildOptions build_as_named(const TreeOptions& tree) {
    if (tree.quality == "fast") return build_options_for(Quality::fast);
    if (tree.quality == "high") return build_options_for(Quality::high);
    if (tree.quality.empty() && !tree.builder.empty())
        return {.builder = builder_from_name(tree.builder)};
    const bool on_gpu = tree.quality.empty() && tree.device != "cpu";
    return on_gpu ? BuildOptions{} : build_options_for(Quality::balanced);
}

}  // namespace

BuildOptions TreeOptions::build_options(const CommonOptions& common) const {
    refuse_simulator(*this);
    if (max_level) throw CLI::ValidationError("--max-level", "belongs to --tree octree");
    BuildOptions result = build_as_named(*this);
    if (reinsertion_rounds) result.reinsertion_rounds = *reinsertion_rounds;
    if (!fit.empty()) result.fit = fit == "levels" ? Fit::levels : Fit::atomic;
    result.bits = bits;
    result.max_leaf = max_leaf;
    result.strict = strict;
    result.threads = common.threads;
    return result;
}

BuildOptions TreeOptions::build_options(const MeshView& mesh, const CommonOptions& common) const {
    const BuildOptions named = build_options(common);
    const bool of_quality = quality.empty() ? builder.empty() : quality != "fast";
    if (!of_quality || device != "cpu" || reinsertion_rounds) return named;
    const Quality asked = quality == "high" ? Quality::high : Quality::balanced;
    return is_wide_layout(layout)
               ? best_wide_build_options(mesh, asked, named, wide_options(layout, common.threads))
               : best_build_options(mesh, asked, named);
}

void flatten(Model& scene, const CommonOptions& common) {
    if (scene.is_flat()) return;
    if (!common.flatten && common.prints_tables())
        fmt::print("{}: its {} and {} are taken as one mesh (--flatten)\n", scene.name,
                   counted(scene.meshes.size(), "mesh", "meshes"),
                   counted(scene.nodes.size(), "node", "nodes"));
    common.flattened = true;
    const auto start = std::chrono::steady_clock::now();
    scene.flatten();
    scene.load_ms +=
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

void say_flattened(const std::string& scene, const CommonOptions& common) {
    if (common.flattened && common.quiet && !common.flatten)
        complain(scene + ": its meshes and nodes are taken as one mesh (--flatten)");
}

bool is_rdx(const std::string& scene) {
    return CLI::detail::to_lower(scene).ends_with(".rdx") || is_rdx_file(scene);
}

bool is_scene_file(const std::string& scene) { return is_rdx(scene) && holds_scene(scene); }

void require_different_names(const std::vector<std::string>& scenes) {
    std::map<std::string, std::string> first_of;  // by name
    for (const std::string& scene : scenes) {
        std::string name = scene;
        if (scenes.size() > 1 && is_rdx(scene))
            name = load_tree_file(scene).scene.name;
        else if (!scene.starts_with("builtin:"))
            name = std::filesystem::path(scene).filename();
        const auto [first, fresh] = first_of.try_emplace(name, scene);
        if (!fresh)
            throw InputError(fmt::format("{}: results would not tell it from {}: both are named {}",
                                         scene, first->second, name));
    }
}

RdxFile load_tree_file(const std::string& file) {
    if (holds_scene(file))
        throw InputError(file +
                         ": it holds a scene, and this needs one tree or mesh; info, check, trace, "
                         "render and query --closest, --signed-distance and --pairs take it");
    return load_rdx(file);
}

namespace {

void override_cameras(Model& scene, const TreeOptions& tree) {
    if (tree.cameras_file.empty()) return;
    scene.cameras = load_cameras(tree.cameras_file);
    scene.cameras_fault.clear();
}

}  // namespace

Model load_structured_model(const std::string& name, const TreeOptions& tree,
                            const CommonOptions& common) {
    Model scene = is_rdx(name) ? load_tree_file(name).scene : load_model(name, common.seed);
    override_cameras(scene, tree);
    return scene;
}

bool is_device(const std::string& device) { return device != "cpu" && device != "sim"; }

bool runs_on_device(const std::string& device) {
    if (!is_device(device)) return false;
    select_device(device);
    return true;
}

Model load_model_with_cameras(const std::string& name, const TreeOptions& tree,
                              const CommonOptions& common) {
    Model scene = load_structured_model(name, tree, common);
    flatten(scene, common);
    return scene;
}

void refuse_simulator(const TreeOptions& tree) {
    if (tree.device == "sim")
        throw CLI::ValidationError("--device",
                                   "sim traces rays (trace); trees are built on the "
                                   "cpu, or on cuda, opencl or hip");
}

void refuse_layout(const TreeOptions& tree) {
    if (tree.layout == "cwbvh")
        throw CLI::ValidationError("--layout",
                                   "cwbvh is made by build --tree bvh and by nothing else");
    if (tree.layout != "binary")
        throw CLI::ValidationError("--layout",
                                   tree.layout +
                                       " does not serve here, only binary; build and trace "
                                       "with --tree bvh take it");
}

void refuse_device(const TreeOptions& tree) {
    refuse_layout(tree);
    if (tree.device != "cpu")
        throw CLI::ValidationError("--device", tree.device + " does not serve here, only cpu");
}

void refuse_build_options(const std::string& scene, const TreeOptions& tree) {
    if (!is_rdx(scene)) return;
    for (const CLI::Option* option : tree.of_the_build)
        if (option->count() != 0)
            throw CLI::ValidationError(option->get_name(),
                                       "the tree in " + scene + " is used as it is");
}

SceneTree load_scene_tree(const std::string& name, const TreeOptions& tree,
                          const CommonOptions& common) {
    refuse_simulator(tree);
    if (tree.tree != "bvh")
        throw CLI::ValidationError("--tree", tree.tree + " does not serve here, only bvh");
    if (is_rdx(name)) {
        RdxFile file = load_tree_file(name);
        override_cameras(file.scene, tree);
        return {std::move(file.scene), std::move(file.bvh)};
    }
    return tree_of(load_model_with_cameras(name, tree, common), name, tree, common);
}

SceneTree tree_of(Model scene, const std::string& name, const TreeOptions& tree,
                  const CommonOptions& common) {
    SceneTree result{std::move(scene), {}};
    result.bvh = about(name, [&] {
        const BuildOptions options = tree.build_options(result.scene.mesh(), common);
        return runs_on_device(tree.device) ? DeviceScene(result.scene.mesh(), options).build().bvh
                                           : build_bvh(result.scene.mesh(), options);
    });
    return result;
}

void require_cameras(const Model& scene) {
    if (!scene.cameras_fault.empty()) throw InputError(scene.cameras_fault);
}

std::string reason_about(const std::string& scene, const std::string& reason,
                         const std::string& other) {
    if (!other.empty() && reason.starts_with(other + ": ")) return reason;
    const std::string name = std::filesystem::path(scene).filename().string();
    if (reason.starts_with(scene + ": ")) return reason;
    if (!name.empty() && reason.starts_with(name + ": ")) return scene + reason.substr(name.size());
    return scene + ": " + reason;
}

CLI::Validator any_finite_number() {
    return {[](std::string& text) {
                double value = 0;
                const char* end = text.data() + text.size();
                const char* begin = text.data() + (text.starts_with('+') ? 1 : 0);
                const auto [rest, error] = std::from_chars(begin, end, value);
                const bool good = error == std::errc() && rest == end && std::isfinite(value) &&
                                  std::isfinite(static_cast<float>(value));
                return good ? std::string() : "'" + text + "' is not a finite float32 number";
            },
            ""};
}

CLI::Validator number_up_to(double most, bool zero_too) {
    const auto fault = [=](std::string& text) {
        double value = 0;
        const char* end = text.data() + text.size();
        const auto [rest, error] = std::from_chars(text.data(), end, value);
        const bool is_number = error == std::errc() && rest == end;
        const bool is_from = zero_too ? value >= 0 : static_cast<float>(value) > 0;
        if (is_number && is_from && value <= most) return std::string();
        return fmt::format("'{}' is not a number {} {}", text,
                           zero_too ? "from 0 to" : "above 0 and up to", most);
    };
    return {fault, fmt::format("FLOAT in {}0 - {}]", zero_too ? "[" : "(", most)};
}

CLI::Validator finite_number(bool zero_too) {
    const auto fault = [zero_too](std::string& text) {
        double value = 0;
        const char* end = text.data() + text.size();
        const auto [rest, error] = std::from_chars(text.data(), end, value);
        const auto is_good = [&](auto number) {
            return std::isfinite(number) && (zero_too ? number >= 0 : number > 0);
        };
        const bool is_number = error == std::errc() && rest == end && is_good(value);
        if (is_number && is_good(static_cast<float>(value))) return std::string();
        return "'" + text + "' is not a " + (zero_too ? "number from 0 on" : "number above 0") +
               (is_number ? " that float32 holds" : "");
    };
    return {fault, zero_too ? "NONNEGATIVE" : "POSITIVE"};
}

namespace {

std::optional<Size> size_of(const std::string& text) {
    Size size;
    const char* end = text.data() + text.size();
    const auto [x, width_error] = std::from_chars(text.data(), end, size.width);
    if (width_error == std::errc() && x != end && *x == 'x') {
        const auto [rest, height_error] = std::from_chars(x + 1, end, size.height);
        const auto fits = [](std::uint32_t n) { return n >= 1 && n <= 16384; };
        if (height_error == std::errc() && rest == end && fits(size.width) && fits(size.height))
            return size;
    }
    return {};
}

std::string size_fault(const std::string& text) {
    return size_of(text) ? std::string()
                         : "'" + text + "' is not WIDTHxHEIGHT with 1 to 16384 pixels each";
}

}  // namespace

Size parse_size(const std::string& text) {
    const std::optional<Size> size = size_of(text);
    if (!size) throw CLI::ValidationError("--size", size_fault(text));
    return *size;
}

CLI::Option* add_size_option(CLI::App& command, std::string& size, const std::string& what) {
    return command.add_option("--size", size, what)->check(size_fault)->type_name("WxH");
}

void add_cameras_option(CLI::App& command, std::string& camera) {
    command.add_option("--camera", camera, "Number of a camera, or all")
        ->check([](const std::string& text) {
            const bool is_known =
                text == "all" ||
                (!text.empty() && text.find_first_not_of("0123456789") == std::string::npos);
            return is_known ? std::string() : "'" + text + "' is neither a number nor 'all'";
        })
        ->capture_default_str();
}

}  // namespace raydix::cli
