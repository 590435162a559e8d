// raydix query: options, which kind it is, and how figures are told.
#include "query.h"

#include <fmt/format.h>

#include <memory>

#include "option_checks.h"

namespace raydix::cli {
namespace {

/// Options that mean nothing to the kind are usage errors, never ignored.
void refuse(bool given, const char* option, const char* why) {
    if (given) throw CLI::ValidationError(option, why);
}

void run_query(const QueryCommand& options) {
    const int of_points = options.k.has_value() + options.radius.has_value() + options.box;
    const int of_meshes = options.closest + options.signed_distance + options.pairs;
    if (of_points + of_meshes != 1)
        throw CLI::ValidationError("query",
                                   "takes exactly one of --knn, --radius, --box, --closest, "
                                   "--signed-distance and --pairs");
    refuse(options.narrow && !options.pairs, "--narrow", "belongs to --pairs");
    refuse(!options.with_scene.empty() && !options.pairs, "--with", "belongs to --pairs");
    refuse(options.max_distance && !options.k, "--max-distance", "belongs to --knn");
    if (of_points != 0) {
        refuse(!options.builder.empty(), "--builder",
               "belongs to --closest, --signed-distance and --pairs");
        refuse(options.sort && options.k, "--sort", "belongs to --radius and --box");
        return run_point_query(options);
    }
    refuse(options.sort, "--sort", "belongs to --radius and --box");
    refuse(options.max_result_bytes != 0 && !options.pairs, "--max-result-bytes",
           "belongs to --knn, --radius, --box and --pairs");
    refuse(options.tree != "automatic", "--tree", "belongs to --knn, --radius and --box");
    refuse(options.pairs && !options.queries_file.empty(), "--queries", "has no part in --pairs");
    for (const std::string& scene : {options.scene, options.with_scene}) {
        const std::string why = "the scene in " + scene + " is used as it is";
        if (!is_scene_file(scene)) continue;
        refuse(options.common.flatten, "--flatten", why.c_str());
        refuse(options.strict, "--strict", why.c_str());
        refuse(!options.builder.empty(), "--builder", why.c_str());
    }
    run_mesh_query(options);
}

void add_kinds(CLI::App& command, QueryCommand& options) {
    const char* group = "Kind of query (one of them)";
    command
        .add_option("--knn", options.k,
                    "The K nearest points of each query, by distance, the point itself included")
        ->transform(whole_number(1, 0xFFFFFFFE))
        ->type_name("K")
        ->group(group);
    command
        .add_option("--max-distance", options.max_distance,
                    "--knn: only points within distance R; rows may then be short")
        ->check(finite_number(true))
        ->type_name("R");
    command.add_option("--radius", options.radius, "All points within distance R of each query")
        ->check(finite_number(true))
        ->type_name("R")
        ->group(group);
    command.add_flag("--box", options.box, "All points in each box; needs --queries")->group(group);
    command
        .add_flag("--closest", options.closest,
                  "The closest triangle to each query, the place on it and its distance")
        ->group(group);
    command
        .add_flag("--signed-distance", options.signed_distance,
                  "Distances to the mesh, negative inside")
        ->group(group);
    command
        .add_flag("--pairs", options.pairs,
                  "All pairs of triangles (or points) whose boxes overlap, but for neighbours")
        ->group(group);
}

void add_mesh_options(CLI::App& command, QueryCommand& options) {
    command.add_flag("--narrow", options.narrow, "--pairs: only triangles that meet");
    command
        .add_option("--with", options.with_scene,
                    "--pairs: between the scene and this one instead of within it")
        ->check(file_name())
        ->type_name("SCENE2");
    std::vector<std::string> builders;
    for (std::uint32_t i = 0; i <= static_cast<std::uint32_t>(Builder::sbvh); ++i)
        builders.emplace_back(builder_name(static_cast<Builder>(i)));
    command
        .add_option("--builder", options.builder,
                    "Asks one mesh through a binary tree of this builder; answers are the same")
        ->check(CLI::IsMember(builders));
}

}  // namespace

Json query_json(const QueryFigures& figures, const QueryCommand& options) {
    std::vector<double> rates;
    for (const double seconds : figures.seconds)
        rates.push_back(static_cast<double>(figures.queries) / seconds / 1e6);
    const auto named = [](const std::string& file) {
        return file.empty() ? Json(nullptr) : Json(file);
    };
    const auto distance = [](const auto& given) {
        return given ? Json(static_cast<float>(*given)) : Json(nullptr);
    };
    return {
        {"kind", figures.kind},
        {"k", options.k ? Json(*options.k) : Json(nullptr)},
        {"max_distance", distance(options.max_distance)},
        {"radius", distance(options.radius)},
        {"queries_file", named(options.queries_file)},
        {"with", named(options.with_scene)},
        {"narrow", options.narrow},
        {"sort", options.sort},
        {"repeat", options.repeat},
        {"queries", figures.queries},
        {"invalid_queries", figures.invalid_queries},
        {"found", figures.found},
        {"mqueries_per_s",
         figures.queries == 0 || rates.empty() ? Json(nullptr) : spread_json(spread_of(rates))}};
}

void print_query(const Json& query) {
    fmt::print("\n{:<10} {:>12} {:>14} {:>12} {:>12} {:>9} {:>9}\n", "query", "queries", "found",
               "invalid", "Mqueries/s", "min", "max");
    const Json& rate = query["mqueries_per_s"];
    const auto number = [&](const char* name) {
        return rate.is_null() ? std::string("-") : fmt::format("{:.3f}", rate[name].get<double>());
    };
    fmt::print("{:<10} {:>12} {:>14} {:>12} {:>12} {:>9} {:>9}\n", query["kind"].get<std::string>(),
               grouped(query["queries"].get<std::uint64_t>()),
               grouped(query["found"].get<std::uint64_t>()),
               grouped(query["invalid_queries"].get<std::uint64_t>()), number("median"),
               number("min"), number("max"));
}

Model load_query_scene(const std::string& scene, const CommonOptions& common) {
    Model model = is_rdx(scene) ? load_tree_file(scene).scene : load_model(scene, common.seed);
    flatten(model, common);
    return model;
}

void add_query_command(CLI::App& app) {
    auto options = std::make_shared<QueryCommand>();
    CLI::App* command = app.add_subcommand(
        "query", "Nearest points, points in spheres or boxes, distances to meshes, pairs");
    command
        ->add_option("SCENE", options->scene,
                     "A file, builtin:NAME?key=value&..., or a .rdx file; of a triangle mesh the "
                     "vertices are the points")
        ->required();
    add_kinds(*command, *options);
    command
        ->add_option("--queries", options->queries_file,
                     "A (Q, 3) .npy file or any scene with points; for --box a (Q, 6) .npy file of "
                     "lo and hi (default: the scene's own points)")
        ->check(file_name())
        ->type_name("FILE");
    command
        ->add_option("--out", options->prefix,
                     "Write PREFIX.indices.npy and PREFIX.distances.npy; --radius and --box also "
                     "PREFIX.offsets.npy; --closest also PREFIX.points.npy and PREFIX.uv.npy; "
                     "--signed-distance distances alone; --pairs PREFIX.pairs.npy. Of scenes of "
                     "several geometries or instances --closest also PREFIX.geometries.npy and "
                     "PREFIX.instances.npy, --pairs PREFIX.pairs-geometries.npy and "
                     "PREFIX.pairs-instances.npy")
        ->type_name("PREFIX");
    command->add_flag("--sort", options->sort,
                      "Rows of --radius and --box by distance instead of by index");
    command->add_option("--tree", options->tree, "How points are grouped; answers are the same")
        ->check(CLI::IsMember({"automatic", "kdtree", "bvh"}))
        ->capture_default_str();
    add_mesh_options(*command, *options);
    command->add_flag("--strict", options->strict,
                      "Invalid points, or triangles of the scene, are an error instead of being "
                      "left out; of the queries they never are");
    command->add_option("--repeat", options->repeat, "Timed runs after a warm-up")
        ->transform(whole_number(0, 1000))
        ->capture_default_str();
    add_result_limit(*command, options->max_result_bytes);
    add_flatten_option(*command, options->common);
    add_common_options(*command, options->common);
    command->callback([options, command] {
        if (options->prefix.empty()) refuse_given(*command, {"--out"}, "the prefix is empty");
        if (!options->prefix.empty())
            require_writable(options->prefix + (options->pairs             ? ".pairs.npy"
                                                : options->signed_distance ? ".distances.npy"
                                                : options->radius || options->box
                                                    ? ".offsets.npy"
                                                    : ".indices.npy"));
        require_writable_json(options->common);
        run_query(*options);
    });
}

}  // namespace raydix::cli
