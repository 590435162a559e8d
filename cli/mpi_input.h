// What the commands of raydix_mpi read: each rank its part of a file, or rank 0 all of it, which it
// scatters.
#pragma once

#include <raydix/mesh.h>
#include <raydix/model.h>
#include <raydix/mpi.h>

#include <string>
#include <vector>

#include "output.h"

namespace raydix::cli {

struct MpiOptions {
    CommonOptions common;
    std::string scene, partition = "curve";
    std::vector<std::string> more;  // files behind `scene`
    std::uint64_t exchange_bytes = std::uint64_t{64} << 20;
    bool verify = false;

    /// All files, for messages.
    [[nodiscard]] std::string names() const;
    [[nodiscard]] mpi::Options options() const;
    [[nodiscard]] mpi::SceneOptions scene_options() const;
};
void add_mpi_options(CLI::App& command, MpiOptions& options);
/// Collective. Before any work: rank 0 tries --json, and --out as the prefix of a file with this
/// ending.
void require_writable_results(const CLI::App& command, const CommonOptions& common,
                              const std::string& prefix, const std::string& ending);

struct SpreadModel {
    Model whole;                                // of rank 0, flat, if it has been read
    bool is_whole_read = false;                 // the same on all ranks
    Mesh part;                                  // triangles and their vertices; or points
    std::uint64_t triangles = 0, vertices = 0;  // of all files
    double load_ms = 0;                         // of this rank

    /// The `scene` of a document.
    [[nodiscard]] Json json(const MpiOptions& options) const;
};

/// Collective. Says who reads. Triangles, or else points, come in equal runs.
[[nodiscard]] SpreadModel spread_model(const MpiOptions& options);
/// Collective. `who`, such as "rays", need triangles. Throws InputError, on all ranks, if the ranks
/// hold points alone.
void require_triangles(const SpreadModel& model, const MpiOptions& options, const char* who);
/// All of the files as one mesh or cloud, read by the rank that calls. Cameras are those of the
/// first.
[[nodiscard]] Model load_files(const MpiOptions& options);
/// Collective. For what rank 0 does alone: it reads all of the files unless it has.
void read_whole(SpreadModel& model, const MpiOptions& options);

/// {command, version, machine, ranks, scene, load_ms, partition}.
[[nodiscard]] Json mpi_document(const std::string& command, const MpiOptions& options,
                                const Json& scene, double load_ms);
[[nodiscard]] Json mpi_document(const std::string& command, const MpiOptions& options,
                                const SpreadModel& model);
/// Collective. The figures of all ranks: sums, and the greatest of what each has.
[[nodiscard]] Json holding_json(const mpi::Holding& holding);
[[nodiscard]] Json report_json(const mpi::CallReport& report);
void print_report(const Json& report);
/// On rank 0: throws InputError if they differ.
void require_verified(bool is_same, const std::string& what, bool prints);

}  // namespace raydix::cli
