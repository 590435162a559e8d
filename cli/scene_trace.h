// Rays through a scene that keeps its file's meshes and nodes.
#pragma once

#include <raydix/rays.h>
#include <raydix/rdx_scene.h>
#include <raydix/scene.h>

#include <optional>
#include <string>

#include "options.h"
#include "output.h"
#include "wide_trace.h"

namespace raydix::cli {

/// Whether what the options ask for can be had without one mesh and its binary tree.
[[nodiscard]] bool serves_a_scene(const TreeOptions& tree, const CommonOptions& common);
[[nodiscard]] SceneOptions scene_options(const TreeOptions& tree, const CommonOptions& common);

class SceneTracer {
public:
    SceneTracer(const Model& model, const TreeOptions& tree, const WideTraceOptions& options,
                const CommonOptions& common);
    /// Of a file that holds it.
    SceneTracer(RdxScene file, const WideTraceOptions& options, const CommonOptions& common);
    TraceCounts closest(std::span<const Ray> rays, std::span<Hit> hits) const;
    TraceCounts any(std::span<const Ray> rays, std::span<std::uint8_t> occluded) const;
    AllHits all(std::span<const Ray> rays, std::uint64_t max_result_bytes) const;

    [[nodiscard]] const Scene& scene() const { return scene_; }
    [[nodiscard]] const std::string& isa() const { return isa_; }
    [[nodiscard]] const Json& scene_json() const { return scene_json_; }
    [[nodiscard]] Json build_json() const;
    /// One mesh without instances is saved as one.
    [[nodiscard]] HitFields hit_fields() const;
    void explain(const CommonOptions& common) const;

private:
    [[nodiscard]] SceneTraceOptions trace_options() const;

    SceneTracer(const WideTraceOptions& options, const CommonOptions& common);

    std::string isa_;
    SimdPath path_;
    int threads_;
    SceneOptions made_with_;
    std::optional<double> ms_;  // of making it
    Json scene_json_;
    Scene scene_;
};

}  // namespace raydix::cli
