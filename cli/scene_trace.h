// Rays through a scene that keeps its file's meshes and nodes.
#pragma once

#include <raydix/scene.h>

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
    TraceCounts closest(std::span<const Ray> rays, std::span<Hit> hits) const;
    TraceCounts any(std::span<const Ray> rays, std::span<std::uint8_t> occluded) const;
    AllHits all(std::span<const Ray> rays, std::uint64_t max_result_bytes) const;

    [[nodiscard]] const Scene& scene() const { return scene_; }
    [[nodiscard]] const std::string& isa() const { return isa_; }
    [[nodiscard]] Json build_json() const;
    void explain(const CommonOptions& common) const;

private:
    [[nodiscard]] SceneTraceOptions trace_options() const;

    std::string quality_, isa_;
    SimdPath path_;
    bool compact_;
    int threads_;
    double ms_ = 0;
    Scene scene_;
};

}  // namespace raydix::cli
