#include "cpu_peers.h"

#include <fmt/format.h>
#include <raydix/raydix.h>
#include <raydix/wide.h>

#include <algorithm>
#include <stdexcept>

#include "bench_clock.h"
#include "embree_kinds.h"
#include "embree_scene.h"
#include "embree_trace.h"
#include "embree_tree.h"
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
          robust_((options_.flags & RTC_SCENE_FLAG_ROBUST) != 0),
          device_(threads) {}

    void build() override {
        if (!group_) {
            group_.emplace(device_, options_.quality, options_.flags);
            add_mesh(*group_, mesh_);
        } else {
            rtcUpdateGeometryBuffer(group_->geometry(0), RTC_BUFFER_TYPE_VERTEX, 0);
            rtcCommitGeometry(group_->geometry(0));
        }
        group_->commit();
    }

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
        EmbreeTree tree(mesh_, options_.threads, BuildOptions().max_leaf);
        tree.refill();
        tree.build();
        return tree_stats(tree.as_bvh(mesh_), {.with_hash = false}).sah;
    }

    /// ROBUST trees stand beside our single calls alone.
    std::vector<Mode> modes() const override {
        std::vector<Mode> modes;
        const RTCScene scene = group_->scene();
        for (const EmbreeMode mode : embree_modes)
            if (mode.single() || !robust_ || bench_.all_paths)
                modes.push_back(
                    {.name = mode.name(),
                     .single = mode.single(),
                     .closest = [=](std::span<const Ray> rays,
                                    std::span<Hit> hits) { trace_embree(scene, mode, rays, hits); },
                     .any =
                         [=](std::span<const Ray> rays, std::span<std::uint8_t> found) {
                             trace_any_embree(scene, mode, rays, found);
                         }});
        return modes;
    }

private:
    const Mesh& mesh_;
    const CpuBench& bench_;
    EmbreeOptions options_;
    bool robust_;
    EmbreeDevice device_;
    std::optional<EmbreeGroup> group_;
};

Quality quality_of(const std::string& word) {
    return word == "fast" ? Quality::fast : word == "high" ? Quality::high : Quality::balanced;
}

/// A scene of one mesh.
class RaydixPeer : public Peer {
public:
    RaydixPeer(const PeerName& name, const Mesh& mesh, const CpuBench& bench, int threads)
        : mesh_(mesh), bench_(bench) {
        options_.quality = quality_of(name.quality());
        options_.compact = name.kind().ends_with("+compact");
        options_.threads = threads;
    }

    void build() override {
        const clockid_t clock = clock_from(bench_.clock);
        const double start = seconds_of(clock);
        if (!scene_) {
            scene_.emplace();
            scene_->add(mesh_);
        } else {
            scene_->update(0, mesh_);
        }
        copy_ms_ = 1e3 * (seconds_of(clock) - start);
        report_ = scene_->commit(options_);
        if (report_.trees_built != 1)
            throw std::runtime_error("a commit of a changed mesh has built no tree");
    }

    std::optional<double> copy_ms() const override { return copy_ms_; }
    PeerBytes bytes() override { return {report_.bytes, 0}; }
    std::optional<double> sah() override {
        BuildOptions build = build_options_for(options_.quality);
        build.threads = options_.threads;
        return tree_stats(build_bvh(mesh_, build), {.with_hash = false}).sah;
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
        SceneTraceOptions options;
        options.path = path;
        options.isa = isa;
        const Scene* scene = &*scene_;
        return {
            .name = "batch " + name + (isa.empty() ? "" : " " + isa),
            .closest = [=](std::span<const Ray> rays,
                           std::span<Hit> hits) { trace(*scene, rays, hits, options); },
            .any = [=](std::span<const Ray> rays,
                       std::span<std::uint8_t> found) { trace_any(*scene, rays, found, options); }};
    }

    Mode single_mode() const {
        const Scene* scene = &*scene_;
        return {.name = "single",
                .single = true,
                .closest =
                    [=](std::span<const Ray> rays, std::span<Hit> hits) {
                        one_by_one(rays.size(),
                                   [&](std::size_t i) { hits[i] = closest_hit(*scene, rays[i]); });
                    },
                .any =
                    [=](std::span<const Ray> rays, std::span<std::uint8_t> found) {
                        one_by_one(rays.size(),
                                   [&](std::size_t i) { found[i] = any_hit(*scene, rays[i]); });
                    }};
    }

    const Mesh& mesh_;
    const CpuBench& bench_;
    SceneOptions options_;
    std::optional<Scene> scene_;
    CommitReport report_;
    double copy_ms_ = 0;
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
    if (name.ours()) return std::make_unique<RaydixPeer>(name, mesh, options, threads);
    return std::make_unique<EmbreePeer>(name.kind(), mesh, options, threads);
}

}  // namespace raydix::bench
