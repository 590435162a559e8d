#include "mpi_input.h"

#include <fmt/format.h>
#include <raydix/rdx.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <unordered_map>
#include <utility>

#include "mpi_ranks.h"
#include "option_checks.h"
#include "options.h"
#include "scene_file.h"

namespace raydix::cli {
namespace {

/// Triangles [begin, end) and the vertices that they use.
Mesh part_of(const Mesh& mesh, std::size_t begin, std::size_t end) {
    Mesh part;
    std::unordered_map<std::uint32_t, std::uint32_t> places;
    for (std::size_t i = begin; i < end; ++i) {
        Triangle& triangle = part.triangles.emplace_back(mesh.triangles[i]);
        for (std::uint32_t& v : triangle) {
            const auto [place, is_new] =
                places.try_emplace(v, static_cast<std::uint32_t>(part.vertices.size()));
            if (is_new) part.vertices.push_back(mesh.vertices[v]);
            v = place->second;
        }
    }
    return part;
}

Mesh scatter_triangles(const Mesh& whole) {
    Mesh part;
    if (mpi_rank() != 0) {
        part.vertices = receive_array<Vec3>(0);
        part.triangles = receive_array<Triangle>(0);
        return part;
    }
    const std::size_t n = whole.triangles.size();
    for (int r = mpi_ranks() - 1; r >= 0; --r) {
        part = part_of(whole, part_begin(n, r), part_begin(n, r + 1));
        if (r == 0) break;
        send_array<Vec3>(part.vertices, r);
        send_array<Triangle>(part.triangles, r);
    }
    return part;
}

/// Of .rdx files all is checked, unlike where ranks read parts.
Model load_whole(const std::string& name, const CommonOptions& common) {
    if (!is_rdx(name)) return load_flat_model(name, common.seed);
    if (!holds_scene(name)) return load_rdx(name).scene;
    auto meshes = mpi::load_part(MPI_COMM_SELF, name);
    if (!meshes)
        throw InputError(name +
                         ": it holds more than meshes in float; trace, render, check and "
                         "info without mpi take it");
    Model model = model_of(load_rdx_scene(name));
    model.meshes = {std::move(meshes->mesh)};
    return model;
}

/// Throws InputError that names a file of a type that holds points alone. Where others hold
/// triangles nobody would see them.
void refuse_clouds(const MpiOptions& options) {
    std::vector<std::string> files{options.scene};
    files.insert(files.end(), options.more.begin(), options.more.end());
    for (const std::string& file : files) {
        std::string name = CLI::detail::to_lower(file);
        for (const char* packed : {".gz", ".xz", ".zst"})
            if (name.ends_with(packed)) name.erase(name.rfind('.'));
        if (name.ends_with(".npy") || name.ends_with(".xyz"))
            throw InputError(file +
                             ": it holds points, and the other files triangles; several files are "
                             "one mesh or one cloud");
    }
}

double ms_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
        .count();
}

bool is_builtin(const std::string& scene) { return scene.starts_with("builtin:"); }

std::uint64_t over_ranks(std::uint64_t value, MPI_Op op) {
    MPI_Allreduce(MPI_IN_PLACE, &value, 1, MPI_UINT64_T, op, MPI_COMM_WORLD);
    return value;
}

Json sum_and_most(std::uint64_t value) {
    return {{"sum", over_ranks(value, MPI_SUM)}, {"most", over_ranks(value, MPI_MAX)}};
}

}  // namespace

std::string MpiOptions::names() const {
    std::string names = scene;
    for (const std::string& file : more) names.append(", ").append(file);
    return names;
}

mpi::Options MpiOptions::options() const {
    mpi::Options chosen;
    chosen.partition = partition == "curve" ? mpi::Partition::curve : mpi::Partition::as_given;
    chosen.threads = common.threads;
    chosen.exchange_bytes = exchange_bytes;
    return chosen;
}

mpi::SceneOptions MpiOptions::scene_options() const {
    mpi::SceneOptions chosen;
    static_cast<mpi::Options&>(chosen) = options();
    chosen.one_geometry = true;
    return chosen;
}

void add_mpi_options(CLI::App& command, MpiOptions& options) {
    add_common_options(command, options.common);
    command.add_option("scene", options.scene, "File or built-in scene")->required();
    command.add_option("more", options.more, "More files, whose elements count on as one mesh");
    command.add_option("--partition", options.partition, "Which rank holds what")
        ->check(CLI::IsMember({"curve", "as_given"}))
        ->capture_default_str();
    command
        .add_option("--exchange-bytes", options.exchange_bytes,
                    "The most bytes that a rank takes in during a round")
        ->transform(whole_number(1))
        ->capture_default_str();
    command.add_flag("--verify", options.verify,
                     "Rank 0 does the same alone and compares all bits");
}

void require_writable_results(const CLI::App& command, const CommonOptions& common,
                              const std::string& prefix, const std::string& ending) {
    if (prefix.empty()) refuse_given(command, {"--out"}, "the prefix is empty");
    on_first([&] {
        if (!prefix.empty()) require_writable(prefix + ending);
        require_writable_json(common);
    });
}

