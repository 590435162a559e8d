// raydix mpi info and trace.
#include <fmt/format.h>
#include <raydix/arrays.h>
#include <raydix/bvh.h>
#include <raydix/rays.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "mpi_commands.h"
#include "mpi_input.h"
#include "mpi_ranks.h"
#include "option_checks.h"

namespace raydix::cli {
namespace {

void print_holding(const Json& holding, const char* elements) {
    fmt::print("holding      {} {}, at most {} on a rank of {}\n",
               holding["elements"].get<std::uint64_t>(), elements,
               holding["local"]["most"].get<std::uint64_t>(), mpi_ranks());
    fmt::print("memory       at most {} bytes on a rank, {} of them on every rank\n",
               holding["bytes"]["most"].get<std::uint64_t>(),
               holding["replicated_bytes"].get<std::uint64_t>());
}

struct InfoCommand : MpiOptions {
    bool with_hash = false;
};

/// The hash of the LBVH over the triangles of all ranks; with --verify also beside rank 0's.
void add_tree_hash(SpreadModel& model, const InfoCommand& options, Json& document) {
    if (model.triangles == 0) throw InputError(options.names() + ": points have no tree_hash");
    BuildOptions build;
    build.threads = options.common.threads;
    const std::string hash = mpi::tree_hash(MPI_COMM_WORLD, model.part, build);
    document["tree_hash"] = hash;
    if (options.common.prints_tables() && mpi_rank() == 0) fmt::print("hash         {}\n", hash);
    if (!options.verify) return;
    read_whole(model, options);
    on_first([&] {
        require_verified(tree_hash(build_bvh(model.whole.mesh(), build)) == hash,
                         "the nodes of the LBVH", options.common.prints_tables());
    });
}

void run_info(const InfoCommand& options) {
    SpreadModel model = spread_model(options);
    Json document = mpi_document("mpi info", options, model);
    if (model.triangles == 0) {
        const mpi::DistributedPoints points(MPI_COMM_WORLD, model.part.vertices, options.options());
        document["holding"] = holding_json(points.holding());
    } else {
        const MeshView view(model.part);
        const mpi::DistributedScene scene(MPI_COMM_WORLD, std::span(&view, 1),
                                          options.scene_options());
        document["holding"] = holding_json(scene.holding());
    }
    on_first([&] {
        if (options.common.prints_tables())
            print_holding(document["holding"], model.triangles == 0 ? "points" : "triangles");
        tell_left_out(document, document["holding"]["left_out"], options.common);
    });
    if (options.with_hash || options.verify) add_tree_hash(model, options, document);
    document["verified"] = options.verify;
    on_first([&] { write_json(document, options.common); });
}

struct TraceCommand : MpiOptions {
    std::string rays_file, size_text = "512x384";
    std::size_t camera = 0;
    std::string mode = "closest", prefix;
};

std::vector<Ray> rays_of(const TraceCommand& options, const Model& model) {
    if (!options.rays_file.empty()) return load_rays(options.rays_file);
    if (options.camera >= model.cameras.cameras.size())
        throw InputError(options.scene + ": there is no camera " + std::to_string(options.camera));
    const Size size = parse_size(options.size_text);
    return make_primary_rays(model.cameras.cameras[options.camera], size.width, size.height);
}

template <class AnyHit>
bool same_hit(const mpi::DistributedHit& hit, const AnyHit& expected) {
    const bool same_prim = expected.hit() ? hit.prim == expected.prim : hit.prim == mpi::no_global;
    return same_prim && hit.geometry == expected.geometry && hit.instance == expected.instance &&
           std::memcmp(&hit.t, &expected.t, sizeof(float)) == 0 &&
           std::memcmp(&hit.u, &expected.u, sizeof(float)) == 0 &&
           std::memcmp(&hit.v, &expected.v, sizeof(float)) == 0;
}

template <class Hits, class Expected>
bool same_hits(const Hits& hits, const Expected& expected) {
    if (hits.size() != expected.size()) return false;
    for (std::size_t i = 0; i < hits.size(); ++i)
        if (!same_hit(hits[i], expected[i])) return false;
    return true;
}

void save_answers(const std::vector<mpi::DistributedHit>& hits, const std::string& prefix) {
    std::vector<std::uint64_t> prims;
    std::vector<float> t, uv;
    for (const mpi::DistributedHit& hit : hits) {
        prims.push_back(hit.prim);
        t.push_back(hit.t);
        uv.insert(uv.end(), {hit.u, hit.v});
    }
    save_array(prefix + ".prims.npy", prims);
    save_array(prefix + ".t.npy", t);
    save_array(prefix + ".uv.npy", uv, 2);
}
void save_answers(const std::vector<std::uint8_t>& occluded, const std::string& prefix) {
    save_occluded(prefix + ".occluded.npy", occluded);
}

/// The answers of all ranks on rank 0: compared with those of one process, and written.
template <class Gathered, class Alone>
void finish(const TraceCommand& options, const SpreadModel& model, const std::vector<Ray>& rays,
            const Gathered& gathered, const Alone& is_same) {
    if (!options.verify && options.prefix.empty()) return;
    const auto answers = gathered();
    on_first([&] {
        if (options.verify) {
            const Scene alone(model.whole.mesh());
            require_verified(is_same(alone, std::span(rays), answers), "hits",
                             options.common.prints_tables());
        }
        if (!options.prefix.empty()) save_answers(answers, options.prefix);
    });
}

void run_trace(const TraceCommand& options) {
    SpreadModel model = spread_model(options);
    require_triangles(model, options, "rays");
    if (options.verify || options.rays_file.empty()) read_whole(model, options);
    std::vector<Ray> rays;
    on_first([&] { rays = rays_of(options, model.whole); });
    const std::vector<Ray> mine = scatter(rays);
    const MeshView view(model.part);
    const mpi::DistributedScene scene(MPI_COMM_WORLD, std::span(&view, 1), options.scene_options());
    Json document = mpi_document("mpi trace", options, model);
    document["holding"] = holding_json(scene.holding());
    document["mode"] = options.mode;
    TraceCounts counts;
    const auto take = [&](const auto& answers) {
        document["report"] = report_json(answers.report);
        counts = answers.counts;
    };
    if (options.mode == "closest") {
        const auto answers = scene.trace(mine);
        take(answers);
        finish(
            options, model, rays,
            [&] { return gather(std::span<const mpi::DistributedHit>(answers.values)); },
            [](const Scene& alone, std::span<const Ray> all, const auto& hits) {
                return same_hits(hits, trace(alone, all));
            });
    } else if (options.mode == "any") {
        const auto answers = scene.trace_any(mine);
        take(answers);
        finish(
            options, model, rays,
            [&] { return gather(std::span<const std::uint8_t>(answers.values)); },
            [](const Scene& alone, std::span<const Ray> all, const auto& occluded) {
                std::vector<std::uint8_t> expected(all.size());
                trace_any(alone, all, std::span(expected));
                return expected == occluded;
            });
    } else {
        const auto rows = scene.trace_all(mine);
        take(rows);
        std::vector<std::uint64_t> offsets;
        if (options.verify) offsets = gather_offsets(rows.offsets.view());
        finish(
            options, model, rays, [&] { return gather(rows.hits.view()); },
            [&](const Scene& alone, std::span<const Ray> all, const auto& hits) {
                const auto expected = trace_all(alone, all);
                return std::ranges::equal(offsets, expected.offsets) &&
                       same_hits(hits, expected.hits);
            });
    }
    std::uint64_t sums[3] = {counts.rays, counts.hits, counts.invalid_rays};
    MPI_Allreduce(MPI_IN_PLACE, sums, 3, MPI_UINT64_T, MPI_SUM, MPI_COMM_WORLD);
    document["rays"] = sums[0];
    document["hits"] = sums[1];
    document["invalid_rays"] = sums[2];
    document["verified"] = options.verify;
    on_first([&] {
        if (options.common.prints_tables()) {
            print_holding(document["holding"], "triangles");
            fmt::print("rays         {}, {} hits\n", sums[0], sums[1]);
            print_invalid_rays(sums[2]);
            print_report(document["report"]);
        }
        tell_left_out(document, document["holding"]["left_out"], options.common);
        write_json(document, options.common);
    });
}

}  // namespace

void add_mpi_info(CLI::App& app) {
    CLI::App* command = app.add_subcommand("info", "Which rank holds how much of a scene");
    auto options = std::make_shared<InfoCommand>();
    add_mpi_options(*command, *options);
    command->add_flag("--tree-hash", options->with_hash,
                      "The hash of the LBVH over the triangles of all ranks, as raydix build "
                      "--builder karras prints it; --verify does it too");
    command->callback([options, command] {
        require_writable_results(*command, options->common, "", "");
        run_info(*options);
    });
}

void add_mpi_trace(CLI::App& app) {
    CLI::App* command = app.add_subcommand("trace", "Rays through a scene spread over ranks");
    auto options = std::make_shared<TraceCommand>();
    add_mpi_options(*command, *options);
    command->add_option("--rays", options->rays_file, "Rays from an (N, 8) .npy file")
        ->check(file_name());
    command->add_option("--camera", options->camera, "Camera of the rays")
        ->transform(whole_number(0))
        ->capture_default_str();
    add_size_option(*command, options->size_text, "Pixels")->capture_default_str();
    command->add_option("--mode", options->mode, "Which hits")
        ->check(CLI::IsMember({"closest", "any", "all"}))
        ->capture_default_str();
    command->add_option(
        "--out", options->prefix,
        "Rank 0 writes PREFIX.prims.npy (64 bits), .t.npy, .uv.npy; or .occluded.npy");
    command->callback([options, command] {
        if (options->mode == "all")
            refuse_given(*command, {"--out"}, "writes one hit a ray; not with --mode all");
        require_writable_results(*command, options->common, options->prefix,
                                 options->mode == "any" ? ".occluded.npy" : ".prims.npy");
        run_trace(*options);
    });
}

}  // namespace raydix::cli
