// raydix mpi query: nearest points, points within a radius, closest points of triangles, inside.
#include <fmt/format.h>
#include <raydix/arrays.h>
#include <raydix/points.h>
#include <raydix/rays.h>
#include <raydix/solid.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>

#include "mpi_commands.h"
#include "mpi_input.h"
#include "mpi_ranks.h"
#include "option_checks.h"

namespace raydix::cli {
namespace {

struct MpiQueryCommand : MpiOptions {
    std::string queries_file, prefix;
    std::optional<std::uint32_t> k;
    std::optional<float> radius;
    bool closest = false, contains = false;
};

std::vector<Vec3> queries_of(const MpiQueryCommand& options, const Model& model) {
    if (options.queries_file.empty()) return model.mesh().vertices;
    const std::vector<float> values = load_array(options.queries_file, 3);
    std::vector<Vec3> queries(values.size() / 3);
    if (!queries.empty()) std::memcpy(queries.data(), values.data(), values.size() * sizeof(float));
    return queries;
}

using Closest = mpi::DistributedScene::Closest;

/// The rows of all queries, on rank 0.
struct WholeRows {
    std::vector<std::uint64_t> offsets;  // of rows of any length
    std::vector<std::uint64_t> indices;
    std::vector<float> distances;
};

/// Numbers that count through the ranks against those of one index.
template <class Expected>
bool same_rows(const WholeRows& rows, const Expected& expected) {
    const auto& distances = expected.distances;
    if (rows.indices.size() != expected.indices.size()) return false;
    for (std::size_t i = 0; i < rows.indices.size(); ++i) {
        const std::uint32_t index = expected.indices[i];
        if (rows.indices[i] != (index == no_primitive ? mpi::no_global : index)) return false;
    }
    if constexpr (requires { expected.offsets; })
        if (!std::equal(rows.offsets.begin(), rows.offsets.end(), expected.offsets.data(),
                        expected.offsets.data() + expected.offsets.size()))
            return false;
    return rows.distances.size() == distances.size() &&
           (distances.empty() || std::memcmp(rows.distances.data(), distances.data(),
                                             distances.size() * sizeof(float)) == 0);
}

bool same_points(const std::vector<Closest>& found,
                 const std::vector<SceneClosestPoint>& expected) {
    const auto same_bits = [](const auto& a, const auto& b) {
        return std::memcmp(&a, &b, sizeof(a)) == 0;
    };
    return std::ranges::equal(found, expected, [&](const Closest& a, const SceneClosestPoint& b) {
        return a.prim == (b.found() ? b.prim : mpi::no_global) && a.geometry == b.geometry &&
               a.instance == b.instance && same_bits(a.position, b.position) &&
               same_bits(a.distance, b.distance) && same_bits(a.u, b.u) && same_bits(a.v, b.v);
    });
}

void save_closest(const std::vector<Closest>& found, const std::string& prefix) {
    std::vector<std::uint64_t> prims;
    std::vector<float> distances, points;
    for (const Closest& one : found) {
        prims.push_back(one.prim);
        distances.push_back(one.distance);
        points.insert(points.end(), {one.position.x, one.position.y, one.position.z});
    }
    save_array(prefix + ".indices.npy", prims);
    save_array(prefix + ".distances.npy", distances);
    save_array(prefix + ".points.npy", points, 3);
}

class QueryRun {
public:
    explicit QueryRun(const MpiQueryCommand& options)
        : options_(options),
          model_(spread_model(options)),
          document_(mpi_document("mpi query", options, model_)) {
        if (options.closest) require_triangles(model_, options, "closest points");
        if (options.contains) require_triangles(model_, options, "solids");
        if (options.verify || options.queries_file.empty() || asks_vertices())
            read_whole(model_, options);
        on_first([&] { queries_ = queries_of(options_, model_.whole); });
        mine_ = scatter(queries_);
    }

    void run() {
        options_.closest || options_.contains ? ask_scene() : ask_points();
        on_first([&] {
            tell_left_out(document_, document_["holding"]["left_out"], options_.common);
            if (options_.common.prints_tables()) {
                fmt::print("queries      {}, {} found, {} invalid\n",
                           document_["queries"].get<std::uint64_t>(),
                           document_["found"].get<std::uint64_t>(),
                           document_["invalid_queries"].get<std::uint64_t>());
                print_report(document_["report"]);
            }
            write_json(document_, options_.common);
        });
    }

private:
    void ask_points() {
        const Mesh none;
        const std::vector<Vec3> part =
            asks_vertices()
                ? scatter(mpi_rank() == 0 ? model_.whole.mesh().vertices : none.vertices)
                : model_.part.vertices;
        const mpi::DistributedPoints points(MPI_COMM_WORLD, part, options_.options());
        document_["holding"] = holding_json(points.holding());
        if (options_.k) {
            const auto rows = points.knn(mine_, *options_.k);
            take(rows.counts, rows.report);
            finish_rows(rows, {},
                        [&](const Points& alone) { return knn(alone, queries_, *options_.k); });
        } else {
            const auto rows = points.radius(mine_, *options_.radius);
            take(rows.counts, rows.report);
            finish_rows(rows, rows.offsets.view(), [&](const Points& alone) {
                return radius_search(alone, queries_, *options_.radius);
            });
        }
    }