SpreadModel spread_model(const MpiOptions& options) {
    SpreadModel model;
    const bool says = options.common.prints_tables() && mpi_rank() == 0 && mpi_ranks() > 1;
    const auto start = std::chrono::steady_clock::now();
    std::vector<std::filesystem::path> files{options.scene};
    files.insert(files.end(), options.more.begin(), options.more.end());
    auto read = is_builtin(options.scene) ? std::nullopt : mpi::load_part(MPI_COMM_WORLD, files);
    if (read) {
        if (read->triangles > 0) refuse_clouds(options);
        if (says) fmt::print("reading      each rank reads its part of {}\n", options.names());
        model.part = std::move(read->mesh);
        model.triangles = read->triangles;
        model.vertices = read->vertices;
        model.load_ms = ms_since(start);
        return model;
    }
    if (says) fmt::print("reading      rank 0 reads all of {} and scatters it\n", options.names());
    read_whole(model, options);
    const Mesh none;
    const Mesh& whole = mpi_rank() == 0 ? model.whole.mesh() : none;
    std::uint64_t sizes[2] = {whole.triangles.size(), whole.vertices.size()};
    MPI_Bcast(sizes, 2, MPI_UINT64_T, 0, MPI_COMM_WORLD);
    model.triangles = sizes[0];
    model.vertices = sizes[1];
    if (model.triangles > 0)
        model.part = scatter_triangles(whole);
    else
        model.part.vertices = scatter(whole.vertices);
    model.load_ms = ms_since(start);
    return model;
}

void require_triangles(const SpreadModel& model, const MpiOptions& options, const char* who) {
    if (model.triangles == 0 && over_ranks(model.part.vertices.size(), MPI_SUM) != 0)
        throw InputError(options.names() + ": " + who +
                         " need triangles; there are vertices alone");
}

Model load_files(const MpiOptions& options) {
    Model whole = load_whole(options.scene, options.common);
    for (const std::string& file : options.more)
        whole.meshes.push_back(load_whole(file, options.common).mesh());
    if (!options.more.empty()) whole.flatten();
    if (!whole.mesh().triangles.empty()) refuse_clouds(options);
    return whole;
}

void read_whole(SpreadModel& model, const MpiOptions& options) {
    if (model.is_whole_read) return;
    on_first([&] { model.whole = load_files(options); });
    model.is_whole_read = true;
}

Json SpreadModel::json(const MpiOptions& options) const {
    const auto without_folder = [](const std::string& file) {
        return is_builtin(file) ? file : std::filesystem::path(file).filename().string();
    };
    std::string name = without_folder(options.scene);
    for (const std::string& file : options.more) name.append(", ").append(without_folder(file));
    return {{"name", name},
            {"triangles", triangles},
            {"points", triangles == 0 ? vertices : 0},
            {"vertices", vertices}};
}

Json mpi_document(const std::string& command, const MpiOptions& options, const SpreadModel& model) {
    return mpi_document(command, options, model.json(options), model.load_ms);
}

Json mpi_document(const std::string& command, const MpiOptions& options, const Json& scene,
                  double load_ms) {
    Json document = new_document(command);
    document["ranks"] = mpi_ranks();
    document["scene"] = scene;
    document["load_ms"] = load_ms;
    document["partition"] = options.partition;
    return document;
}

Json holding_json(const mpi::Holding& holding) {
    return {{"elements", holding.size},
            {"left_out", holding.left_out},
            {"local", sum_and_most(holding.local)},
            {"bytes", sum_and_most(holding.bytes)},
            {"replicated_bytes", holding.replicated_bytes},
            {"report", report_json(holding.report)}};
}

Json report_json(const mpi::CallReport& report) {
    double compute = report.compute_seconds;
    MPI_Allreduce(MPI_IN_PLACE, &compute, 1, MPI_DOUBLE, MPI_MAX, MPI_COMM_WORLD);
    return {{"rounds", report.rounds},
            {"questions", sum_and_most(report.questions)},
            {"answered", sum_and_most(report.answered)},
            {"messages", sum_and_most(report.traffic.messages)},
            {"bytes", sum_and_most(report.traffic.bytes)},
            {"collectives", report.traffic.collectives},
            {"compute_s_most", compute}};
}

void print_report(const Json& report) {
    fmt::print("rounds       {}, {} questions, {} messages, {} bytes\n",
               report["rounds"].get<std::uint64_t>(),
               report["questions"]["sum"].get<std::uint64_t>(),
               report["messages"]["sum"].get<std::uint64_t>(),
               report["bytes"]["sum"].get<std::uint64_t>());
}

void require_verified(bool is_same, const std::string& what, bool prints) {
    if (!is_same) throw InputError("verify: " + what + " of all ranks differ from one process");
    if (prints) fmt::print("verify       {} have the bits of one process\n", what);
}

}  // namespace raydix::cli
