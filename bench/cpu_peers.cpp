#include "cpu_peers.h"

#include <fmt/format.h>
#include <raydix/raydix.h>
#include <raydix/wide.h>

#include <algorithm>

#include "embree_scene.h"
#include "embree_trace.h"
#include "embree_tree.h"
#include "exec/parallel.h"
#include "one_by_one.h"

namespace raydix::bench {
namespace {

EmbreeOptions embree_options(const std::string& kind, int threads) {
    EmbreeOptions options{.threads = threads};
    unsigned flags = RTC_SCENE_FLAG_NONE;
    std::size_t begin = 0;
    while (begin <= kind.size()) {
        const std::size_t end = std::min(kind.find('+', begin), kind.size());
        const std::string word = kind.substr(begin, end - begin);
        if (begin == 0 && (word == "low" || word == "medium" || word == "high")) {
            options.quality = word == "low"      ? RTC_BUILD_QUALITY_LOW
                              : word == "medium" ? RTC_BUILD_QUALITY_MEDIUM
                                                 : RTC_BUILD_QUALITY_HIGH;
        } else if (begin != 0 && (word == "compact" || word == "robust")) {
            flags |= word == "compact" ? RTC_SCENE_FLAG_COMPACT : RTC_SCENE_FLAG_ROBUST;
        } else {
            throw CLI::ValidationError(
                "--embree",
                "'" + kind + "' is not low, medium or high, with +compact or +robust behind it");
        }
        begin = end + 1;
    }
    options.flags = static_cast<RTCSceneFlags>(flags);
    return options;
}

class EmbreePeer : public Peer {
public:
    EmbreePeer(const std::string& kind, const Mesh& mesh, const CpuBench& bench, int threads)
        : mesh_(mesh),
          bench_(bench),
          options_(embree_options(kind, threads)),
          scene_(mesh, options_) {}

    void prepare() override { scene_.touch(); }
    void build() override { scene_.commit(); }

    /// Of another scene: to be told of each block of memory would cost the first one time.
    PeerBytes bytes() override {
        EmbreeOptions counted = options_;
        counted.count_bytes = true;
        EmbreeScene scene(mesh_, counted);
        scene.commit();
        const bool compact = (options_.flags & RTC_SCENE_FLAG_COMPACT) != 0;
        // Compact leaves hold positions in the caller's vertices, others hold corners.
        return {scene.bytes(), compact ? mesh_.vertices.size() * sizeof(Vec3) : 0};
    }

    std::optional<double> sah() override {
        if (options_.quality != RTC_BUILD_QUALITY_MEDIUM) return std::nullopt;
        EmbreeTree tree(mesh_, options_.threads, bench_.max_leaf);
        tree.refill();
        tree.build();
        return tree_stats(tree.as_bvh(mesh_), {.with_hash = false}).sah;
    }

    std::vector<Mode> modes() const override {
        std::vector<Mode> modes;
        const RTCScene scene = scene_.scene();
        for (const EmbreeMode mode : embree_modes) {
            modes.push_back(
                {.name = mode.name(),
                 .single = mode.single(),
                 .closest =
                     [=](std::span<const Ray> rays, std::span<Hit> hits, int threads) {
                         with_threads(threads, [&] { trace_embree(scene, mode, rays, hits); });
                     },
                 .any =
                     [=](std::span<const Ray> rays, std::span<std::uint8_t> found, int threads) {
                         with_threads(threads, [&] { trace_any_embree(scene, mode, rays, found); });
                     }});
        }
        return modes;
    }

private:
    const Mesh& mesh_;
    const CpuBench& bench_;
    EmbreeOptions options_;
    EmbreeScene scene_;
};

/// A wide tree by the builder that the word of quality stands for.
class RaydixPeer : public Peer {
public:
    RaydixPeer(const std::string& quality, const Mesh& mesh, const CpuBench& bench, int threads)
        : mesh_(mesh), bench_(bench) {
        cli::CommonOptions common = bench.common;
        common.threads = threads;
        cli::TreeOptions tree;
        const std::size_t end = quality.find("+compact");
        tree.quality = quality.substr(0, end);
        wide_options_.width = bench.width;
        wide_options_.compact = end != std::string::npos;
        tree.max_leaf = bench.max_leaf;
        build_options_ = tree.build_options(common);
    }

