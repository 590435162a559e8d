// raydix mpi query: nearest points, points within a radius, closest points of triangles, inside.
#include <fmt/format.h>
#include <raydix/arrays.h>
#include <raydix/points.h>
#include <raydix/solid.h>

#include <cstring>
#include <memory>
#include <optional>

#include "mpi_commands.h"
#include "mpi_input.h"
#include "mpi_ranks.h"

namespace raydix::cli {
namespace {

struct MpiQueryCommand : MpiOptions {
    std::string queries_file;
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

/// Numbers that count through the ranks against those of one index.
bool same_rows(const std::vector<std::uint64_t>& indices, const std::vector<float>& distances,
               std::span<const std::uint32_t> expected, std::span<const float> expected_distances) {
    if (indices.size() != expected.size() || distances.size() != expected_distances.size())
        return false;
    for (std::size_t i = 0; i < expected.size(); ++i)
        if (indices[i] != (expected[i] == no_primitive ? mpi::no_global : expected[i]))
            return false;
    return distances.empty() || std::memcmp(distances.data(), expected_distances.data(),
                                            distances.size() * sizeof(float)) == 0;
}

class QueryRun {
public:
    explicit QueryRun(const MpiQueryCommand& options)
        : options_(options),
          model_(spread_model(options)),
          document_(mpi_document("mpi query", options)) {
        on_first([&] { queries_ = queries_of(options_, model_.whole); });
        mine_ = scatter(queries_);
    }

    void run() {
        options_.closest || options_.contains ? ask_scene() : ask_points();
        on_first([&] {
            if (options_.common.prints_tables()) {
                fmt::print("queries      {}, {} found\n", document_["queries"].get<std::uint64_t>(),
                           document_["found"].get<std::uint64_t>());
                print_report(document_["report"]);
            }
            write_json(document_, options_.common);
        });
    }

private:
    void ask_points() {
        // Vertices of meshes are points too: rank 0 spreads them apart from their triangles.
        const Mesh none;
        const std::vector<Vec3> part =
            scatter(mpi_rank() == 0 ? model_.whole.mesh().vertices : none.vertices);
        const mpi::DistributedPoints points(MPI_COMM_WORLD, part, options_.options());
        document_["holding"] = holding_json(points.holding());
        if (options_.k) {
            const auto rows = points.knn(mine_, *options_.k);
            take(rows.counts.found, rows.report);
            verify_points(rows, [&](const Points& alone, auto&& same) {
                const auto expected = knn(alone, queries_, *options_.k);
                return same(expected);
            });
        } else {
            const auto rows = points.radius(mine_, *options_.radius);
            take(rows.counts.found, rows.report);
            verify_points(rows, [&](const Points& alone, auto&& same) {
                const auto expected = radius_search(alone, queries_, *options_.radius);
                return same(expected);
            });
        }
    }

    template <class Rows, class Alone>
    void verify_points(const Rows& rows, const Alone& alone) {
        if (!options_.verify) return;
        const auto indices = gather(rows.indices.view());
        const auto distances = gather(rows.distances.view());
        on_first([&] {
            const Points index = build_points(model_.whole.mesh().vertices);
            require_verified(alone(index,
                                   [&](const auto& expected) {
                                       return same_rows(indices, distances, expected.indices.view(),
                                                        expected.distances.view());
                                   }),
                             "rows", options_.common.prints_tables());
        });
    }

    void ask_scene() {
        const MeshView view(model_.part);
        const mpi::DistributedScene scene(MPI_COMM_WORLD, std::span(&view, 1),
                                          options_.scene_options());
        document_["holding"] = holding_json(scene.holding());
        if (options_.closest) {
            const auto answers = scene.closest_points(mine_);
            take(answers.counts.found, answers.report);
            verify_closest(answers.values);
        } else {
            const auto answers = scene.contains(mine_);
            take(answers.counts.found, answers.report);
            verify_inside(answers.values);
        }
    }

    void verify_closest(const std::vector<mpi::DistributedScene::Closest>& part) {
        if (!options_.verify) return;
        const auto found = gather(std::span(part));
        on_first([&] {
            const Scene alone(model_.whole.mesh());
            const auto expected = closest_points(alone, queries_);
            bool same = expected.size() == found.size();
            for (std::size_t i = 0; same && i < found.size(); ++i)
                same = std::memcmp(&found[i].position, &expected[i].position, sizeof(Vec3)) == 0 &&
                       found[i].prim == (expected[i].found() ? expected[i].prim : mpi::no_global);
            require_verified(same, "points", options_.common.prints_tables());
        });
    }

    void verify_inside(const std::vector<std::uint8_t>& part) {
        if (!options_.verify) return;
        const auto inside = gather(std::span(part));
        on_first([&] {
            SolidOptions parity;
            parity.rule = InsideRule::parity;
            const Bvh tree = build_bvh(model_.whole.mesh());
            const Solid solid(tree, parity);
            std::vector<std::uint8_t> expected(queries_.size());
            contains(solid, queries_, std::span(expected));
            require_verified(expected == inside, "answers", options_.common.prints_tables());
        });
    }

    void take(std::uint64_t found, const mpi::CallReport& report) {
        std::uint64_t sums[2] = {mine_.size(), found};
        MPI_Allreduce(MPI_IN_PLACE, sums, 2, MPI_UINT64_T, MPI_SUM, MPI_COMM_WORLD);
        document_["queries"] = sums[0];
        document_["found"] = sums[1];
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
    command->add_option("--queries", options->queries_file,
                        "(Q, 3) .npy file; without it the scene's own vertices");
    CLI::Option_group* kind = command->add_option_group("Kind");
    kind->add_option("--knn", options->k, "The K nearest vertices")->check(CLI::PositiveNumber);
    kind->add_option("--radius", options->radius, "All vertices within R");
    kind->add_flag("--closest", options->closest, "The closest point of all triangles");
    kind->add_flag("--contains", options->contains, "Inside by parity of crossings");
    kind->require_option(1);
    command->callback([options] { QueryRun(*options).run(); });
}

}  // namespace raydix::cli
