// raydix trace: rays of the protocol, or from a file, through a tree; rates and counts.
#include <fmt/format.h>
#include <raydix/error.h>
#include <raydix/rays.h>
#include <raydix/result_limit.h>
#include <raydix/scene_info.h>
#include <raydix/trace.h>

#include <chrono>
#include <functional>
#include <memory>
#include <optional>

#include "kdtree_commands.h"
#include "option_checks.h"
#include "output.h"
#include "ray_launches.h"
#include "scene_file.h"
#include "scene_trace.h"
#include "simulation.h"
#include "warp_trace.h"
#include "wide_trace.h"

namespace raydix::cli {
namespace {

constexpr std::size_t launch_rays = std::size_t{1}
                                    << 20;  // secondary rays are traced in batches of this size

enum class Mode { closest, any, all };

struct TraceCommand {
    CommonOptions common;
    TreeOptions tree;
    std::string scene, rays = "primary", mode_name, kernel, machine = "gtx480", camera = "all",
                       hits_file, rays_file;
    std::string size_text;
    int samples = 32, repeat = 5;
    float ao_radius = 0.0f;
    bool explain = false;
    WideTraceOptions wide;
    std::uint64_t max_result_bytes = 0;
};

/// Figures that grow with each batch.
struct Tally {
    TraceCounts counts;
    std::vector<double> seconds;     // of all batches, for each repeat
    std::vector<double> end_to_end;  // the same on a GPU, with the copies to it and from it
    bool warm = false;
};

struct Batch {
    const Bvh& bvh;
    Mode mode;
    const CommonOptions& common;
    const KdTree* kdtree;                // traced instead of the bvh if not null
    WarpTracer* warps;                   // traces instead of the CPU if not null
    WideTracer* wide;                    // traces instead of the bvh if not null
    const SceneTracer* scene;            // the same; there is no bvh then
    std::vector<Hit> hits;               // of the last run, closest and all
    std::vector<std::uint64_t> offsets;  // of the last run, all
    std::vector<std::uint8_t> occluded;
    std::uint64_t result_limit = 0;  // of all hits, those that are kept included; 0: of one run
    std::uint64_t kept_bytes = 0;

    TraceCounts run(std::span<const Ray> rays, bool counters) {
        const TraceOptions options{.threads = common.threads, .counters = counters};
        if (mode == Mode::any) {
            occluded.resize(rays.size());
            if (kdtree != nullptr) return kd_trace_any(*kdtree, rays, occluded, options);
            if (wide != nullptr) return wide->any(rays, occluded, options);
            if (scene != nullptr) return scene->any(rays, occluded);
            return trace_any(bvh, rays, occluded, options);
        }
        if (mode == Mode::all) return run_all(rays, options);
        hits.resize(rays.size());
        if (kdtree != nullptr) return kd_trace(*kdtree, rays, hits, options);
        if (wide != nullptr) return wide->closest(rays, hits, options);
        if (scene != nullptr) return scene->closest(rays, hits);
        return trace(bvh, rays, hits, options);
    }

