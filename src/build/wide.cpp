// The public wide tree: binary tree -> wide tree -> nodes and blocks of triangles, and its figures.
#include <raydix/error.h>
#include <raydix/wide.h>

#include <string>

#include "base/float_env.h"
#include "base/options.h"
#include "build/bvh_builder_internals.h"
#include "exec/large_pages.h"
#include "exec/memory.h"
#include "exec/parallel.h"
#include "exec/progress.h"
#include "layout/cluster_view.h"
#include "layout/local_pads.h"
#include "layout/sorted_part.h"
#include "layout/wide_bvh.h"
#include "layout/wide_collapse.h"
#include "measure/stopwatch.h"
#include "tree/cluster.h"

namespace raydix {
namespace {

WideOptions collapse_options(const WideBvhOptions& options) {
    const WideOptions collapse{.width = options.width,
                               .max_leaf = wide_max_leaf,
                               .node_cost = 1.0,
                               .primitive_cost = wide_primitive_cost,
                               .block = wide_block,
                               .compact = options.compact};
    check_wide_options(collapse);
    check_threads(options.threads);
    return collapse;
}

std::uint64_t peak_above(std::uint64_t before) {
    const std::uint64_t peak = memory_count().peak();
    return peak > before ? peak - before : 0;  // kept memory may have been given back
}

/// `of_tree`: of a build of the binary tree, or of what stands in its place.
BuildMs with_layout(BuildMs of_tree, double total) {
    of_tree.layout =
        total - of_tree.bounds - of_tree.codes - of_tree.sort - of_tree.hierarchy - of_tree.fit;
    of_tree.total = total;
    return of_tree;
}

/// Whether nodes and blocks are written from sorted triangles, without a binary tree between.
bool goes_straight(const BuildOptions& options, const WideBvhOptions& wide) {
    return options.builder == Builder::apetrei && options.reinsertion_rounds == 0 &&
           options.max_leaf == static_cast<int>(wide_max_leaf) && !wide.compact;
}

}  // namespace

WideBvh::WideBvh(const Bvh& bvh, const WideBvhOptions& options)
    : arrays_(std::make_unique<Arrays>()) {
    const WideOptions collapse = collapse_options(options);
    arrays_->clear(collapse);
    arrays_->stats.input_count = bvh.input_count();
    arrays_->stats.left_out = bvh.left_out();
    if (bvh.empty()) return;
    if (bvh.kind() != PrimitiveKind::triangles)
        throw InputError(std::string("rays need triangles; this tree holds ") +
                         (bvh.kind() == PrimitiveKind::points ? "points" : "boxes"));
    const FloatEnvironment environment;
    const std::uint64_t before = memory_count().now();
    memory_count().restart_peak();
    with_threads(options.threads, [&] {
        const LargePages large;
        Stopwatch watch;
        WideScratch scratch;
        make_wide_layout(bvh, collapse, *arrays_, scratch);
        settle_local_pads(*arrays_);
        WideBvhStats& stats = arrays_->stats;
        stats.ms = stats.layout_ms = stats.stages.layout = stats.stages.total = watch.lap();
    });
    arrays_->stats.peak_bytes = peak_above(before);
}

WideBvh::WideBvh() : arrays_(std::make_unique<Arrays>()) { arrays_->clear({}); }
const WideBvh::Arrays& WideBvh::nothing() {
    static const WideBvh empty;
    return *empty.arrays_;
}
WideBvh::~WideBvh() = default;
WideBvh::WideBvh(WideBvh&&) noexcept = default;
WideBvh& WideBvh::operator=(WideBvh&&) noexcept = default;

struct WideBvhBuilder::Scratch {
    BvhBuilder builder;
    Bvh tree;
    WideScratch wide;
};

WideBvhBuilder::WideBvhBuilder() : scratch_(std::make_unique<Scratch>()) {}
WideBvhBuilder::~WideBvhBuilder() = default;
WideBvhBuilder::WideBvhBuilder(WideBvhBuilder&&) noexcept = default;
WideBvhBuilder& WideBvhBuilder::operator=(WideBvhBuilder&&) noexcept = default;

void WideBvhBuilder::build(const MeshView& mesh, const BuildOptions& options, WideBvh& tree,
                           const WideBvhOptions& wide) {
    const FloatEnvironment environment;
    const LargePages large;
    Stopwatch watch;
    const WideOptions collapse = collapse_options(wide);
    if (mesh.triangles.empty() && !mesh.vertices.empty())
        throw InputError("rays need triangles; this mesh has vertices alone");
    if (!tree.arrays_) tree = WideBvh();  // both were moved from
    if (!scratch_) scratch_ = std::make_unique<Scratch>();
    WideBvh::Arrays& arrays = *tree.arrays_;
    Bvh& bvh = scratch_->tree;
    const std::uint64_t before = memory_count().now();
    bool by_clusters = false;
    double layout_ms = 0;
    const auto lay_out = [&](const auto& make) {
        Stopwatch stage;
        make();
        layout_ms = stage.lap();
    };
    try {
        arrays.clear(collapse);
        if (grows_clusters(options.builder) &&
            options.max_leaf <= static_cast<int>(wide_max_leaf)) {
            by_clusters = true;
            BvhBuilderInternals::build_clusters(
                scratch_->builder, mesh, options, bvh,
                [&](const ClusterTree& clusters, const TriangleSource& source,
                    const std::uint8_t* flat) {
                    ClusterView view(clusters, source, flat);
                    lay_out([&] { make_wide_layout(view, collapse, arrays, scratch_->wide); });
                });
        } else if (goes_straight(options, wide)) {
            bool taken = false;
            BvhBuilderInternals::sort(
                scratch_->builder, mesh, options, bvh,
                {[&](std::size_t triangles, std::size_t bytes) {
                     return memory_for_sorting(triangles, bytes, arrays);
                 },
                 [&](const SortedTriangles& triangles) {
                     taken = true;
                     lay_out(
                         [&] { make_wide_layout(triangles, collapse, arrays, scratch_->wide); });
                 }});
            if (!taken) arrays.clear(collapse);  // but for the memory that was lent
        } else {
            {
                const ProgressStage binary(0, 0.75);
                scratch_->builder.build(mesh, options, bvh);
            }
            const ProgressStage rest(0.75, 1);
            progress_at(0);
            if (!bvh.empty())
                with_threads(options.threads, [&] {
                    lay_out([&] { make_wide_layout(bvh, collapse, arrays, scratch_->wide); });
                });
        }
    } catch (...) {
        arrays.clear(collapse);  // nothing half-built gets out
        throw;
    }
    arrays.stats.input_count = bvh.input_count();
    arrays.stats.left_out = bvh.left_out();
    settle_local_pads(arrays);
    arrays.stats.layout_ms = layout_ms;
    arrays.stats.ms = watch.lap();
    BuildMs of_tree = bvh.build_ms();
    if (by_clusters) of_tree.fit = 0;  // the layout was made there
    arrays.stats.stages = with_layout(of_tree, arrays.stats.ms);
    arrays.stats.peak_bytes = peak_above(before);
}

WideBvh build_wide_bvh(const MeshView& mesh, const BuildOptions& options,
                       const WideBvhOptions& wide) {
    WideBvh tree;
    WideBvhBuilder().build(mesh, options, tree, wide);
    return tree;
}

WideBvh build_wide_bvh(const Mesh& mesh, const BuildOptions& options, const WideBvhOptions& wide) {
    return build_wide_bvh(MeshView(mesh), options, wide);
}

bool WideBvh::empty() const { return arrays().blocks.empty() && arrays().compact_blocks.empty(); }
const WideBvhStats& WideBvh::stats() const { return arrays().stats; }

}  // namespace raydix
