// How fast are the closest point of a mesh and the inside test? Ours beside CGAL's AABB_tree and
// Side_of_triangle_mesh, in one run, in turns (A B A B). Answers are compared first. Wall-clock and
// processor time, one JSON line a question.
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Side_of_triangle_mesh.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <fmt/format.h>
#include <raydix/bvh.h>
#include <raydix/closest.h>
#include <raydix/machine.h>
#include <raydix/raydix.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <ctime>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "base/math.h"
#include "closest_queries.h"
#include "work_times.h"

namespace {

using namespace raydix;
using bench::spread_json;
using bench::time_of;
using bench::Times;
using Json = nlohmann::ordered_json;
// Distances need no exact signs: the plain kernel is CGAL's fastest. The inside test does.
using Plain = CGAL::Simple_cartesian<double>;
using Exact = CGAL::Exact_predicates_inexact_constructions_kernel;
using PlainTriangles = std::vector<Plain::Triangle_3>;
using PlainTree = CGAL::AABB_tree<
    CGAL::AABB_traits<Plain, CGAL::AABB_triangle_primitive<Plain, PlainTriangles::const_iterator>>>;
using Surface = CGAL::Surface_mesh<Exact::Point_3>;
using InsideTest = CGAL::Side_of_triangle_mesh<Surface, Exact>;

struct Options {
    std::string scene = "builtin:figure?triangles=1000000", builder = "ploc";
    int threads = 2, repeat = 3;
    std::uint32_t queries = 100'000;
};

/// body(i) for all of [0, n), in chunks over threads.
void each_over_threads(std::size_t n, int threads, const std::function<void(std::size_t)>& body) {
    constexpr std::size_t chunk = 256;
    std::atomic<std::size_t> next{0};
    const auto work = [&] {
        for (std::size_t begin = next.fetch_add(chunk); begin < n; begin = next.fetch_add(chunk))
            for (std::size_t i = begin; i < std::min(begin + chunk, n); ++i) body(i);
    };
    std::vector<std::thread> others;
    for (int t = 1; t < threads; ++t) others.emplace_back(work);
    work();
    for (std::thread& thread : others) thread.join();
}

template <class Kernel>
typename Kernel::Point_3 cgal_point(Vec3 p) {
    return {p.x, p.y, p.z};
}

/// A mesh in all forms that are compared.
class Peers {
public:
    explicit Peers(const Options& options)
        : mesh_(load_flat_model(options.scene).mesh()),
          bvh_(build_bvh(
              mesh_, {.builder = builder_from_name(options.builder), .threads = options.threads})) {
        for (const Triangle& t : mesh_.triangles)
            triangles_.emplace_back(cgal_point<Plain>(mesh_.vertices[t[0]]),
                                    cgal_point<Plain>(mesh_.vertices[t[1]]),
                                    cgal_point<Plain>(mesh_.vertices[t[2]]));
        tree_.insert(triangles_.begin(), triangles_.end());
        tree_.build();
        tree_.accelerate_distance_queries();
    }

    /// Null if the mesh is not a closed surface that CGAL can hold.
    [[nodiscard]] std::unique_ptr<InsideTest> inside_test() {
        for (const Vec3 p : mesh_.vertices) surface_.add_vertex(cgal_point<Exact>(p));
        for (const Triangle& t : mesh_.triangles)
            if (surface_.add_face(Surface::Vertex_index(t[0]), Surface::Vertex_index(t[1]),
                                  Surface::Vertex_index(t[2])) == Surface::null_face())
                return nullptr;
        if (!CGAL::is_closed(surface_)) return nullptr;
        auto test = std::make_unique<InsideTest>(surface_);
        (*test)(Exact::Point_3(0, 0, 0));  // makes its tree
        return test;
    }

    [[nodiscard]] const Mesh& mesh() const { return mesh_; }
    [[nodiscard]] const Bvh& bvh() const { return bvh_; }
    [[nodiscard]] float cgal_distance(Vec3 query) const {
        return static_cast<float>(std::sqrt(tree_.squared_distance(cgal_point<Plain>(query))));
    }

private:
    Mesh mesh_;
    Bvh bvh_;
    PlainTriangles triangles_;
    PlainTree tree_;
    Surface surface_;
};

/// Batches over all threads, and one call a query on one thread; CGAL has single calls only.
struct Contest {
    const char *question, *where;
    std::size_t queries;
    std::function<void()> batch, cgal_batch, single, cgal_single;
};

class ClosestStudy {
public:
    explicit ClosestStudy(const Options& options) : options_(options), peers_(options) {}

