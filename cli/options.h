// Options that several commands share, and the commands themselves: each adds itself to the program
// and runs later.
#pragma once

#include <raydix/bvh.h>
#include <raydix/error.h>
#include <raydix/model.h>
#include <raydix/rdx.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace raydix::cli {

struct CommonOptions {
    std::string json_file;  // "-": standard output, and nothing else goes there
    int threads = 0;
    bool quiet = false;
    std::uint64_t seed = 1;
    bool flatten = false;            // one mesh was asked for
    mutable bool flattened = false;  // by flatten(): documents say so

    /// Tables for people go to standard output unless JSON does.
    [[nodiscard]] bool prints_tables() const { return !quiet && json_file != "-"; }
};
void add_common_options(CLI::App& command, CommonOptions& options);
/// Of commands that read scenes of several meshes and nodes (glTF).
void add_flatten_option(CLI::App& command, CommonOptions& options);

/// How a tree is to be built, in every command that needs one.
struct TreeOptions {
    /// Without a builder and a quality: quality balanced, or karras where a GPU builds.
    std::string tree = "bvh", builder, quality, layout = "binary", device = "cpu", fit;
    int bits = 63, max_leaf = 4;
    std::optional<int> reinsertion_rounds;
    std::optional<int> max_level;  // of an octree
    bool strict = false;
    std::string cameras_file;
    SahConstants sah;
    std::optional<double> epo_sample;
    const CLI::Option* layout_option = nullptr;
    std::vector<const CLI::Option*>
        of_the_build,  // those that a finished tree cannot follow any more
        of_a_bvh;      // those that mean nothing to other trees

    [[nodiscard]] BuildOptions build_options(const CommonOptions& common) const;
    /// Of a quality, for this mesh: a better one never gives a tree of higher cost.
    [[nodiscard]] BuildOptions build_options(const MeshView& mesh,
                                             const CommonOptions& common) const;
};
void add_tree_options(CLI::App& command, TreeOptions& options);
/// For commands that take the binary layout on the cpu alone, after add_tree_options: their help
/// offers no other.
void offer_binary_layout(CLI::App& command);
/// For commands that build the binary layout, there too, and trace nothing.
void offer_builds(CLI::App& command);
/// For commands that build, and trace nothing.
void offer_builders(CLI::App& command);
/// For commands that walk the binary tree alone, after add_tree_options: their help offers no value
/// of --tree and --layout that they refuse, and as --device what `devices` says. "": the cpu.
void offer_binary_tree(CLI::App& command, TreeOptions& options, const std::string& devices = "");
/// Of commands that print figures of the tree: SAH and EPO.
void add_tree_figure_options(CLI::App& command, TreeOptions& options);

/// A scene and its tree: built, or both read from a .rdx file.
struct SceneTree {
    Model scene;
    Bvh bvh;
};
/// By its name, or by how it begins.
[[nodiscard]] bool is_rdx(const std::string& scene);
/// An .rdx file that holds a scene (scene_file.h).
[[nodiscard]] bool is_scene_file(const std::string& scene);
/// Throws InputError if two scenes have one name in results, where folders are left out.
void require_different_names(const std::vector<std::string>& scenes);
/// Of an .rdx file that holds a tree. Throws InputError: one that holds a scene.
[[nodiscard]] RdxFile load_tree_file(const std::string& file);
/// For work on one mesh. Says so unless --flatten did.
void flatten(Model& scene, const CommonOptions& common);
/// With --quiet, on standard error: for results that have other columns than those of the scene.
void say_flattened(const std::string& scene, const CommonOptions& common);
/// As the file has it.
[[nodiscard]] Model load_structured_model(const std::string& scene, const TreeOptions& tree,
                                          const CommonOptions& common);
/// The same flat.
[[nodiscard]] Model load_model_with_cameras(const std::string& scene, const TreeOptions& tree,
                                            const CommonOptions& common);
/// Throws InputError: cameras.json beside the scene cannot be read. Before a camera of it is used.
void require_cameras(const Model& scene);
/// A .rdx file brings its tree: options that ask for another one are a usage error, never ignored.
void refuse_build_options(const std::string& scene, const TreeOptions& tree);
/// The simulator builds no trees: a usage error.
void refuse_simulator(const TreeOptions& tree);
/// For what knows no layout but its own: another one is a usage error, never ignored.
void refuse_layout(const TreeOptions& tree);
/// Whether --device names a device of raydix/device.h: not the cpu, not the simulator.
[[nodiscard]] bool is_device(const std::string& device);
/// The same, and selects it. Throws BackendUnavailable with what is missing.
[[nodiscard]] bool runs_on_device(const std::string& device);

/// For commands that run on the CPU only: another device or layout is a usage error, never ignored.
void refuse_device(const TreeOptions& tree);
[[nodiscard]] SceneTree load_scene_tree(const std::string& scene, const TreeOptions& tree,
                                        const CommonOptions& common);
/// Of a flat model. `name`: as the user gave it.
[[nodiscard]] SceneTree tree_of(Model scene, const std::string& name, const TreeOptions& tree,
                                const CommonOptions& common);

/// For add_option(...)->check: a finite number above 0, or from 0 on, that is one as a float, too.
[[nodiscard]] CLI::Validator finite_number(bool zero_too);

/// The same up to `most`; zero_too: from 0 on.
[[nodiscard]] CLI::Validator number_up_to(double most, bool zero_too);

/// The same, of any sign, without words in the help.
[[nodiscard]] CLI::Validator any_finite_number();

/// --max-result-bytes.
void add_result_limit(CLI::App& command, std::uint64_t& max_result_bytes);

/// `reason` behind the scene that the user named, which it may name already, with its folder or
/// without. A reason that begins with `other`, another file that the user named, stays as it is.
[[nodiscard]] std::string reason_about(const std::string& scene, const std::string& reason,
                                       const std::string& other = {});

/// Runs `work`; puts the scene that the user named before what the library has to say about its
/// geometry.
template <class Work>
auto about(const std::string& scene, const Work& work, const std::string& other = {}) {
    try {
        return work();
    } catch (const InputError& error) {
        throw InputError(reason_about(scene, error.what(), other));
    }
}

/// "1024x768" -> 1024, 768. Throws CLI::ValidationError.
struct Size {
    std::uint32_t width = 0, height = 0;
};
[[nodiscard]] Size parse_size(const std::string& text);
/// --size, of which the command takes the text. `what` it is of.
CLI::Option* add_size_option(CLI::App& command, std::string& size, const std::string& what);
/// --camera: a number, or all.
void add_cameras_option(CLI::App& command, std::string& camera);

void add_info_command(CLI::App& app);
void add_scenes_command(CLI::App& app);
void add_build_command(CLI::App& app);
void add_check_command(CLI::App& app);
void add_trace_command(CLI::App& app);
void add_render_command(CLI::App& app);
void add_query_command(CLI::App& app);
void add_simulate_command(CLI::App& app);
void add_bench_command(CLI::App& app);
/// bench traversal
void add_traversal_suite(CLI::App& bench);
/// bench cpu
void add_cpu_suite(CLI::App& bench);
/// bench scene
void add_scene_suite(CLI::App& bench);
/// bench points
void add_points_suite(CLI::App& bench);
void add_hierarchy_suite(CLI::App& bench);
void add_report_command(CLI::App& app);
void add_mpi_command(CLI::App& app);
void add_doctor_command(CLI::App& app);

}  // namespace raydix::cli
