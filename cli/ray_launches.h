// Rays of the protocol as launches: what `simulate` and `bench traversal` send through kernels.
#pragma once

#include <raydix/model.h>
#include <raydix/rays.h>
#include <raydix/scene.h>
#include <raydix/trace.h>

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "options.h"
#include "output.h"

namespace raydix::cli {

struct LaunchOptions {
    std::string camera = "all", size_text, rays_file;
    int samples = 32;                      // secondary rays per primary hit
    float ao_radius = 0.0f;                // 0: of cameras.json, or 5 % of the diagonal
    double sample = 1.0;                   // part of the rays, in (0, 1]
    std::uint32_t launch_rays = 1u << 20;  // secondary rays of one launch
};
void add_launch_options(CLI::App& command, LaunchOptions& options);

/// What a row of a document says of its rays, in the terms of the command line: camera, size and
/// samples. Null: of no use to them. `kind`: none for rays of a file.
[[nodiscard]] Json asked_rays_json(const std::string& camera, Size size, int samples,
                                   std::optional<RayKind> kind);

/// A launch, or a run of neighbouring rays of one.
struct RayUnit {
    std::span<const Ray> rays;
    double part;  // of the launch; 1: the launch as it is
    [[nodiscard]] bool whole() const { return part == 1.0; }
};

/// Cameras with their primary rays and hits, made once.
class RayLaunches {
public:
    RayLaunches(const LaunchOptions& options, const SceneTree& input, const CommonOptions& common);
    /// `scene` holds the mesh of `model` alone: the same rays as from its tree.
    RayLaunches(const LaunchOptions& options, const Model& model, const Scene& scene,
                const CommonOptions& common);

    /// Calls visit(unit, part of the work done) for the launches of one kind, or of those that
    /// `sample` picks: whole launches spread over all cameras if there are enough, else runs of
    /// neighbouring rays, or everything where those would overlap; never single rays. The order
    /// jumps about among them, so that the first ones are a sample of all. The first `done` are not
    /// visited again. Ends before the first other one for which more(part of all rays so far) is
    /// false. Returns that part.
    double for_each(
        RayKind kind, const std::function<void(const RayUnit&, double)>& visit,
        const std::function<bool(double)>& more = [](double) { return true; },
        std::size_t done = 0) const;

    /// Launches of a kind, traced or not.
    [[nodiscard]] std::size_t count(RayKind kind) const { return launches_of(kind).size(); }
    [[nodiscard]] float ao_radius() const { return ao_radius_; }
    [[nodiscard]] std::size_t cameras() const { return views_.size(); }

private:
    using Traced = std::variant<const Bvh*, const Scene*>;
    RayLaunches(const LaunchOptions& options, const Model& model, Traced traced,
                const CommonOptions& common);

    struct View {
        std::vector<Ray> rays;
        std::vector<Hit> hits;
        std::vector<std::uint32_t> pixels;
    };
    /// Primary rays [begin, end) of a view make one launch.
    struct Launch {
        std::size_t view, begin, end, rays;
    };
    [[nodiscard]] std::vector<Launch> launches_of(RayKind kind) const;
    [[nodiscard]] std::vector<Ray> rays_of(RayKind kind, const Launch& launch) const;

    const LaunchOptions& options_;
    Traced traced_;
    const CommonOptions& common_;
    float ao_radius_ = 0.0f;
    std::vector<View> views_;
};

/// --camera, as add_cameras_option takes it: all of the scene's, or one.
[[nodiscard]] std::vector<Camera> chosen_cameras(const std::string& which, const Model& scene);
/// --size, or of cameras.json.
[[nodiscard]] Size chosen_size(const LaunchOptions& options, const Model& scene);
/// Given, of cameras.json, or 5 % of the box diagonal, in this order.
[[nodiscard]] float chosen_ao_radius(float given, const Model& scene, const Aabb& bounds);

}  // namespace raydix::cli