    [[nodiscard]] Aabb bounds() const {
        return scene != nullptr ? scene->scene().bounds() : bvh.bounds();
    }
    /// What secondary rays start from.
    [[nodiscard]] std::vector<Hit> primary_hits(std::span<const Ray> rays) const {
        std::vector<Hit> found(rays.size());
        const TraceOptions options{.threads = common.threads};
        if (scene != nullptr)
            scene->closest(rays, found);
        else if (wide != nullptr)
            wide->closest(rays, found, options);
        else
            trace(bvh, rays, found, options);
        return found;
    }
    [[nodiscard]] std::vector<Ray> secondary_rays(std::span<const Ray> rays,
                                                  std::span<const Hit> found,
                                                  std::span<const std::uint32_t> pixels,
                                                  const SecondaryOptions& options) const {
        return scene != nullptr ? make_secondary_rays(scene->scene(), rays, found, pixels, options)
                                : make_secondary_rays(bvh, rays, found, pixels, options);
    }

private:
    TraceCounts run_all(std::span<const Ray> rays, TraceOptions options) {
        hits = {};  // never two results at once
        offsets = {};
        if (result_limit != 0 && kept_bytes >= result_limit)
            throw ResultTooLarge("all hits", result_limit, false, result_limit);
        options.max_result_bytes = result_limit - kept_bytes;
        try {
            AllHits all = scene != nullptr  ? scene->all(rays, options.max_result_bytes)
                          : wide != nullptr ? wide->all(rays, options)
                                            : trace_all(bvh, rays, options);
            hits = std::move(all.hits);
            offsets = std::move(all.offsets);
            return all.counts;
        } catch (const ResultTooLarge& error) {
            if (kept_bytes == 0) throw;
            throw ResultTooLarge("all hits", kept_bytes + error.bytes(), error.is_exact(),
                                 result_limit);
        }
    }
};

/// The same on a GPU, where the kernel's own time counts, or once in the simulator.
void measure_warps(Batch& batch, std::span<const Ray> rays, int repeat, Tally& tally) {
    WarpTracer& warps = *batch.warps;
    warps.run(rays, batch.hits, true);
    tally.counts.rays += rays.size();
    tally.counts.invalid_rays = warps.invalid_rays();
    batch.occluded.clear();
    for (const Hit& hit : batch.hits) {
        tally.counts.hits += hit.hit();
        batch.occluded.push_back(hit.hit());
    }
    if (warps.is_simulated()) return;
    if (!tally.warm) warps.run(rays, batch.hits, false);
    tally.warm = true;
    tally.seconds.resize(static_cast<std::size_t>(repeat), 0.0);
    tally.end_to_end.resize(static_cast<std::size_t>(repeat), 0.0);
    for (std::size_t k = 0; k < tally.seconds.size(); ++k) {
        const WarpTracer::Times times = warps.run(rays, batch.hits, false);
        tally.seconds[k] += times.kernel_s;
        tally.end_to_end[k] += times.end_to_end_s;
    }
}

/// Traces one batch: once to count (and warm up), then `repeat` times on the clock.
void measure(Batch& batch, std::span<const Ray> rays, int repeat, Tally& tally) {
    if (batch.warps != nullptr) return measure_warps(batch, rays, repeat, tally);
    const TraceCounts counts = batch.run(rays, true);
    tally.counts.rays += counts.rays;
    tally.counts.hits += counts.hits;
    tally.counts.invalid_rays += counts.invalid_rays;
    tally.counts.node_visits += counts.node_visits;
    tally.counts.triangle_tests += counts.triangle_tests;
    if (!tally.warm) batch.run(rays, false);
    tally.warm = true;
    tally.seconds.resize(static_cast<std::size_t>(repeat), 0.0);
    for (double& seconds : tally.seconds) {
        const auto start = std::chrono::steady_clock::now();
        batch.run(rays, false);
        seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    }
}

/// What is kept of the rays and hits for files.
struct Kept {
    std::vector<Ray> rays;
    std::vector<Hit> hits;
    std::vector<std::uint64_t> offsets{0};  // all hits: where those of each ray begin
    std::vector<std::uint8_t> occluded;     // any hits

