#include "output.h"

#include <fmt/format.h>
#include <raydix/error.h>
#include <raydix/files.h>
#include <raydix/machine.h>
#include <raydix/version.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <iostream>

#include "option_checks.h"

namespace raydix::cli {
namespace {

Json vec_json(Vec3 v) { return Json::array({v.x, v.y, v.z}); }

double seconds_now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

/// A field of every repeat.
std::vector<double> field(const std::vector<BuildMs>& builds, double BuildMs::*member) {
    std::vector<double> values;
    for (const BuildMs& b : builds) values.push_back(b.*member);
    return values;
}

}  // namespace

Json new_document(const std::string& command) {
    const MachineInfo machine = machine_info();
    Json document;
    document["command"] = command;
    document["version"] = version;
    document["machine"] = {{"cpu", machine.cpu},
                           {"cores", machine.cores},
                           {"isa", machine.isa},
                           {"gpu", machine.gpu.empty() ? Json(nullptr) : Json(machine.gpu)}};
    return document;
}

Json scene_json(const Model& scene) {
    std::size_t triangles = 0, vertices = 0;
    for (const Mesh& mesh : scene.meshes)
        triangles += mesh.triangles.size(), vertices += mesh.vertices.size();
    return {{"name", scene.name},
            {"triangles", triangles},
            {"points", triangles == 0 ? vertices : 0},
            {"vertices", vertices},
            {"geometries", scene.meshes.size()},
            {"instances", scene.nodes.size()},
            {"cameras", scene.cameras.cameras.size()}};
}

void tell_left_out(Json& document, std::uint64_t left_out, const CommonOptions& common) {
    Json& scene = document["scene"];
    scene["left_out"] = left_out;
    if (left_out == 0 || !common.prints_tables()) return;
    const bool is_cloud = scene["points"] != 0;
    fmt::print("{} left out: not finite, or out of range\n",
               is_cloud ? counted(left_out, "point", "points")
                        : counted(left_out, "triangle", "triangles"));
}

Json mesh_info_json(const MeshInfo& info) {
    const bool bounded = info.bounds.lo.x <= info.bounds.hi.x;
    return {{"bounds", bounded ? Json::array({vec_json(info.bounds.lo), vec_json(info.bounds.hi)})
                               : Json(nullptr)},
            {"non_finite_vertices", info.non_finite_vertices},
            {"out_of_range_vertices", info.out_of_range_vertices},
            {"unreferenced_vertices", info.unreferenced_vertices},
            {"zero_area_triangles", info.zero_area_triangles},
            {"repeated_index_triangles", info.repeated_index_triangles},
            {"left_out_triangles", info.left_out_triangles},
            {"bytes", info.bytes}};
}

Spread spread_of(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    const std::size_t n = values.size();
    return {n % 2 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]), values.front(),
            values.back()};
}

Json spread_json(const Spread& spread) {
    return {{"median", spread.median}, {"min", spread.min}, {"max", spread.max}};
}

Json build_json(const Bvh& bvh, const TreeStats& stats, const std::vector<BuildMs>& builds,
                std::optional<double> epo_sample) {
    const BuildOptions& options = bvh.options();
    const auto or_null = [](const auto& value) { return value ? Json(*value) : Json(nullptr); };
    const Json fit = options.fit == Fit::as_published ? Json(nullptr)
                     : options.fit == Fit::levels     ? "levels"
                                                      : "atomic";
    Json build{{"tree", "bvh"},
               {"builder", builder_name(options.builder)},
               {"bits", options.bits},
               {"max_leaf", options.max_leaf},
               {"reinsertion_rounds", options.reinsertion_rounds},
               {"fit", fit},
               {"device", "cpu"},
               {"threads", threads_at_work(options.threads)},
               {"primitives", bvh.input_count()},
               {"left_out", bvh.left_out()},
               {"nodes", stats.nodes},
               {"leaves", stats.leaves},
               {"references", stats.references},
               {"layout", "binary"},
               {"layout_nodes", stats.layout_nodes},
               {"max_depth", stats.max_depth},
               {"depth_bound", or_null(stats.depth_bound)},
               {"sah", or_null(stats.sah)},
               {"sah_constants",
                {{"node", stats.sah_constants.node}, {"primitive", stats.sah_constants.primitive}}},
               {"epo", or_null(stats.epo)},
               {"epo_sample", or_null(epo_sample)},
               {"bytes", stats.bytes},
               {"bytes_referenced", stats.bytes_referenced},
               {"peak_bytes", builds.empty() ? Json(nullptr) : Json(bvh.peak_bytes())},
               {"tree_hash", stats.tree_hash}};
    add_build_ms(build, builds);
    return build;
}