    void run() {
        closest("near", near(options_.queries));
        closest("around", around(options_.queries, 1));
        closest("far", around(options_.queries, 4));
        const std::unique_ptr<InsideTest> test = peers_.inside_test();
        if (test == nullptr) return;
        inside("near", *test, near(options_.queries));
        inside("around", *test, around(options_.queries, 1));
    }

private:
    [[nodiscard]] std::vector<Vec3> near(std::uint32_t n) const {
        return bench::near_queries(peers_.mesh(), peers_.bvh().bounds(), n, 1);
    }
    [[nodiscard]] std::vector<Vec3> around(std::uint32_t n, float scale) const {
        return bench::queries_around(peers_.bvh().bounds(), n, scale, 2);
    }

    void closest(const char* where, const std::vector<Vec3>& queries) const {
        const Bvh& bvh = peers_.bvh();
        std::vector<ClosestPoint> found(queries.size());
        std::vector<float> theirs(queries.size());
        const auto ask = [&](std::size_t i) { theirs[i] = peers_.cgal_distance(queries[i]); };
        closest_points(bvh, queries, found);
        each_over_threads(queries.size(), options_.threads, ask);
        const Aabb box = bvh.bounds();
        const float largest = max_of(abs_max(box.lo), abs_max(box.hi));
        for (std::size_t i = 0; i < queries.size(); ++i)
            if (!(std::fabs(found[i].distance - theirs[i]) <=
                  1e-5f * theirs[i] + 1e-6f * max_of(largest, abs_max(queries[i]))))
                throw InputError(fmt::format("query {}: distance {}, but CGAL's is {}", i,
                                             found[i].distance, theirs[i]));
        report({"closest", where, queries.size(),
                [&] { closest_points(bvh, queries, found, {.threads = options_.threads}); },
                [&] { each_over_threads(queries.size(), options_.threads, ask); },
                [&] {
                    for (std::size_t i = 0; i < queries.size(); ++i)
                        found[i] = closest_point(bvh, queries[i]);
                },
                [&] { each_over_threads(queries.size(), 1, ask); }});
    }

    void inside(const char* where, const InsideTest& test, const std::vector<Vec3>& queries) const {
        const Solid solid(peers_.bvh());
        std::vector<std::uint8_t> ours(queries.size()), theirs(queries.size());
        const auto ask = [&](std::size_t i) {
            theirs[i] = test(cgal_point<Exact>(queries[i])) != CGAL::ON_UNBOUNDED_SIDE;
        };
        contains(solid, queries, ours);
        each_over_threads(queries.size(), options_.threads, ask);
        if (ours != theirs) throw InputError("CGAL finds other queries inside");
        report({"inside", where, queries.size(),
                [&] { contains(solid, queries, ours, options_.threads); },
                [&] { each_over_threads(queries.size(), options_.threads, ask); },
                [&] {
                    for (std::size_t i = 0; i < queries.size(); ++i)
                        ours[i] = contains(solid, queries[i]);
                },
                [&] { each_over_threads(queries.size(), 1, ask); }});
    }

    static float abs_max(Vec3 p) {
        return max_of(max_of(std::fabs(p.x), std::fabs(p.y)), std::fabs(p.z));
    }

    void report(const Contest& contest) const {
        const std::pair<const char*, const std::function<void()>*> works[] = {
            {"batch", &contest.batch},
            {"cgal_batch", &contest.cgal_batch},
            {"single", &contest.single},
            {"cgal_single", &contest.cgal_single}};
        std::vector<std::vector<Times>> times(std::size(works));
        for (int round = 0; round < options_.repeat; ++round)
            for (std::size_t w = 0; w < std::size(works); ++w) {
                const Times t = time_of(*works[w].second);
                const double per_query = 1e6 / static_cast<double>(contest.queries);
                times[w].push_back({t.wall * per_query, t.cpu * per_query});
            }
        Json line{{"bench", contest.question},   {"cpu", machine_info().cpu},
                  {"scene", options_.scene},     {"triangles", peers_.mesh().triangles.size()},
                  {"builder", options_.builder}, {"queries", contest.where},
                  {"count", contest.queries},    {"threads", options_.threads},
                  {"repeat", options_.repeat}};
        for (std::size_t w = 0; w < std::size(works); ++w)
            line[works[w].first] = {{"wall_ns", spread_json(times[w], &Times::wall)},
                                    {"cpu_ns", spread_json(times[w], &Times::cpu)}};
        fmt::print("{}\n", line.dump());
        std::fflush(stdout);
    }

    const Options& options_;
    Peers peers_;
};

}  // namespace

int main(int argc, char** argv) {
    CLI::App app{"Closest points and inside tests, beside CGAL's"};
    Options options;
    app.add_option("--scene", options.scene, "a mesh; inside tests if it is closed")
        ->capture_default_str();
    app.add_option("--builder", options.builder, "of the tree")->capture_default_str();
    app.add_option("--queries", options.queries, "of each kind")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    app.add_option("--threads", options.threads, "of batches")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    app.add_option("--repeat", options.repeat, "turns after the comparison")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    try {
        ClosestStudy(options).run();
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench_closest: {}\n", error.what());
        return 1;
    }
    return 0;
}