    void build() override { builder_.build(mesh_, build_options_, wide_, wide_options_); }

    std::optional<double> layout_ms() const override { return wide_.stats().layout_ms; }
    PeerBytes bytes() override { return {wide_.stats().bytes, 0}; }
    std::optional<double> sah() override {
        return tree_stats(build_bvh(mesh_, build_options_), {.with_hash = false}).sah;
    }

    std::vector<Mode> modes() const override {
        std::vector<std::string> isas = bench_.isas;
        if (isas.empty()) isas.emplace_back();
        if (isas == std::vector<std::string>{"all"}) isas = simd_instruction_sets();
        std::vector<Mode> modes;
        for (const std::string& isa : isas) {
            modes.push_back(batch_mode("automatic", SimdPath::automatic, isa));
            if (!bench_.all_paths) continue;
            modes.push_back(batch_mode("one by one", SimdPath::single, isa));
            modes.push_back(batch_mode("packets", SimdPath::packet, isa));
            modes.push_back(batch_mode("streams", SimdPath::stream, isa));
            modes.push_back(batch_mode("sorted", SimdPath::sorted, isa));
        }
        modes.front().automatic = true;
        modes.push_back(single_mode());
        return modes;
    }

private:
    Mode batch_mode(const std::string& name, SimdPath path, const std::string& isa) const {
        TraceOptions options;
        options.path = path;
        options.isa = isa;
        const WideBvh* tree = &wide_;
        return {.name = "batch " + name + (isa.empty() ? "" : " " + isa),
                .closest =
                    [=](std::span<const Ray> rays, std::span<Hit> hits, int threads) {
                        TraceOptions here = options;
                        here.threads = threads;
                        trace(*tree, rays, hits, here);
                    },
                .any =
                    [=](std::span<const Ray> rays, std::span<std::uint8_t> found, int threads) {
                        TraceOptions here = options;
                        here.threads = threads;
                        trace_any(*tree, rays, found, here);
                    }};
    }

    Mode single_mode() const {
        const WideBvh* tree = &wide_;
        return {.name = "single",
                .single = true,
                .closest =
                    [=](std::span<const Ray> rays, std::span<Hit> hits, int threads) {
                        one_by_one(rays.size(), threads,
                                   [&](std::size_t i) { hits[i] = closest_hit(*tree, rays[i]); });
                    },
                .any =
                    [=](std::span<const Ray> rays, std::span<std::uint8_t> found, int threads) {
                        one_by_one(rays.size(), threads,
                                   [&](std::size_t i) { found[i] = any_hit(*tree, rays[i]); });
                    }};
    }

    const Mesh& mesh_;
    const CpuBench& bench_;
    BuildOptions build_options_;
    WideBvhOptions wide_options_;
    WideBvhBuilder builder_;
    WideBvh wide_;
};

}  // namespace

std::vector<PeerName> peers_of(const CpuBench& options) {
    std::vector<PeerName> names;
    for (const std::string& kind : options.embree) {
        static_cast<void>(embree_options(kind, 1));  // one that does not exist, before any work
        names.push_back({"embree " + kind});
    }
    for (const std::string& quality : options.qualities) names.push_back({"raydix " + quality});
    return names;
}

std::unique_ptr<Peer> make_peer(const PeerName& name, const Mesh& mesh, const CpuBench& options,
                                int threads) {
    if (name.ours()) return std::make_unique<RaydixPeer>(name.kind(), mesh, options, threads);
    return std::make_unique<EmbreePeer>(name.kind(), mesh, options, threads);
}

}  // namespace raydix::bench