void add_build_ms(Json& build, const std::vector<BuildMs>& builds) {
    if (builds.empty()) {
        build["ms"] = nullptr;
        return;
    }
    Json ms, least, most;
    for (const auto& [name, member] : build_stages) {
        const Spread spread = spread_of(field(builds, member));
        ms[name] = spread.median;
        least[name] = spread.min;
        most[name] = spread.max;
    }
    build["ms"] = ms;
    build["ms_spread"] = {{"min", least}, {"max", most}};
}

void print_stages(const Json& build, std::size_t builds) {
    fmt::print("\n{:<12} {:>9} {:>9} {:>9}   ms, of {} builds into new memory\n", "stage", "median",
               "min", "max", builds);
    for (const auto& [stage, ms] : build["ms"].items())
        fmt::print("{:<12} {:>9.2f} {:>9.2f} {:>9.2f}\n", stage, ms.get<double>(),
                   build["ms_spread"]["min"][stage].get<double>(),
                   build["ms_spread"]["max"][stage].get<double>());
}

void print_invalid_rays(std::uint64_t invalid) {
    if (invalid != 0) fmt::print("{} rays are invalid and count as misses\n", grouped(invalid));
}

StatsOptions stats_options(const TreeOptions& tree, const CommonOptions& common) {
    StatsOptions options;
    options.sah = tree.sah;
    options.with_epo = tree.epo_sample.has_value();
    options.epo_sample = tree.epo_sample.value_or(1.0);
    options.threads = common.threads;
    return options;
}

void print_tree_table(const Bvh& bvh, const TreeStats& stats) {
    fmt::print("\ntree         {} primitives ({} left out), {} nodes, {} leaves\n",
               grouped(stats.references), grouped(bvh.left_out()), grouped(stats.nodes),
               grouped(stats.leaves));
    fmt::print("depth        {} (proven bound {})\n", stats.max_depth,
               stats.depth_bound ? std::to_string(*stats.depth_bound) : "none");
    fmt::print("SAH          {}   (node {:g}, primitive {:g})\n",
               stats.sah ? fmt::format("{:.3f}", *stats.sah) : "none", stats.sah_constants.node,
               stats.sah_constants.primitive);
    if (stats.epo) fmt::print("EPO          {:.4f}\n", *stats.epo);
    const double each =
        stats.references ? static_cast<double>(stats.bytes) / static_cast<double>(stats.references)
                         : 0;
    fmt::print("memory       {:.2f} MB ({:.1f} bytes a primitive)",
               static_cast<double>(stats.bytes) / 1e6, each);
    if (bvh.peak_bytes() != 0)
        fmt::print(", peak while building {:.2f} MB ({:.2f} x the tree)",
                   static_cast<double>(bvh.peak_bytes()) / 1e6,
                   static_cast<double>(bvh.peak_bytes()) /
                       static_cast<double>(std::max<std::uint64_t>(stats.bytes, 1)));
    fmt::print("\nhash         {}\n", stats.tree_hash);
}

void require_writable_json(const CommonOptions& common) {
    if (common.json_file != "-") require_writable(common.json_file);
}

void write_json(const Json& made, const CommonOptions& common) {
    if (common.json_file.empty()) return;
    Json document = made;
    if (!document.contains("seed")) document["seed"] = common.seed;
    if (common.flattened)
        (document.contains("scene") ? document["scene"] : document)["flattened"] = true;
    const std::string text = document.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
    if (common.json_file == "-") {
        std::cout << text << std::flush;
        if (!std::cout) throw InputError("standard output: cannot be written");
        return;
    }
    write_file(common.json_file, std::as_bytes(std::span(text)));
}

Progress::Progress(std::string what, const CommonOptions& common)
    : what_(std::move(what)),
      wanted_(!common.quiet && isatty(STDERR_FILENO)),
      started_(seconds_now()) {}

void Progress::show(double part) {
    if (!wanted_) return;
    const double now = seconds_now();
    if (now - started_ < 1.0 || now - last_ < 0.1) return;
    last_ = now;
    shown_ = true;
    constexpr int width = 40;
    const int filled = static_cast<int>(std::clamp(part, 0.0, 1.0) * width);
    const std::string bar = fmt::format("\r{} [{:#<{}}{:.<{}}] {:3.0f} %", what_, "", filled, "",
                                        width - filled, 100 * part);
    static_cast<void>(std::fputs(bar.c_str(), stderr));
}

Progress::~Progress() {
    if (shown_) static_cast<void>(std::fputs("\r\033[K", stderr));
}

int threads_at_work(int asked) {
    const int cores = machine_info().cores;
    return asked > 0 ? std::min(asked, cores) : cores;
}

std::string grouped(std::uint64_t n) {
    if (n < 1000) return std::to_string(n);
    return fmt::format("{},{:03}", grouped(n / 1000), n % 1000);
}

std::string warning(const std::string& text) {
    return isatty(STDOUT_FILENO) ? "\x1b[31m" + text + "\x1b[0m" : text;
}

std::string counted(std::uint64_t n, const char* one, const char* many) {
    return grouped(n) + " " + (n == 1 ? one : many);
}

}  // namespace raydix::cli
