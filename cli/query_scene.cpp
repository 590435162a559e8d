// raydix query --closest, --signed-distance, --pairs: a scene that keeps its meshes and nodes, and
// .npy files as contract.md 8 has them.
#include <fmt/format.h>
#include <raydix/arrays.h>
#include <raydix/rdx_scene.h>
#include <raydix/scene.h>
#include <raydix/scene_info.h>
#include <raydix/scene_pairs.h>
#include <raydix/scene_queries.h>
#include <raydix/solid.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "query.h"
#include "scene_file.h"

namespace raydix::cli {
namespace {

bool holds_triangles(const Model& model) {
    return std::ranges::any_of(model.meshes, [](const Mesh& m) { return !m.triangles.empty(); });
}

/// The queries of a model without --queries: its points, where its nodes put them.
std::vector<Vec3> queries_of(const QueryCommand& options, const QueriedScene& queried) {
    if (options.queries_file.empty() && !queried.model)
        throw CLI::ValidationError("--queries", options.scene +
                                                    " holds a scene, whose points are "
                                                    "not at hand: say which");
    if (options.queries_file.empty() && !queried.model->is_flat()) {
        Model flat = *queried.model;
        flat.flatten();
        return flat.mesh().vertices;
    }
    return load_queries(options, queried.model ? *queried.model : Model());
}

/// One column of numbers.
template <class Value>
void save_column(const QueryCommand& options, const std::vector<SceneClosestPoint>& points,
                 Value SceneClosestPoint::*member, const char* name) {
    std::vector<Value> values;
    values.reserve(points.size());
    for (const SceneClosestPoint& p : points) values.push_back(p.*member);
    save_array(options.prefix + name, values);
}

void save_closest(const QueryCommand& options, const std::vector<SceneClosestPoint>& points,
                  bool is_one_mesh) {
    std::vector<float> positions, uv;
    for (const SceneClosestPoint& p : points) {
        positions.insert(positions.end(), {p.position.x, p.position.y, p.position.z});
        uv.insert(uv.end(), {p.u, p.v});
    }
    save_column(options, points, &SceneClosestPoint::prim, ".indices.npy");
    save_column(options, points, &SceneClosestPoint::distance, ".distances.npy");
    save_array(options.prefix + ".points.npy", positions, 3);
    save_array(options.prefix + ".uv.npy", uv, 2);
    if (is_one_mesh) return;
    save_column(options, points, &SceneClosestPoint::geometry, ".geometries.npy");
    save_column(options, points, &SceneClosestPoint::instance, ".instances.npy");
}

QueryFigures closest_of_scene(const QueryCommand& options, const QueriedScene& queried) {
    const std::vector<Vec3> queries = queries_of(options, queried);
    std::vector<SceneClosestPoint> points(queries.size());
    QueryCounts counts;
    QueryFigures figures;
    figures.kind = "closest";
    figures.seconds = timed_repeats(options.repeat, [&] {
        counts =
            closest_points(queried.scene, queries, points, {.threads = options.common.threads});
    });
    figures.queries = counts.queries;
    figures.found = counts.found;
    figures.invalid_queries = counts.invalid_queries;
    if (!options.prefix.empty()) save_closest(options, points, queried.is_one_mesh);
    return figures;
}

QueryFigures signed_of_scene(const QueryCommand& options, const QueriedScene& queried,
                             Json& document) {
    const std::vector<Vec3> queries = queries_of(options, queried);
    const Solid solid(queried.scene, {.threads = options.common.threads});
    document["solid"] = solid_json(solid);
    return answer_signed(options, solid, queries);
}

/// One of three arrays of two columns.
template <std::uint32_t ScenePrimitive::*member>
void save_pairs(const QueryCommand& options, const std::vector<ScenePair>& pairs,
                const char* name) {
    std::vector<std::uint32_t> ids;
    ids.reserve(2 * pairs.size());
    for (const ScenePair& pair : pairs)
        ids.insert(ids.end(), {pair.first.*member, pair.second.*member});
    save_array(options.prefix + name, ids, 2);
}

QueryFigures pairs_of_scene(const QueryCommand& options, const QueriedScene& queried,
                            const QueriedScene* other) {
    const ScenePairOptions how{.narrow = options.narrow,
                               .max_result_bytes = options.max_result_bytes,
                               .threads = options.common.threads};
    ScenePairs found;
    QueryFigures figures;
    figures.kind = "pairs";
    figures.seconds = timed_repeats(options.repeat, [&] {
        found = {};  // never two results at once
        found = other != nullptr ? overlapping_pairs(queried.scene, other->scene, how)
                                 : overlapping_pairs(queried.scene, how);
    });
    figures.queries = found.first.triangles;
    figures.invalid_queries = found.first.left_out;
    figures.found = found.pairs.size();
    if (options.prefix.empty()) return figures;
    save_pairs<&ScenePrimitive::prim>(options, found.pairs, ".pairs.npy");
    if (queried.is_one_mesh && (other == nullptr || other->is_one_mesh)) return figures;
    save_pairs<&ScenePrimitive::geometry>(options, found.pairs, ".pairs-geometries.npy");
    save_pairs<&ScenePrimitive::instance>(options, found.pairs, ".pairs-instances.npy");
    return figures;
}

}  // namespace

std::optional<QueriedScene> load_queried_scene(const std::string& name,
                                               const QueryCommand& options) {
    if (!options.builder.empty() || options.strict || options.common.flatten) return {};
    QueriedScene out;
    if (is_scene_file(name)) {
        RdxScene file = load_rdx_scene(name);
        out.json = scene_file_json(file);
        out.load_ms = file.load_ms;
        out.quality = file.options.quality;
        out.scene = std::move(file.scene);
        out.is_one_mesh =
            file.counts.meshes == 1 && file.counts.instances == 0 && file.shape_ids.empty();
        return out;
    }
    if (is_rdx(name)) return {};
    out.model = load_model(name, options.common.seed);
    if (!holds_triangles(*out.model)) return {};
    out.json = scene_json(*out.model);
    out.load_ms = out.model->load_ms;
    out.is_one_mesh = out.model->meshes.size() == 1 && out.model->nodes.empty();
    const auto start = std::chrono::steady_clock::now();
    about(name, [&] { out.scene = Scene(*out.model, {.threads = options.common.threads}); });
    out.commit_ms =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    return out;
}

void run_scene_query(const QueryCommand& options, const QueriedScene& queried,
                     const QueriedScene* other) {
    Json document = new_document("query");
    document["scene"] = queried.json;
    document["load_ms"] = queried.load_ms;
    document["build"] = {
        {"tree", "bvh"},
        {"quality", quality_name(queried.quality)},
        {"layout", "wide8"},
        {"device", "cpu"},
        {"threads", threads_at_work(options.common.threads)},
        {"ms", queried.commit_ms ? Json{{"total", *queried.commit_ms}} : Json(nullptr)}};
    const QueryFigures figures = about(
        options.scene,
        [&] {
            return options.closest           ? closest_of_scene(options, queried)
                   : options.signed_distance ? signed_of_scene(options, queried, document)
                                             : pairs_of_scene(options, queried, other);
        },
        options.queries_file);
    document["query"] = Json::array({query_json(figures, options)});
    tell_left_out(document, left_out_triangles(queried.scene), options.common);
    if (options.common.prints_tables()) {
        if (options.signed_distance) print_solid(document["solid"]);
        print_query(document["query"][0]);
    }
    write_json(document, options.common);
}

}  // namespace raydix::cli
