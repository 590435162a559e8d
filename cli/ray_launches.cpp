// Cameras -> primary rays -> launches of each kind -> the ones that a sample takes.
#include "ray_launches.h"

#include <fmt/format.h>
#include <raydix/error.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "option_checks.h"

namespace raydix::cli {
namespace {

constexpr std::size_t runs_per_camera = 4;
constexpr std::size_t least_run = 2048;  // 64 warps of 32

}  // namespace

float chosen_ao_radius(float given, const Model& scene, const Aabb& box) {
    if (given > 0) return given;
    if (scene.cameras.ao_radius > 0) return scene.cameras.ao_radius;
    if (!(box.lo.x <= box.hi.x)) return 0.0f;
    return 0.05f * std::hypot(box.hi.x - box.lo.x, box.hi.y - box.lo.y, box.hi.z - box.lo.z);
}

std::vector<Camera> chosen_cameras(const std::string& which, const Model& scene) {
    require_cameras(scene);
    const std::vector<Camera>& all = scene.cameras.cameras;
    if (which == "all") return all;
    std::size_t index = 0;
    const auto read = std::from_chars(which.data(), which.data() + which.size(), index);
    if (read.ec != std::errc() || index >= all.size())
        throw InputError(scene.name + ": camera " + which + " is past the last of " +
                         std::to_string(all.size()) + " cameras");
    return {all[index]};
}

Json asked_rays_json(const std::string& camera, Size size, int samples,
                     std::optional<RayKind> kind) {
    if (!kind) return {{"camera", nullptr}, {"size", nullptr}, {"samples", nullptr}};
    return {{"camera", camera},
            {"size", fmt::format("{}x{}", size.width, size.height)},
            {"samples", kind == RayKind::primary ? Json(nullptr) : Json(samples)}};
}

Size chosen_size(const LaunchOptions& options, const Model& scene) {
    return options.size_text.empty() ? Size{scene.cameras.width, scene.cameras.height}
                                     : parse_size(options.size_text);
}

void add_launch_options(CLI::App& command, LaunchOptions& options) {
    add_cameras_option(command, options.camera);
    add_size_option(command, options.size_text,
                    "Pixels of the cameras (default: of cameras.json, or 1024x768)");
    command.add_option("--samples", options.samples, "Secondary rays per primary hit")
        ->transform(whole_number(1, 1024))
        ->capture_default_str();
    command
        .add_option("--ao-radius", options.ao_radius,
                    "Reach of ao rays (default: of cameras.json, or 5 % of the diagonal)")
        ->check(finite_number(false));
    command
        .add_option("--sample", options.sample,
                    "Part of the rays to trace: whole launches, or runs of neighbouring rays")
        ->check(number_up_to(1, false))
        ->capture_default_str();
    command.add_option("--launch-rays", options.launch_rays, "Secondary rays of one launch")
        ->transform(whole_number(1024, 1u << 26))
        ->capture_default_str();
}

RayLaunches::RayLaunches(const LaunchOptions& options, const SceneTree& input,
                         const CommonOptions& common)
    : RayLaunches(options, input.scene, &input.bvh, common) {}

RayLaunches::RayLaunches(const LaunchOptions& options, const Model& model, const Scene& scene,
                         const CommonOptions& common)
    : RayLaunches(options, model, &scene, common) {}

RayLaunches::RayLaunches(const LaunchOptions& options, const Model& model, Traced traced,
                         const CommonOptions& common)
    : options_(options), traced_(traced), common_(common) {
    const auto bounds = [](const auto* tree) { return tree->bounds(); };
    ao_radius_ = chosen_ao_radius(options.ao_radius, model, std::visit(bounds, traced));
    const Size size = chosen_size(options, model);
    for (const Camera& camera : chosen_cameras(options.camera, model)) {
        View& view = views_.emplace_back();
        view.rays = make_primary_rays(camera, size.width, size.height, &view.pixels);
        view.hits = std::visit(
            [&](const auto* tree) { return trace(*tree, view.rays, {.threads = common.threads}); },
            traced);
    }
}

namespace {

/// 0 to n - 1 by multiples of the golden ratio, of which any run is spread evenly.
std::vector<std::size_t> spread(std::size_t n) {
    constexpr double golden = 0.61803398874989485;
    std::vector<std::pair<double, std::size_t>> keys;
    for (std::size_t k = 0; k < n; ++k) {
        const double at = golden * static_cast<double>(k);
        keys.emplace_back(at - std::floor(at), k);
    }
    std::sort(keys.begin(), keys.end());
    std::vector<std::size_t> order;
    for (const auto& [key, k] : keys) order.push_back(k);
    return order;
}

}  // namespace

std::vector<RayLaunches::Launch> RayLaunches::launches_of(RayKind kind) const {
    std::vector<Launch> launches;
    const auto samples = static_cast<std::size_t>(options_.samples);
    const std::size_t step = std::max<std::size_t>(1, options_.launch_rays / samples);
    for (std::size_t v = 0; v < views_.size(); ++v) {
        const View& view = views_[v];
        if (kind == RayKind::primary) {
            launches.push_back({v, 0, view.rays.size(), view.rays.size()});
            continue;
        }
        for (std::size_t begin = 0; begin < view.rays.size();) {
            // A launch takes primary rays until it has `step` hits.
            std::size_t end = begin, found = 0;
            for (; end < view.rays.size() && found < step; ++end) found += view.hits[end].hit();
            if (found > 0) launches.push_back({v, begin, end, found * samples});
            begin = end;
        }
    }
    return launches;
}

std::vector<Ray> RayLaunches::rays_of(RayKind kind, const Launch& launch) const {
    const View& view = views_[launch.view];
    if (kind == RayKind::primary) return view.rays;
    SecondaryOptions secondary;
    secondary.kind = kind;
    secondary.samples = options_.samples;
    secondary.ao_radius = ao_radius_;
    secondary.seed = common_.seed;
    secondary.threads = common_.threads;
    const auto part = [&](const auto& values) {
        return std::span(values).subspan(launch.begin, launch.end - launch.begin);
    };
    return std::visit(
        [&](const auto* tree) {
            return make_secondary_rays(*tree, part(view.rays), part(view.hits), part(view.pixels),
                                       secondary);
        },
        traced_);
}

double RayLaunches::for_each(RayKind kind, const std::function<void(const RayUnit&, double)>& visit,
                             const std::function<bool(double)>& more, std::size_t done) const {
    struct Unit {
        std::size_t launch, begin, count;  // rays of the launch
    };
    const std::vector<Launch> launches = launches_of(kind);
    std::vector<Unit> units;
    std::size_t taken = 0, there = 0;  // rays
    for (std::size_t first = 0; first < launches.size();) {
        std::size_t last = first, rays = 0;
        for (; last < launches.size() && launches[last].view == launches[first].view; ++last)
            rays += launches[last].rays;
        const auto here = static_cast<double>(last - first);
        const auto whole = static_cast<std::size_t>(std::llround(options_.sample * here));
        const double target = options_.sample * static_cast<double>(rays) / runs_per_camera;
        const std::size_t length =
            std::max(least_run, (static_cast<std::size_t>(target) + 63) / 64 * 64);
        there += rays;
        if (runs_per_camera * length >= rays) {  // runs would overlap: all there is
            for (std::size_t at = first; at < last; ++at)
                units.push_back({at, 0, launches[at].rays});
        } else if (whole >= 1 && options_.sample * here >= 0.5) {
            // Evenly spaced, in the middle of equal parts of the view.
            for (std::size_t k = 0; k < whole; ++k) {
                const std::size_t at = first + (2 * k + 1) * (last - first) / (2 * whole);
                units.push_back({at, 0, launches[at].rays});
            }
        } else {
            for (std::size_t k = 0; k < runs_per_camera; ++k) {
                std::size_t position = (2 * k + 1) * rays / (2 * runs_per_camera), at = first;
                while (position >= launches[at].rays) position -= launches[at++].rays;
                const std::size_t count = std::min(length, launches[at].rays);
                // Runs begin at a multiple of 64, as warps do.
                const std::size_t begin = std::min(position, launches[at].rays - count) / 64 * 64;
                units.push_back({at, begin, std::min(count, launches[at].rays - begin)});
            }
        }
        first = last;
    }
    const auto part_taken = [&] {
        return there > 0 ? static_cast<double>(taken) / static_cast<double>(there) : 1.0;
    };
    std::size_t made = launches.size(), k = 0;
    std::vector<Ray> rays;
    for (const std::size_t at : spread(units.size())) {
        const Unit& unit = units[at];
        if (k >= done && !more(part_taken())) break;
        taken += unit.count;
        if (k++ < done) continue;
        if (made != unit.launch) rays = rays_of(kind, launches[unit.launch]);
        made = unit.launch;
        visit({std::span(rays).subspan(unit.begin, unit.count),
               static_cast<double>(unit.count) / static_cast<double>(rays.size())},
              static_cast<double>(k) / static_cast<double>(units.size()));
    }
    return part_taken();
}

}  // namespace raydix::cli
