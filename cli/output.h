// What commands hand out: JSON documents, tables, progress.
#pragma once

#include <raydix/bvh.h>
#include <raydix/mesh.h>
#include <raydix/model.h>

#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "options.h"

namespace raydix::cli {

using Json = nlohmann::ordered_json;

/// {command, version, machine}: the start of every document.
[[nodiscard]] Json new_document(const std::string& command);
[[nodiscard]] Json scene_json(const Model& scene);
/// Puts `left_out` into the scene of a document: its triangles, or points, that are not finite or
/// out of range. Tables have a line where there are some.
void tell_left_out(Json& document, std::uint64_t left_out, const CommonOptions& common);
[[nodiscard]] Json mesh_info_json(const MeshInfo& info);

/// Median, least and greatest of some repeats. At least one value.
struct Spread {
    double median = 0, min = 0, max = 0;
};
[[nodiscard]] Spread spread_of(std::vector<double> values);
[[nodiscard]] Json spread_json(const Spread& spread);

/// The `build` object of a document; `builds` are the times of each repeat (empty: a tree from a
/// file).
[[nodiscard]] Json build_json(const Bvh& bvh, const TreeStats& stats,
                              const std::vector<BuildMs>& builds,
                              std::optional<double> epo_sample = {});
/// Puts `ms` and `ms_spread` of the repeats into a `build` object.
void add_build_ms(Json& build, const std::vector<BuildMs>& builds);
/// Of a build, in their order, and all of it.
inline constexpr std::array<std::pair<const char*, double BuildMs::*>, 7> build_stages{
    {{"bounds", &BuildMs::bounds},
     {"codes", &BuildMs::codes},
     {"sort", &BuildMs::sort},
     {"hierarchy", &BuildMs::hierarchy},
     {"fit", &BuildMs::fit},
     {"layout", &BuildMs::layout},
     {"total", &BuildMs::total}}};
void print_stages(const Json& build, std::size_t builds);
/// A line if there are some.
void print_invalid_rays(std::uint64_t invalid);
[[nodiscard]] StatsOptions stats_options(const TreeOptions& tree, const CommonOptions& common);
void print_tree_table(const Bvh& bvh, const TreeStats& stats);

/// Before the work whose document --json takes. Throws InputError as write_json would.
void require_writable_json(const CommonOptions& common);
/// Writes the document, with its seed, if one was asked for. Throws InputError that names the file.
void write_json(const Json& document, const CommonOptions& common);

/// A bar on standard error after the first second, on a terminal only. It is wiped when it ends,
/// which is to be before results are printed.
class Progress {
public:
    Progress(std::string what, const CommonOptions& common);
    ~Progress();
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;
    void show(double part);

private:
    std::string what_;
    bool wanted_;
    bool shown_ = false;
    double started_, last_ = 0.0;
};

/// How many threads an option stands for: no more than the machine has, and all for 0.
[[nodiscard]] int threads_at_work(int asked);

/// 12345678 -> "12,345,678".
[[nodiscard]] std::string grouped(std::uint64_t n);
/// For standard output, in red where a terminal shows it.
[[nodiscard]] std::string warning(const std::string& text);
/// "1 node", "2 nodes".
[[nodiscard]] std::string counted(std::uint64_t n, const char* one, const char* many);

}  // namespace raydix::cli
