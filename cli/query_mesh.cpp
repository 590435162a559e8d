// raydix query --closest, --signed-distance, --pairs: the triangles of a scene, and .npy files as
// contract.md 8 has them.
#include <fmt/format.h>
#include <raydix/arrays.h>
#include <raydix/closest.h>
#include <raydix/pairs.h>
#include <raydix/rdx.h>
#include <raydix/solid.h>

#include <optional>
#include <utility>

#include "query.h"

namespace raydix::cli {
namespace {

/// Built, or both read from a .rdx file.
SceneTree load_tree(const std::string& scene, const QueryCommand& options) {
    if (is_rdx(scene)) {
        for (const auto& [given, name] : {std::pair{!options.builder.empty(), "--builder"},
                                          std::pair{options.strict, "--strict"}})
            if (given) throw CLI::ValidationError(name, "has no part in " + scene + ", a tree");
        RdxFile file = load_tree_file(scene);
        return {std::move(file.scene), std::move(file.bvh)};
    }
    SceneTree loaded{load_query_scene(scene, options.common), {}};
    say_flattened(scene, options.common);
    loaded.bvh = about(scene, [&] {
        return build_bvh(loaded.scene.mesh(),
                         {.builder = options.builder.empty() ? Builder::ploc
                                                             : builder_from_name(options.builder),
                          .strict = options.strict,
                          .threads = options.common.threads});
    });
    return loaded;
}

QueryFigures answer_closest(const QueryCommand& options, const SceneTree& tree) {
    const std::vector<Vec3> queries = load_queries(options, tree.scene);
    std::vector<ClosestPoint> points(queries.size());
    QueryCounts counts;
    QueryFigures figures;
    figures.kind = "closest";
    figures.seconds = timed_repeats(options.repeat, [&] {
        counts = closest_points(tree.bvh, queries, points, {.threads = options.common.threads});
    });
    figures.queries = counts.queries;
    figures.found = counts.found;
    figures.invalid_queries = counts.invalid_queries;
    if (options.prefix.empty()) return figures;
    std::vector<std::uint32_t> prims;
    std::vector<float> distances, positions, uv;
    for (const ClosestPoint& p : points) {
        prims.push_back(p.prim);
        distances.push_back(p.distance);
        positions.insert(positions.end(), {p.position.x, p.position.y, p.position.z});
        uv.insert(uv.end(), {p.u, p.v});
    }
    save_array(options.prefix + ".indices.npy", prims);
    save_array(options.prefix + ".distances.npy", distances);
    save_array(options.prefix + ".points.npy", positions, 3);
    save_array(options.prefix + ".uv.npy", uv, 2);
    return figures;
}

QueryFigures signed_of_tree(const QueryCommand& options, const SceneTree& tree, Json& document) {
    const std::vector<Vec3> queries = load_queries(options, tree.scene);
    const Solid solid(tree.bvh, {.threads = options.common.threads});
    document["solid"] = solid_json(solid);
    return answer_signed(options, solid, queries);
}

QueryFigures answer_pairs(const QueryCommand& options, const SceneTree& tree) {
    std::optional<SceneTree> other;
    if (!options.with_scene.empty()) other = load_tree(options.with_scene, options);
    const PairOptions how{.narrow = options.narrow,
                          .max_result_bytes = options.max_result_bytes,
                          .threads = options.common.threads};
    std::vector<PrimitivePair> pairs;
    QueryFigures figures;
    figures.kind = "pairs";
    figures.seconds = timed_repeats(options.repeat, [&] {
        pairs = {};  // never two results at once
        pairs =
            other ? overlapping_pairs(tree.bvh, other->bvh, how) : overlapping_pairs(tree.bvh, how);
    });
    figures.queries = tree.bvh.input_count();
    figures.invalid_queries = tree.bvh.left_out();
    figures.found = pairs.size();
    if (options.prefix.empty()) return figures;
    std::vector<std::uint32_t> ids;
    ids.reserve(2 * pairs.size());
    for (const PrimitivePair& pair : pairs) ids.insert(ids.end(), {pair.first, pair.second});
    save_array(options.prefix + ".pairs.npy", ids, 2);
    return figures;
}

}  // namespace

Json solid_json(const Solid& solid) {
    const auto closure_name = [](Closure closure) {
        return closure == Closure::oriented ? "oriented"
               : closure == Closure::closed ? "closed"
                                            : "open";
    };
    const auto rule_name = [](InsideRule rule) {
        return rule == InsideRule::crossings ? "crossings"
               : rule == InsideRule::parity  ? "parity"
                                             : "winding";
    };
    return {{"closure", closure_name(solid.closure())},
            {"rule", rule_name(solid.rule())},
            {"open_edges", solid.open_edges()}};
}

void print_solid(const Json& solid) {
    const auto open = solid["open_edges"].get<std::uint64_t>();
    fmt::print(
        "solid        {}{}, inside by {}\n", solid["closure"].get<std::string>(),
        open == 0 ? std::string() : fmt::format(" ({})", counted(open, "open edge", "open edges")),
        solid["rule"] == "winding" ? "winding number" : solid["rule"].get<std::string>());
}

QueryFigures answer_signed(const QueryCommand& options, const Solid& solid,
                           const std::vector<Vec3>& queries) {
    std::vector<float> distances(queries.size());
    QueryCounts counts;
    QueryFigures figures;
    figures.kind = "signed_distance";
    figures.seconds = timed_repeats(options.repeat, [&] {
        counts = signed_distances(solid, queries, distances, {.threads = options.common.threads});
    });
    figures.queries = counts.queries;
    figures.found = counts.found;
    figures.invalid_queries = counts.invalid_queries;
    if (!options.prefix.empty()) save_array(options.prefix + ".distances.npy", distances);
    return figures;
}

void run_mesh_query(const QueryCommand& options) {
    if (const auto queried = load_queried_scene(options.scene, options)) {
        std::optional<QueriedScene> other;
        if (!options.with_scene.empty()) other = load_queried_scene(options.with_scene, options);
        if (options.with_scene.empty() || other)
            return run_scene_query(options, *queried, other ? &*other : nullptr);
    }
    Json document = new_document("query");
    const SceneTree tree = load_tree(options.scene, options);
    document["scene"] = scene_json(tree.scene);
    document["load_ms"] = tree.scene.load_ms;
    document["build"] = build_json(tree.bvh, tree_stats(tree.bvh, {.with_hash = false}), {});
    const QueryFigures figures = about(
        options.scene,
        [&] {
            return options.closest           ? answer_closest(options, tree)
                   : options.signed_distance ? signed_of_tree(options, tree, document)
                                             : answer_pairs(options, tree);
        },
        options.queries_file);
    document["query"] = Json::array({query_json(figures, options)});
    tell_left_out(document, tree.bvh.left_out(), options.common);
    if (options.common.prints_tables()) {
        if (options.signed_distance) print_solid(document["solid"]);
        print_query(document["query"][0]);
    }
    write_json(document, options.common);
}

}  // namespace raydix::cli
