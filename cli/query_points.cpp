// raydix query --knn, --radius, --box: the points of a scene, and .npy files as contract.md 8 has
// them.
#include <fmt/format.h>
#include <raydix/arrays.h>
#include <raydix/points.h>

#include <algorithm>
#include <cstring>

#include "query.h"

namespace raydix::cli {
namespace {

bool is_npy(const std::string& file) {
    for (const char* end : {".npy", ".npy.gz", ".npy.xz", ".npy.zst"})
        if (file.ends_with(end)) return true;
    return false;
}

template <class Row>
std::vector<Row> rows_of(const std::string& file) {
    constexpr std::size_t columns = sizeof(Row) / sizeof(float);
    const std::vector<float> values = load_array(file, columns);
    std::vector<Row> rows(values.size() / columns);
    if (!rows.empty()) std::memcpy(rows.data(), values.data(), rows.size() * sizeof(Row));
    return rows;
}

std::vector<Aabb> load_boxes(const QueryCommand& options) {
    if (!is_npy(options.queries_file))
        throw InputError(options.queries_file + ": boxes come as a (Q, 6) .npy file");
    return rows_of<Aabb>(options.queries_file);
}

void take_counts(const QueryCounts& counts, QueryFigures& figures) {
    figures.queries = counts.queries;
    figures.invalid_queries = counts.invalid_queries;
    figures.found = counts.found;
}

void save_nearest(const QueryCommand& options, const NearestPoints<float>& nearest) {
    if (options.prefix.empty()) return;
    save_array(options.prefix + ".indices.npy", nearest.indices.view(), *options.k);
    save_array(options.prefix + ".distances.npy", nearest.distances.view(), *options.k);
}

void save_lists(const QueryCommand& options, const PointLists<float>& lists) {
    if (options.prefix.empty()) return;
    save_array(options.prefix + ".offsets.npy", lists.offsets.view());
    save_array(options.prefix + ".indices.npy", lists.indices.view());
    save_array(options.prefix + ".distances.npy", lists.distances.view());
}

QueryFigures answer_nearest(const QueryCommand& options, const Points& index, const Model& scene,
                            const PointQueryOptions& how) {
    QueryFigures figures;
    figures.kind = "knn";
    const std::vector<Vec3> queries = load_queries(options, scene);
    NearestPoints<float> nearest =
        about(options.scene, [&] { return knn(index, queries, *options.k, how); });
    figures.seconds = timed_repeats(options.repeat, [&] {
        knn(index, queries, *options.k, nearest.indices.span(), nearest.distances.span(), how);
    });
    take_counts(nearest.counts, figures);
    save_nearest(options, nearest);
    return figures;
}

template <class Search>
QueryFigures answer_lists(const QueryCommand& options, const char* kind, const Search& search) {
    QueryFigures figures;
    figures.kind = kind;
    PointLists<float> lists;
    figures.seconds = timed_repeats(options.repeat, [&] {
        lists = {};  // never two results at once
        lists = about(options.scene, search);
    });
    take_counts(lists.counts, figures);
    save_lists(options, lists);
    return figures;
}

QueryFigures answer(const QueryCommand& options, const Points& index, const Model& scene) {
    PointQueryOptions how{.threads = options.common.threads,
                          .sort = options.sort,
                          .max_result_bytes = options.max_result_bytes};
    if (options.max_distance) how.max_distance = *options.max_distance;
    if (options.k) return answer_nearest(options, index, scene, how);
    if (options.radius) {
        const std::vector<Vec3> queries = load_queries(options, scene);
        const auto radius = static_cast<float>(*options.radius);
        return answer_lists(options, "radius",
                            [&] { return radius_search(index, queries, radius, how); });
    }
    const std::vector<Aabb> boxes = load_boxes(options);
    return answer_lists(options, "box", [&] { return box_search(index, boxes, how); });
}

Json index_json(const Points& index, int threads) {
    const PointsBuildMs& ms = index.build_ms();
    return {{"tree", points_tree_name(index.tree())},
            {"device", "cpu"},
            {"threads", threads_at_work(threads)},
            {"points", index.size()},
            {"left_out", index.left_out()},
            {"nodes", index.node_count() + index.leaf_count()},
            {"leaves", index.leaf_count()},
            {"references", index.size()},
            {"max_depth", index.depth()},
            {"bytes", index.bytes()},
            {"peak_bytes", index.peak_bytes()},
            {"ms",
             {{"bounds", ms.bounds},
              {"sort", ms.sort},
              {"nodes", ms.nodes},
              {"leaves", ms.leaves},
              {"boxes", ms.boxes},
              {"total", ms.total}}}};
}

void print_index(const Points& index) {
    fmt::print("points       {}{}\n", grouped(index.size()),
               index.left_out() == 0
                   ? std::string()
                   : fmt::format(", {} invalid ones left out", grouped(index.left_out())));
    fmt::print("index        {}, {} groups, depth {}, {} bytes, built in {:.2f} ms\n",
               points_tree_name(index.tree()), grouped(index.leaf_count()), index.depth(),
               grouped(index.bytes()), index.build_ms().total);
}

}  // namespace

std::vector<Vec3> load_queries(const QueryCommand& options, const Model& scene) {
    if (options.queries_file.empty()) return scene.mesh().vertices;
    if (is_npy(options.queries_file)) return rows_of<Vec3>(options.queries_file);
    return load_query_scene(options.queries_file, options.common).mesh().vertices;
}

void run_point_query(const QueryCommand& options) {
    if (options.box && options.queries_file.empty())
        throw CLI::ValidationError("--box", "needs --queries, a (Q, 6) .npy file of boxes");
    const Model scene = load_query_scene(options.scene, options.common);
    const Points index = about(options.scene, [&] {
        return build_points(scene.mesh().vertices, {.tree = points_tree_from_name(options.tree),
                                                    .strict = options.strict,
                                                    .threads = options.common.threads});
    });
    Json document = new_document("query");
    document["scene"] = scene_json(scene);
    document["scene"]["left_out"] = index.left_out();
    document["load_ms"] = scene.load_ms;
    document["build"] = index_json(index, options.common.threads);
    const Json query = query_json(answer(options, index, scene), options);
    document["query"] = Json::array({query});
    if (options.common.prints_tables()) {
        print_index(index);
        print_query(query);
    }
    write_json(document, options.common);
}

}  // namespace raydix::cli