    [[nodiscard]] std::uint64_t bytes() const {
        return hits.capacity() * sizeof(Hit) + offsets.capacity() * sizeof(std::uint64_t);
    }
};

/// Moves all hits of a batch behind those that are kept. For a while both and the longer list that
/// takes them are there.
void keep_all_hits(Batch& batch, Kept& kept) {
    const std::uint64_t batch_bytes =
        batch.hits.capacity() * sizeof(Hit) + batch.offsets.capacity() * sizeof(std::uint64_t);
    const std::uint64_t longer =
        (kept.hits.size() + batch.hits.size()) * sizeof(Hit) +
        (kept.offsets.size() + batch.offsets.size()) * sizeof(std::uint64_t);
    if (kept.hits.empty()) {
        kept.hits = std::move(batch.hits);
    } else {
        require_result_bytes("all hits", kept.bytes() + batch_bytes + longer, batch.result_limit);
        kept.hits.reserve(kept.hits.size() + batch.hits.size());
        kept.hits.insert(kept.hits.end(), batch.hits.begin(), batch.hits.end());
    }
    batch.hits = {};
    const std::uint64_t before = kept.offsets.back();
    kept.offsets.reserve(kept.offsets.size() + batch.offsets.size());
    for (std::size_t i = 1; i < batch.offsets.size(); ++i)
        kept.offsets.push_back(before + batch.offsets[i]);
    batch.offsets = {};
    batch.kept_bytes = kept.bytes();
}

void keep(const TraceCommand& options, std::span<const Ray> rays, Batch& batch, Kept& kept) {
    if (!options.rays_file.empty()) kept.rays.insert(kept.rays.end(), rays.begin(), rays.end());
    if (options.hits_file.empty()) return;
    if (batch.mode == Mode::all) return keep_all_hits(batch, kept);
    if (batch.mode == Mode::any) {
        kept.occluded.insert(kept.occluded.end(), batch.occluded.begin(), batch.occluded.end());
        return;
    }
    kept.hits.insert(kept.hits.end(), batch.hits.begin(), batch.hits.end());
}

/// hits.npy; all hits also have hits.offsets.npy beside it.
void save_kept(const TraceCommand& options, Mode mode, const Kept& kept, HitFields fields) {
    if (!options.rays_file.empty()) save_rays(options.rays_file, kept.rays);
    if (options.hits_file.empty()) return;
    if (mode == Mode::any) return save_occluded(options.hits_file, kept.occluded);
    save_hits(options.hits_file, kept.hits, fields);
    if (mode == Mode::all) save_offsets(offsets_file(options.hits_file), kept.offsets);
}

RayKind ray_kind(const std::string& name) {
    for (const RayKind kind : {RayKind::ao, RayKind::diffuse, RayKind::diffuse_shuffled})
        if (ray_kind_name(kind) == name) return kind;
    return RayKind::primary;
}

/// All batches of one kind of ray from one camera.
void trace_camera(const TraceCommand& options, const SceneTree& input, const Camera& camera,
                  RayKind kind, Size size, Batch& batch, Tally& tally, Kept& kept,
                  const std::function<void(double)>& progress) {
    std::vector<std::uint32_t> pixels;
    const std::vector<Ray> primary = make_primary_rays(camera, size.width, size.height, &pixels);
    if (kind == RayKind::primary) {
        measure(batch, primary, options.repeat, tally);
        keep(options, primary, batch, kept);
        return progress(1.0);
    }
    const std::vector<Hit> hits = batch.primary_hits(primary);
    SecondaryOptions secondary;
    secondary.kind = kind;
    secondary.samples = options.samples;
    secondary.ao_radius = chosen_ao_radius(options.ao_radius, input.scene, batch.bounds());
    secondary.seed = options.common.seed;
    secondary.threads = options.common.threads;
    const std::size_t step =
        std::max<std::size_t>(1, launch_rays / static_cast<std::size_t>(options.samples));
    for (std::size_t begin = 0; begin < primary.size();) {
        // A batch takes primary rays until it has `step` hits.
        std::size_t end = begin;
        for (std::size_t found = 0; end < primary.size() && found < step; ++end)
            found += hits[end].hit();
        const std::span<const Ray> part = std::span(primary).subspan(begin, end - begin);
        const std::vector<Ray> rays =
            batch.secondary_rays(part, std::span(hits).subspan(begin, part.size()),
                                 std::span(pixels).subspan(begin, part.size()), secondary);
        if (!rays.empty()) measure(batch, rays, options.repeat, tally);
        if (!rays.empty()) keep(options, rays, batch, kept);
        begin = end;
        progress(static_cast<double>(begin) / static_cast<double>(primary.size()));
    }
}

/// Mrays/s of each repeat; null if nothing was timed.
Json rates_json(const Tally& tally, const std::vector<double>& all_seconds) {
    std::vector<double> rates;
    for (const double seconds : all_seconds)
        rates.push_back(static_cast<double>(tally.counts.rays) / seconds / 1e6);
    return rates.empty() ? Json(nullptr) : spread_json(spread_of(rates));
}

/// Which rays they were, and how they went, in the terms of the command line.
Json asked_json(const TraceCommand& options, Size size) {
    const bool from_file = options.rays.ends_with(".npy");
    Json asked = asked_rays_json(options.camera, size, options.samples,
                                 from_file ? std::nullopt : std::optional(ray_kind(options.rays)));
    const std::string& cameras = options.tree.cameras_file;
    asked["cameras"] = from_file || cameras.empty() ? Json(nullptr) : Json(cameras);
    asked["repeat"] = options.repeat;
    asked["isa"] = asked["ao_radius"] = nullptr;
    asked["path"] = options.kernel == "engine" ? Json(options.wide.path) : Json(nullptr);
    return asked;
}

Json trace_json(const TraceCommand& options, const std::string& mode, const Tally& tally,
                const WarpTracer* warps, bool counts_visits) {
    const auto per_ray = [&](std::uint64_t n) {
        return tally.counts.rays && counts_visits
                   ? Json(static_cast<double>(n) / static_cast<double>(tally.counts.rays))
                   : Json(nullptr);
    };
    Json json{{"rays", options.rays},
              {"mode", mode},
              {"kernel", options.kernel},
              {"device", options.tree.device},
              {"count", tally.counts.rays},
              {"hits", tally.counts.hits},
              {"invalid_rays", tally.counts.invalid_rays},
              {"mrays_per_s", rates_json(tally, tally.seconds)},
              {"node_visits_per_ray", per_ray(tally.counts.node_visits)},
              {"triangle_tests_per_ray", per_ray(tally.counts.triangle_tests)}};
    if (warps == nullptr) return json;
    if (warps->is_simulated()) {
        json["simulated"] = warps->simulated_json();
    } else {
        json["device_name"] = device_name();
        json["mrays_per_s_end_to_end"] = rates_json(tally, tally.end_to_end);
    }
    return json;
}

void print_trace(const Json& trace) {
    fmt::print("\n{:<18} {:>12} {:>12} {:>9} {:>9} {:>9} {:>11} {:>14}\n", "rays", "count", "hits",
               "Mrays/s", "min", "max", "nodes/ray", "triangles/ray");
    const auto count = trace["count"].get<std::uint64_t>();
    if (count == 0) return fmt::print("{:<18} {:>12}\n", trace["rays"].get<std::string>(), "none");
    const Json& rate = trace["mrays_per_s"];
    const auto per_ray = [&](const char* field, int digits) {
        return trace[field].is_null() ? std::string("-")
                                      : fmt::format("{:.{}f}", trace[field].get<double>(), digits);
    };
    fmt::print("{:<18} {:>12} {:>12} {:>9.2f} {:>9.2f} {:>9.2f} {:>11} {:>14}\n",
               trace["rays"].get<std::string>(), grouped(count),
               grouped(trace["hits"].get<std::uint64_t>()), rate["median"].get<double>(),
               rate["min"].get<double>(), rate["max"].get<double>(),
               per_ray("node_visits_per_ray", 1), per_ray("triangle_tests_per_ray", 2));
    print_invalid_rays(trace["invalid_rays"].get<std::uint64_t>());
}

Mode mode_of(const TraceCommand& options) {
    const std::string name = !options.mode_name.empty() ? options.mode_name
                             : options.rays == "ao"     ? "any"
                                                        : "closest";
    return name == "any" ? Mode::any : name == "all" ? Mode::all : Mode::closest;
}

const char* mode_text(Mode mode) {
    return mode == Mode::any ? "any" : mode == Mode::all ? "all" : "closest";
}

void explain(const TraceCommand& options, const Bvh& bvh) {
    if (!options.explain || !options.common.prints_tables()) return;
    fmt::print(
        "kernel {}: binary layout, width 2, stack of {} entries, x86-64-v2 code without vector "
        "paths, {} rays a "
        "block\n",
        options.kernel, bvh.max_depth(), 1024);
}

void explain_warps(const TraceCommand& options, const Bvh& bvh) {
    if (!options.explain || !options.common.prints_tables()) return;
    const WarpKernel kernel = warp_kernel_from_name(options.kernel);
    const char* const nodes =
        reads_wide_nodes(kernel) ? "cwbvh nodes of 80 bytes, width 8" : "pair64 nodes, width 2";
    std::string stacks = fmt::format("stacks of {} entries", bvh.max_depth() + 1);
    if (reads_wide_nodes(kernel)) stacks = "stacks of two entries a level";
    if (has_short_stack(kernel)) stacks = "stacks of four entries in registers";
    fmt::print("kernel {}: {}, woop48 triangles, warps of 32, {}, tree built on the cpu\n",
               options.kernel, nodes, stacks);
}

/// What the options say about the device, before any work. The tree is built on the cpu.
TraceCommand with_device(TraceCommand options, Mode mode) {
    options.kernel = chosen_cpu_kernel(options.kernel, options.tree, options.wide);
    if (options.kernel != "engine") refuse_layout(options.tree);
    const std::string device = options.tree.device;
    if (options.kernel.empty()) options.kernel = default_kernel(device);
    check_kernel(options.kernel, device);
    if (device == "cpu") return options;
    if (options.tree.tree != "bvh")
        throw CLI::ValidationError(
            "--tree", "device " + device + " traces a bvh, not a " + options.tree.tree);
    if (mode == Mode::all)
        throw CLI::ValidationError("--mode", "all hits are found on the cpu only");
    if (device == "sim") {
        const SimulateOptions run{.machine = machine_from(options.machine)};
        check_machine(options.machine, std::span(&run, 1));
    } else {
        select_device(device);
    }
    return options;
}

/// A scene of several meshes or nodes stays one, if the options allow it.
KdTraced load_traced(const TraceCommand& options, const TreeOptions& on_cpu,
                     std::optional<SceneTracer>& scene) {
    if (is_scene_file(options.scene)) {
        if (options.kernel != "engine")
            throw CLI::ValidationError("--kernel", options.kernel + " needs one binary tree; " +
                                                       options.scene +
                                                       " holds a scene, which the engine traces");
        RdxScene file = load_scene_file(options.scene, options.tree, options.common);
        Model model = model_of(file);
        scene.emplace(std::move(file), options.wide, options.common);
        return {{std::move(model), {}}, {}};
    }
    const bool keeps = options.kernel == "engine" && !is_rdx(options.scene) &&
                       serves_a_scene(options.tree, options.common);
    if (!keeps) return load_kdtree_traced(options.scene, on_cpu, options.common);
    Model model = load_structured_model(options.scene, on_cpu, options.common);
    if (model.is_flat())
        return {tree_of(std::move(model), options.scene, on_cpu, options.common), {}};
    scene.emplace(model, options.tree, options.wide, options.common);
    return {{std::move(model), {}}, {}};
}

void run_trace(const TraceCommand& given) {
    const Mode mode = mode_of(given);
    TraceCommand options = with_device(given, mode);
    refuse_build_options(options.scene, options.tree);
    TreeOptions on_cpu = options.tree;
    on_cpu.device = "cpu";
    std::optional<SceneTracer> scene;
    const KdTraced traced = load_traced(options, on_cpu, scene);
    say_flattened(options.scene, options.common);
    const bool through_kdtree = traced.kdtree.has_value();
    if (through_kdtree && given.kernel.empty()) options.kernel = default_kernel("cpu");
    if (options.max_result_bytes != 0 && mode != Mode::all)
        throw CLI::ValidationError("--max-result-bytes", "belongs to --mode all");
    if (through_kdtree && mode == Mode::all)
        throw CLI::ValidationError("--mode",
                                   "all hits go through a bvh; a kdtree gives the closest or any");
    const SceneTree& input = traced.input;
    const Size size = options.size_text.empty()
                          ? Size{input.scene.cameras.width, input.scene.cameras.height}
                          : parse_size(options.size_text);
    std::optional<WarpTracer> warps;
    if (options.tree.device != "cpu")
        about(options.scene, [&] {
            warps.emplace(input.bvh,
                          WarpTracer::Settings{options.tree.device, options.kernel, options.machine,
                                               mode == Mode::any, options.common.threads});
        });
    std::optional<WideTracer> wide;
    if (options.kernel == "engine" && !scene)
        about(options.scene,
              [&] { wide.emplace(input.bvh, options.tree.layout, options.wide, options.common); });
    Batch batch{input.bvh,
                mode,
                options.common,
                through_kdtree ? &*traced.kdtree : nullptr,
                warps ? &*warps : nullptr,
                wide ? &*wide : nullptr,
                scene ? &*scene : nullptr,
                {},
                {},
                {},
                options.max_result_bytes,
                0};
    // What several batches keep has one limit, by the memory that is left before the first.
    if (!options.hits_file.empty() && options.max_result_bytes == 0)
        batch.result_limit = usual_result_bytes();
    Tally tally;
    Kept kept;
    if (!through_kdtree && !warps && !wide && !scene) explain(options, input.bvh);
    if (wide && options.explain) wide->explain_tree(options.common);
    if (scene && options.explain) scene->explain(options.common);
    if (warps) explain_warps(options, input.bvh);
    if (through_kdtree && options.explain) explain_kdtree(*traced.kdtree, options.common);
    if (options.rays.ends_with(".npy")) {
        const std::vector<Ray> rays = load_rays(options.rays);
        if (!rays.empty())
            about(options.scene, [&] { measure(batch, rays, options.repeat, tally); });
        keep(options, rays, batch, kept);
    } else {
        const std::vector<Camera> cameras =
            about(options.scene, [&] { return chosen_cameras(options.camera, input.scene); });
        Progress progress("tracing", options.common);
        for (std::size_t c = 0; c < cameras.size(); ++c)
            about(options.scene, [&] {
                trace_camera(options, input, cameras[c], ray_kind(options.rays), size, batch, tally,
                             kept, [&](double part) {
                                 progress.show((static_cast<double>(c) + part) /
                                               static_cast<double>(cameras.size()));
                             });
            });
    }
    save_kept(options, mode, kept, scene ? scene->hit_fields() : HitFields::tree);
    Json document = new_document("trace");
    document["scene"] = scene ? scene->scene_json() : scene_json(input.scene);
    tell_left_out(document, scene ? left_out_triangles(scene->scene()) : input.bvh.left_out(),
                  options.common);
    document["load_ms"] = input.scene.load_ms;
    const std::vector<BuildMs> builds =
        is_rdx(options.scene) ? std::vector<BuildMs>{} : std::vector{input.bvh.build_ms()};
    document["build"] =
        scene ? scene->build_json()
        : through_kdtree
            ? kdtree_json(*traced.kdtree, {traced.kdtree->build_ms()})
            : build_json(input.bvh,
                         tree_stats(input.bvh, stats_options(options.tree, options.common)), builds,
                         options.tree.epo_sample);
    if (wide) add_traced_wide(document["build"], input.bvh, wide->tree(), builds);
    document["trace"] =
        Json::array({trace_json(options, mode_text(mode), tally, batch.warps, !warps && !scene)});
    document["trace"][0].update(asked_json(options, size));
    if (wide) {
        document["trace"][0]["isa"] = wide->isa();
        document["trace"][0]["paths"] = wide->paths_json();
        if (options.explain) wide->explain_paths(options.common);
    }
    if (scene) document["trace"][0]["isa"] = scene->isa();
    if (options.rays == "ao") {
        const float radius = chosen_ao_radius(options.ao_radius, input.scene, batch.bounds());
        document["trace"][0]["ao_radius"] = radius;
        if (options.common.prints_tables()) fmt::print("ao radius {:g}\n", radius);
    }
    if (options.common.prints_tables())
        warps ? print_warp_trace(document["trace"][0]) : print_trace(document["trace"][0]);
    write_json(document, options.common);
}

}  // namespace

void add_trace_command(CLI::App& app) {
    auto options = std::make_shared<TraceCommand>();
    CLI::App* command =
        app.add_subcommand("trace", "Trace rays through a tree; print rates and counts");
    command
        ->add_option("SCENE", options->scene, "A file, builtin:NAME?key=value&..., or a .rdx file")
        ->required();
    command
        ->add_option("--rays", options->rays,
                     "primary, ao, diffuse, diffuse_shuffled, or a (N, 8) float32 .npy file")
        ->check([](const std::string& text) {
            const bool known = text == "primary" || text == "ao" || text == "diffuse" ||
                               text == "diffuse_shuffled";
            return known || text.ends_with(".npy")
                       ? ""
                       : "'" + text + "' is neither a kind of ray nor a .npy file";
        })
        ->capture_default_str();
    command
        ->add_option("--mode", options->mode_name,
                     "closest, any or all hits (default: any for ao, else closest)")
        ->check(CLI::IsMember({"closest", "any", "all"}));
    command
        ->add_option(
            "--kernel", options->kernel,
            "Traversal kernel (default: engine on the cpu, scalar for a kdtree or --layout binary, "
            "speculative_while_while on cuda, opencl, hip and sim)")
        ->check(CLI::IsMember(trace_kernel_names()));
    command->add_option("--machine", options->machine, "Simulated machine of --device sim")
        ->capture_default_str();
    add_cameras_option(*command, options->camera);
    add_size_option(*command, options->size_text,
                    "Pixels of the cameras (default: of cameras.json, or 1024x768)");
    command->add_option("--samples", options->samples, "Secondary rays per primary hit")
        ->transform(whole_number(1, 1024))
        ->capture_default_str();
    command
        ->add_option("--ao-radius", options->ao_radius,
                     "Reach of ao rays (default: of cameras.json, or 5 % of the diagonal)")
        ->check(finite_number(false));
    command->add_option("--repeat", options->repeat, "Times to trace after a warm-up")
        ->transform(whole_number(1, 10000))
        ->capture_default_str();
    command
        ->add_option(
            "--hits", options->hits_file,
            "Save the hits as a structured array (of any hits: 1 or 0 a ray); for all hits "
            "also FILE.offsets.npy")
        ->check(file_name())
        ->type_name("FILE.npy");
    command->add_option("--save-rays", options->rays_file, "Save the rays")
        ->check(file_name())
        ->type_name("FILE.npy");
    command->add_flag("--explain", options->explain, "Say which layout and which code ran");
    add_result_limit(*command, options->max_result_bytes);
    add_wide_trace_options(*command, options->wide);
    add_tree_options(*command, options->tree);
    add_tree_figure_options(*command, options->tree);
    add_flatten_option(*command, options->common);
    add_common_options(*command, options->common);
    command->callback([options, command] {
        if (options->tree.device != "sim")
            refuse_given(*command, {"--machine"}, "belongs to --device sim");
        require_writable(options->hits_file);
        require_writable(options->rays_file);
        require_writable_json(options->common);
        run_trace(*options);
    });
}

}  // namespace raydix::cli