    /// offsets: of rows of any length.
    template <class Rows, class Alone>
    void finish_rows(const Rows& part, std::span<const std::uint64_t> offsets, const Alone& alone) {
        if (!wants_whole()) return;
        WholeRows rows;
        if (!offsets.empty()) rows.offsets = gather_offsets(offsets);
        rows.indices = gather(part.indices.view());
        rows.distances = gather(part.distances.view());
        on_first([&] {
            if (options_.verify)
                require_verified(same_rows(rows, alone(build_points(model_.whole.mesh().vertices))),
                                 "rows", options_.common.prints_tables());
            if (options_.prefix.empty()) return;
            const std::size_t columns = options_.k.value_or(0);
            if (!offsets.empty()) save_array(options_.prefix + ".offsets.npy", rows.offsets);
            save_array(options_.prefix + ".indices.npy", rows.indices, columns);
            save_array(options_.prefix + ".distances.npy", rows.distances, columns);
        });
    }

    void ask_scene() {
        const MeshView view(model_.part);
        const mpi::DistributedScene scene(MPI_COMM_WORLD, std::span(&view, 1),
                                          options_.scene_options());
        document_["holding"] = holding_json(scene.holding());
        if (options_.closest) {
            const auto answers = scene.closest_points(mine_);
            take(answers.counts, answers.report);
            finish_closest(answers.values);
        } else {
            const auto answers = scene.contains(mine_);
            take(answers.counts, answers.report);
            finish_inside(answers.values);
        }
    }

    void finish_closest(const std::vector<Closest>& part) {
        if (!wants_whole()) return;
        const auto found = gather(std::span(part));
        on_first([&] {
            if (options_.verify)
                require_verified(
                    same_points(found, closest_points(Scene(model_.whole.mesh()), queries_)),
                    "points", options_.common.prints_tables());
            if (!options_.prefix.empty()) save_closest(found, options_.prefix);
        });
    }

    void finish_inside(const std::vector<std::uint8_t>& part) {
        if (!wants_whole()) return;
        const auto inside = gather(std::span(part));
        on_first([&] {
            if (options_.verify) {
                SolidOptions parity;
                parity.rule = InsideRule::parity;
                const Bvh tree = build_bvh(model_.whole.mesh());
                const Solid solid(tree, parity);
                std::vector<std::uint8_t> expected(queries_.size());
                contains(solid, queries_, std::span(expected));
                require_verified(expected == inside, "answers", options_.common.prints_tables());
            }
            if (!options_.prefix.empty()) save_occluded(options_.prefix + ".inside.npy", inside);
        });
    }

    /// Vertices of meshes are points too: rank 0 spreads them apart from their triangles.
    [[nodiscard]] bool asks_vertices() const {
        return model_.triangles > 0 && !options_.closest && !options_.contains;
    }
    [[nodiscard]] bool wants_whole() const { return options_.verify || !options_.prefix.empty(); }

    void take(const QueryCounts& counts, const mpi::CallReport& report) {
        std::uint64_t sums[3] = {mine_.size(), counts.found, counts.invalid_queries};
        MPI_Allreduce(MPI_IN_PLACE, sums, 3, MPI_UINT64_T, MPI_SUM, MPI_COMM_WORLD);
        document_["queries"] = sums[0];
        document_["found"] = sums[1];
        document_["invalid_queries"] = sums[2];
        document_["report"] = report_json(report);
        document_["verified"] = options_.verify;
    }

    const MpiQueryCommand& options_;
    SpreadModel model_;
    Json document_;
    std::vector<Vec3> queries_, mine_;
};

}  // namespace

void add_mpi_query(CLI::App& app) {
    CLI::App* command = app.add_subcommand("query", "Points and distances over ranks");
    auto options = std::make_shared<MpiQueryCommand>();
    add_mpi_options(*command, *options);
    command
        ->add_option("--queries", options->queries_file,
                     "(Q, 3) .npy file; without it the scene's own vertices")
        ->check(file_name());
    command->add_option("--out", options->prefix,
                        "Rank 0 writes PREFIX.indices.npy and others, numbers in 64 bits");
    CLI::Option_group* kind = command->add_option_group("Kind");
    kind->add_option("--knn", options->k, "The K nearest vertices")
        ->transform(whole_number(1, 0xFFFFFFFE));
    kind->add_option("--radius", options->radius, "All vertices within R")
        ->check(finite_number(true));
    kind->add_flag("--closest", options->closest, "The closest point of all triangles");
    kind->add_flag("--contains", options->contains, "Inside by parity of crossings");
    kind->require_option(1);
    command->callback([options, command] {
        require_writable_results(*command, options->common, options->prefix,
                                 options->radius     ? ".offsets.npy"
                                 : options->contains ? ".inside.npy"
                                                     : ".indices.npy");
        QueryRun(*options).run();
    });
}

}  // namespace raydix::cli
