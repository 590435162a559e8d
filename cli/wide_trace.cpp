#include "wide_trace.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "layout_builds.h"

namespace raydix::cli {

void add_wide_trace_options(CLI::App& command, WideTraceOptions& options) {
    options.path_option =
        command.add_option("--path", options.path, "How the engine takes a batch through the tree")
            ->check(CLI::IsMember({"automatic", "single", "packet", "stream", "sorted"}))
            ->capture_default_str();
    options.isa_option = command
                             .add_option("--isa", options.isa,
                                         "Instruction set of the engine (default: the best of the "
                                         "processor)")
                             ->check(CLI::IsMember(simd_instruction_sets()));
}

namespace {

std::string layout_name(const WideBvhStats& stats) {
    return stats.compact ? "compact" : stats.width == 4 ? "wide4" : "wide8";
}

}  // namespace

bool is_wide_layout(const std::string& layout) {
    return layout == "wide8" || layout == "wide4" || layout == "compact";
}

WideBvhOptions wide_options(const std::string& layout, int threads) {
    return {.width = layout == "wide4" ? 4 : 8, .compact = layout == "compact", .threads = threads};
}

std::string chosen_cpu_kernel(const std::string& kernel, TreeOptions& tree,
                              const WideTraceOptions& options) {
    const bool wide = is_wide_layout(tree.layout);
    const bool open = tree.layout_option->count() == 0 && tree.tree == "bvh";
    const bool engine = kernel == "engine" || kernel == "simd" ||
                        (kernel.empty() && (wide || open) && tree.device == "cpu");
    if (!engine) {
        if (wide && !kernel.empty())
            throw CLI::ValidationError(
                "--layout", tree.layout + " goes with --kernel engine, not with " + kernel);
        for (const CLI::Option* option : {options.path_option, options.isa_option})
            if (option->count() != 0)
                throw CLI::ValidationError(option->get_name(), "belongs to --kernel engine");
        return kernel;
    }
    if (tree.tree != "bvh")
        throw CLI::ValidationError("--kernel", "the engine traces a bvh, not a " + tree.tree);
    if (tree.layout == "cwbvh")
        throw CLI::ValidationError("--layout",
                                   "cwbvh does not go with --kernel engine, wide8 does");
    if (!wide && tree.layout_option->count() != 0)
        throw CLI::ValidationError("--layout", tree.layout + " does not go with --kernel engine");
    if (!wide) tree.layout = "wide8";
    return "engine";
}

WideTracer::WideTracer(const Bvh& bvh, const std::string& layout, const WideTraceOptions& options,
                       const CommonOptions& common)
    : tree_(bvh, wide_options(layout, common.threads)),
      path_(simd_path_from_name(options.path)),
      isa_(options.isa.empty() ? simd_instruction_sets().front() : options.isa) {}

TraceOptions WideTracer::with_path(std::span<const Ray> rays, TraceOptions options) {
    options.path = path_;
    options.isa = isa_;
    // With counters `automatic` takes one path for the whole batch, this one.
    if (options.counters) {
        const SimdPath taken = path_ == SimdPath::automatic ? choose_simd_path(tree_, rays) : path_;
        ++batches_[std::string(simd_path_name(taken))];
    }
    return options;
}

TraceCounts WideTracer::closest(std::span<const Ray> rays, std::span<Hit> hits,
                                TraceOptions options) {
    return trace(tree_, rays, hits, with_path(rays, options));
}

TraceCounts WideTracer::any(std::span<const Ray> rays, std::span<std::uint8_t> occluded,
                            TraceOptions options) {
    return trace_any(tree_, rays, occluded, with_path(rays, options));
}

AllHits WideTracer::all(std::span<const Ray> rays, TraceOptions options) {
    options.isa = isa_;
    if (options.counters) ++batches_["single"];
    return trace_all(tree_, rays, options);
}

Json WideTracer::paths_json() const {
    Json json = Json::object();
    for (const auto& [path, batches] : batches_) json[path] = batches;
    return json;
}

void WideTracer::explain_tree(const CommonOptions& common) const {
    if (!common.prints_tables()) return;
    const WideBvhStats& s = tree_.stats();
    fmt::print(
        "kernel engine: {} layout, nodes of up to {} children with boxes of {}, blocks of 4 "
        "triangles{}, {} code, paths chosen by batch ({})\n",
        layout_name(s), s.width, s.compact ? "8 bits an axis" : "floats",
        s.compact ? " with shared vertices" : "", isa_, simd_path_name(path_));
    fmt::print("             {} nodes, {} leaves, {:.1f} MB\n", s.nodes, s.leaves,
               static_cast<double>(s.bytes) * 1e-6);
}

void WideTracer::explain_paths(const CommonOptions& common) const {
    if (!common.prints_tables()) return;
    for (const auto& [path, batches] : batches_) {
        const bool may_race =
            path_ == SimdPath::automatic && (path == "stream" || path == "sorted");
        fmt::print("path {}: {} {}{}\n", path, batches, batches == 1 ? "batch" : "batches",
                   may_race ? "; jobs of large ones as packets where those take less time" : "");
    }
}

void add_wide(Json& build, const WideBvh& tree) {
    const WideBvhStats& s = tree.stats();
    build["layout"] = layout_name(s);
    build["layout_nodes"] = s.nodes;
    build["bytes"] = s.bytes;
    Json& wide = build["wide"] = {{"layout", layout_name(s)}};
    wide.update(wide_figures_json(s, s.leaves));
    wide["ms"] = s.ms;
    wide["layout_ms"] = s.layout_ms;
    wide["build_ms"] = nullptr;
    wide["kept_ms"] = nullptr;
}

void add_traced_wide(Json& build, const Bvh& bvh, const WideBvh& tree,
                     const std::vector<BuildMs>& builds) {
    const WideBvhStats& s = tree.stats();
    TimedBuilds timed;
    for (const BuildMs& of_tree : builds) timed.fresh.push_back(with_layout(of_tree, s.ms));
    timed.peak_bytes = peak_with_layout(bvh, s.peak_bytes);
    if (!builds.empty()) keep_binary(build);
    add_wide(build, tree);
    if (builds.empty()) return;
    set_layout_builds(build, timed);
    build["wide"]["build_ms"] = spread_json(totals(timed.fresh));
}

void print_wide_table(const Json& wide) {
    fmt::print("\n{:<12} {} nodes of {:.2f} children, {} leaves, depth {}\n",
               wide["layout"].get<std::string>(), grouped(wide["nodes"].get<std::uint64_t>()),
               wide["children_per_node"].get<double>(),
               grouped(wide["leaves"].get<std::uint64_t>()),
               wide["max_depth"].get<std::uint32_t>());
    fmt::print(
        "SAH          {:.3f}   (node 1, primitive 0.4), boxes widened to {:.3f} x their area\n",
        wide["sah"].get<double>(), wide["widening"].get<double>());
    fmt::print("memory       {:.1f} MB\n",
               (wide["node_bytes"].get<double>() + wide["triangle_bytes"].get<double>()) * 1e-6);
}

}  // namespace raydix::cli
