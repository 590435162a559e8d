// raydix query: what all its kinds share. One kind a call; each file query_*.cpp answers some.
#pragma once

#include <raydix/scene.h>
#include <raydix/solid.h>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "output.h"

namespace raydix::cli {

struct QueryCommand {
    CommonOptions common;
    std::string scene, queries_file, prefix, tree = "automatic";
    std::string with_scene, builder;
    std::optional<std::uint32_t> k;
    std::optional<double> radius, max_distance;
    bool box = false, sort = false, strict = false;
    bool closest = false, signed_distance = false, pairs = false, narrow = false;
    int repeat = 5;
    std::uint64_t max_result_bytes = 0;
};

/// What a kind of query found, and how long each repeat took.
struct QueryFigures {
    std::string kind;
    std::uint64_t queries = 0, invalid_queries = 0, found = 0;
    std::vector<double> seconds{};
};

/// An entry of `query[]`: what was asked, queries, invalid_queries, found, mqueries_per_s.
[[nodiscard]] Json query_json(const QueryFigures& figures, const QueryCommand& options);
void print_query(const Json& query);

/// A file, a built-in scene, or the scene of a .rdx file.
[[nodiscard]] Model load_query_scene(const std::string& scene, const CommonOptions& common);

/// --queries, or the scene's own points.
[[nodiscard]] std::vector<Vec3> load_queries(const QueryCommand& options, const Model& scene);

/// Seconds of `work`, once to warm up and then `repeat` times.
template <class Work>
std::vector<double> timed_repeats(int repeat, const Work& work) {
    work();
    std::vector<double> seconds;
    for (int i = 0; i < repeat; ++i) {
        const auto start = std::chrono::steady_clock::now();
        work();
        seconds.push_back(
            std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    }
    return seconds;
}

/// A scene that keeps its meshes and nodes.
struct QueriedScene {
    std::optional<Model> model;  // none: it comes from a .rdx file
    Scene scene;
    Json json;
    double load_ms = 0;
    std::optional<double> commit_ms;
    Quality quality = Quality::balanced;
    bool is_one_mesh = false;
};
/// None: an option or the file asks for one binary tree, or there are no triangles.
[[nodiscard]] std::optional<QueriedScene> load_queried_scene(const std::string& name,
                                                             const QueryCommand& options);

/// The `solid` object of a document.
[[nodiscard]] Json solid_json(const Solid& solid);
void print_solid(const Json& solid);
[[nodiscard]] QueryFigures answer_signed(const QueryCommand& options, const Solid& solid,
                                         const std::vector<Vec3>& queries);

/// --knn, --radius and --box: points of a cloud, or the vertices of a mesh.
void run_point_query(const QueryCommand& options);
/// --closest, --signed-distance and --pairs: triangles; pairs of points too.
void run_mesh_query(const QueryCommand& options);
/// The same of scenes. `other`: of --with, or null.
void run_scene_query(const QueryCommand& options, const QueriedScene& queried,
                     const QueriedScene* other);

}  // namespace raydix::cli
