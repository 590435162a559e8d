// The engine on one tree: what trace and build say about wide trees.
#pragma once

#include <raydix/wide.h>

#include <map>
#include <string>
#include <vector>

#include "options.h"
#include "output.h"

namespace raydix::cli {

struct WideTraceOptions {
    std::string path = "automatic", isa;
    CLI::Option* path_option = nullptr;
    CLI::Option* isa_option = nullptr;
};

void add_wide_trace_options(CLI::App& command, WideTraceOptions& options);

/// wide4, wide8 and compact.
[[nodiscard]] bool is_wide_layout(const std::string& layout);
/// Of a wide layout.
[[nodiscard]] WideBvhOptions wide_options(const std::string& layout, int threads);

/// On the cpu rays go through a bvh by the engine, unless --kernel or --layout say otherwise.
/// --kernel engine (simd is an old name of it) goes with a wide layout and either of them is
/// enough. Usage errors: one without the other, options of the engine for another kernel.
std::string chosen_cpu_kernel(const std::string& kernel, TreeOptions& tree,
                              const WideTraceOptions& options);

/// A wide tree, and which paths its batches took.
class WideTracer {
public:
    WideTracer(const Bvh& bvh, const std::string& layout, const WideTraceOptions& options,
               const CommonOptions& common);
    TraceCounts closest(std::span<const Ray> rays, std::span<Hit> hits, TraceOptions options);
    TraceCounts any(std::span<const Ray> rays, std::span<std::uint8_t> occluded,
                    TraceOptions options);
    AllHits all(std::span<const Ray> rays, TraceOptions options);
    [[nodiscard]] const WideBvh& tree() const { return tree_; }
    [[nodiscard]] const std::string& isa() const { return isa_; }
    /// Path -> batches.
    [[nodiscard]] Json paths_json() const;
    void explain_tree(const CommonOptions& common) const;
    void explain_paths(const CommonOptions& common) const;

private:
    TraceOptions with_path(std::span<const Ray> rays, TraceOptions options);

    WideBvh tree_;
    SimdPath path_;
    std::string isa_;
    std::map<std::string, std::uint64_t> batches_;
};

/// What WideBvhStats and CwbvhStats have in common.
template <class Stats>
[[nodiscard]] Json wide_figures_json(const Stats& s, std::uint64_t leaves) {
    return {{"nodes", s.nodes},
            {"leaves", leaves},
            {"references", s.references},
            {"max_depth", s.max_depth},
            {"children_per_node", s.children_per_node},
            {"sah", s.sah},
            {"widening", s.widening},
            {"node_bytes", s.node_bytes},
            {"triangle_bytes", s.triangle_bytes}};
}

/// The wide tree; what a trace touches is then its.
void add_wide(Json& build, const WideBvh& tree);
/// The same in a document of `trace`, whose times and peak then have the layout in them. No builds:
/// the binary tree comes from a file.
void add_traced_wide(Json& build, const Bvh& bvh, const WideBvh& tree,
                     const std::vector<BuildMs>& builds);
void print_wide_table(const Json& wide);

}  // namespace raydix::cli
