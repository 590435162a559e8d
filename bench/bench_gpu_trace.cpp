// How many rays does each warp kernel trace on a GPU? Mrays/s of the kernel alone, as Aila and
// Laine report, per scene, kind of ray and kernel. Every hit is first compared with the scalar
// reference. A JSON line each on standard output; scripts/gpu keeps them. Without a device: exit
// code 1 and the reason.
#include <fmt/format.h>
#include <raydix/device_trace.h>
#include <raydix/error.h>
#include <raydix/machine.h>
#include <raydix/model.h>
#include <raydix/rays.h>
#include <raydix/trace.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace {

using Json = nlohmann::ordered_json;

struct Options {
    std::vector<std::string> scenes{"builtin:figure?triangles=174000"};
    std::vector<std::string> kinds{"primary", "ao", "diffuse", "diffuse_shuffled"};
    std::string builder = "ploc";
    int max_leaf = 8, repeat = 20, samples = 32;
    std::uint64_t seed = 1;
    std::size_t launch_rays = std::size_t{1} << 24;
};

Json spread_json(std::vector<double> values) {
    std::ranges::sort(values);
    return {{"median", values[values.size() / 2]}, {"min", values.front()}, {"max", values.back()}};
}

/// Rays of one kind from the scene's first camera, at most `launch_rays`.
std::vector<raydix::Ray> make_rays(const Options& options, const raydix::Model& scene,
                                   const raydix::Bvh& bvh, const std::string& kind) {
    const raydix::CameraSet& set = scene.cameras;
    std::vector<std::uint32_t> pixels;
    std::vector<raydix::Ray> rays =
        make_primary_rays(set.cameras.front(), set.width, set.height, &pixels);
    if (kind != "primary") {
        const std::vector<raydix::Hit> hits = trace(bvh, rays);
        raydix::SecondaryOptions secondary;
        secondary.kind = kind == "ao"        ? raydix::RayKind::ao
                         : kind == "diffuse" ? raydix::RayKind::diffuse
                                             : raydix::RayKind::diffuse_shuffled;
        secondary.samples = options.samples;
        secondary.ao_radius = set.ao_radius;
        secondary.seed = options.seed;
        rays = make_secondary_rays(bvh, rays, hits, pixels, secondary);
    }
    if (rays.size() > options.launch_rays) rays.resize(options.launch_rays);
    return rays;
}

/// What one kind of ray needs, on the host and on the device.
struct Launch {
    std::vector<raydix::Ray> rays;
    bool any_hit;
    std::vector<raydix::TreeHit> expected;
    raydix::DeviceBuffer<raydix::Ray> device_rays;
    raydix::DeviceBuffer<raydix::TreeHit> device_hits;
};

void check_hits(const Launch& launch, raydix::WarpKernel kernel) {
    std::vector<raydix::TreeHit> hits(launch.rays.size());
    launch.device_hits.download(hits);
    for (std::size_t i = 0; i < hits.size(); ++i) {
        const bool same = launch.any_hit
                              ? hits[i].hit() == launch.expected[i].hit()
                              : std::memcmp(&hits[i], &launch.expected[i], sizeof(hits[i])) == 0;
        if (!same)
            throw std::runtime_error(fmt::format("{}: the hit of ray {} is not the reference's",
                                                 warp_kernel_name(kernel), i));
    }
}

Json measure(const raydix::DeviceWarpTree& tree, const Launch& launch, raydix::WarpKernel kernel,
             int repeat) {
    const raydix::DeviceTraceOptions options{.kernel = kernel, .any_hit = launch.any_hit};
    const auto count = static_cast<std::uint32_t>(launch.rays.size());
    const raydix::DeviceBuffer<std::byte> scratch(device_trace_scratch_bytes(tree, count, options));
    std::vector<double> kernel_rates, rates;
    for (int turn = 0; turn <= repeat; ++turn) {
        const raydix::DeviceTraceMs ms = time_trace_on_device(
            tree, {launch.device_rays.data(), count}, {launch.device_hits.data(), count}, options,
            {scratch.data(), scratch.size()}, nullptr);
        if (turn == 0) {
            check_hits(launch, kernel);
            continue;
        }
        kernel_rates.push_back(count / ms.kernel * 1e-3);
        rates.push_back(count / ms.total * 1e-3);
    }
    return {{"kernel", warp_kernel_name(kernel)},
            {"count", count},
            {"same_hits_as_reference", true},
            {"repeat", repeat},
            {"mrays_per_s", spread_json(kernel_rates)},
            {"mrays_per_s_with_preparation", spread_json(rates)}};
}

void run(const Options& options) {
    const std::string device = raydix::device_name();
    for (const std::string& name : options.scenes) {
        const raydix::Model scene = raydix::load_flat_model(name, options.seed);
        raydix::BuildOptions build;
        build.builder = raydix::builder_from_name(options.builder);
        build.max_leaf = options.max_leaf;
        const raydix::Bvh bvh = build_bvh(scene.mesh(), build);
        const raydix::WarpTree host(bvh, true);
        const raydix::DeviceWarpTree tree(host);
        for (const std::string& kind : options.kinds) {
            Launch launch;
            launch.rays = make_rays(options, scene, bvh, kind);
            launch.any_hit = kind == "ao";
            if (launch.rays.empty()) continue;
            launch.expected.resize(launch.rays.size());
            trace_reference(host, launch.rays, launch.expected, launch.any_hit);
            launch.device_rays.upload(launch.rays);
            launch.device_hits.reset(launch.rays.size());
            for (const raydix::WarpKernel kernel : raydix::warp_kernels()) {
                Json line{{"bench", "gpu_trace"},
                          {"device", device},
                          {"cpu", raydix::machine_info().cpu},
                          {"compiler", __VERSION__},
                          {"scene", scene.name},
                          {"seed", options.seed},
                          {"triangles", scene.mesh().triangles.size()},
                          {"builder", options.builder},
                          {"max_leaf", options.max_leaf},
                          {"rays", kind}};
                try {
                    line.update(measure(tree, launch, kernel, options.repeat));
                } catch (const raydix::InputError& refused) {  // short_stack, of deep trees
                    line["kernel"] = raydix::warp_kernel_name(kernel);
                    line["refused"] = refused.what();
                }
                fmt::print("{}\n", line.dump());
            }
        }
    }
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Traversal kernels on a GPU: Mrays/s per scene, kind of ray and kernel");
    Options options;
    app.add_option("--scene", options.scenes, "Scenes of triangles")->capture_default_str();
    app.add_option("--rays", options.kinds, "Kinds of rays")
        ->check(CLI::IsMember({"primary", "ao", "diffuse", "diffuse_shuffled"}))
        ->capture_default_str();
    app.add_option("--builder", options.builder, "Builder of the tree, on the host")
        ->capture_default_str();
    app.add_option("--max-leaf", options.max_leaf, "Most triangles in a leaf")
        ->capture_default_str();
    app.add_option("--launch-rays", options.launch_rays, "Most rays of a launch")
        ->check(CLI::Range(std::size_t{1}, std::size_t{1} << 30))
        ->capture_default_str();
    app.add_option("--samples", options.samples, "Secondary rays per primary hit")
        ->check(CLI::Range(1, 1024))
        ->capture_default_str();
    app.add_option("--repeat", options.repeat, "Timed launches of each kind")
        ->check(CLI::Range(1, 10000))
        ->capture_default_str();
    app.add_option("--seed", options.seed, "Seed of built-in scenes and of secondary rays")
        ->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    try {
        run(options);
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench_gpu_trace: {}\n", error.what());
        return 1;
    }
    return 0;
}
