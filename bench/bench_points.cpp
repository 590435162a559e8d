// raydix bench points: our index of points beside nanoflann, on the same points, queries and
// threads. Answers are compared first; then all are timed in turns (A B A B).
#include <fmt/format.h>
#include <raydix/error.h>
#include <raydix/machine.h>
#include <raydix/points.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <random>

#include "bench_clock.h"
#include "cli/output.h"
#include "cli/program.h"
#include "point_peer.h"

namespace raydix::bench {
namespace {

using cli::Json;

struct PointBench {
    cli::CommonOptions common;
    std::vector<std::string> scenes;
    std::vector<int> leaves{10, 32};
    std::size_t queries = 1'000'000;
    std::uint32_t k = 8;
    double mean_found = 10;
    std::optional<double> radius;
    int rounds = 5;
    std::string clock = "wall";
};

/// One question: ours and the peers', in turns.
struct Contest {
    std::string question;
    double count;  // points built or queries answered
    std::vector<std::pair<std::string, std::function<void()>>> works;  // ours first
};

class PointStudy {
public:
    explicit PointStudy(const PointBench& options)
        : options_(options),
          threads_(options.common.threads > 0 ? options.common.threads : machine_info().cores),
          clock_(clock_from(options.clock)) {}

    void run() {
        Json document = cli::new_document("bench points");
        document["nanoflann"] = nanoflann_version();
        document["options"] = {
            {"threads", threads_},         {"rounds", options_.rounds}, {"k", options_.k},
            {"queries", options_.queries}, {"leaves", options_.leaves}, {"clock", options_.clock},
            {"seed", options_.common.seed}};
        document["scenes"] = Json::array();
        for (const std::string& name : options_.scenes)
            document["scenes"].push_back(cli::about(name, [&] { return study(name); }));
        write_json(document, options_.common);
    }

private:
    Json study(const std::string& name) {
        const Model scene = load_flat_model(name, options_.common.seed);
        const std::vector<Vec3>& points = scene.mesh().vertices;
        const Points index = build_points(points, {.strict = true, .threads = threads_});
        if (index.empty()) throw InputError("holds no points");
        const std::vector<Vec3> random = shuffled(points), ordered = along_curve(random);
        const float radius = options_.radius ? static_cast<float>(*options_.radius)
                                             : radius_that_finds(index, random);
        std::vector<PointPeer> peers;
        for (const int leaf : options_.leaves) peers.emplace_back(points, leaf);
        const double found = compare(index, peers, random, radius);
        Json json{{"scene", scene.name},      {"points", points.size()},
                  {"queries", random.size()}, {"radius", radius},
                  {"found_by_radius", found}, {"bytes", index.bytes()},
                  {"contests", Json::array()}};
        if (options_.common.prints_tables())
            fmt::print(
                "\n{}: {} points, {} queries, {} threads; radius {:.3g} finds {:.1f}; {} time, ns "
                "per point or query\n{:<24} {:>10} {:>10} {:>10} {:>22} {:>7}\n",
                scene.name, cli::grouped(points.size()), cli::grouped(random.size()), threads_,
                radius, found, options_.clock, "", "raydix", "min", "max", "nanoflann", "ratio");
        json["contests"].push_back(run(build_contest(points)));
        for (const auto& [order, queries] :
             {std::pair{"random", &random}, std::pair{"ordered", &ordered}}) {
            json["contests"].push_back(run(knn_contest(order, index, peers, *queries)));
            json["contests"].push_back(run(radius_contest(order, index, peers, *queries, radius)));
            json["contests"].push_back(run(single_contest(order, index, peers, *queries)));
        }
        return json;
    }

    /// The points themselves, or as many as were asked for.
    std::vector<Vec3> shuffled(std::vector<Vec3> points) const {
        std::shuffle(points.begin(), points.end(), std::mt19937_64(options_.common.seed));
        points.resize(std::min(points.size(), options_.queries));
        return points;
    }
    static std::vector<Vec3> along_curve(const std::vector<Vec3>& queries) {
        std::vector<Vec3> ordered;
        for (const std::uint32_t i : build_points(queries, {.tree = PointsTree::bvh}).order())
            ordered.push_back(queries[i]);
        return ordered;
    }
    /// So that a query finds mean_found points, itself included, on average.
    float radius_that_finds(const Points& index, const std::vector<Vec3>& queries) const {
        const std::span<const Vec3> some(queries.data(),
                                         std::min<std::size_t>(4000, queries.size()));
        std::vector<std::uint32_t> counts(some.size());
        const Aabb box = index.bounds();
        float low = 0, high = (box.hi.x - box.lo.x) + (box.hi.y - box.lo.y) + (box.hi.z - box.lo.z);
        for (int i = 0; i < 60; ++i) {
            const float middle = 0.5f * (low + high);
            const auto found = radius_count(index, some, middle, counts).found;
            (static_cast<double>(found) < options_.mean_found * static_cast<double>(some.size())
                 ? low
                 : high) = middle;
        }
        return high;
    }

    /// All distances of both questions. Returns the mean number found.
    double compare(const Points& index, const std::vector<PointPeer>& peers,
                   const std::vector<Vec3>& queries, float radius) const {
        const auto nearest = raydix::knn(index, queries, options_.k);
        const auto lists = radius_search(index, queries, radius);
        double sum = 0;
        for (const float distance : lists.distances.view()) sum += distance;
        for (const PointPeer& peer : peers) {
            PeerRows rows;
            peer.knn(queries, options_.k, threads_, rows);
            for (std::size_t i = 0; i < rows.distances.size(); ++i)
                if (rows.distances[i] != nearest.distances[i] && nearest.indices[i] != no_primitive)
                    throw InputError(fmt::format("query {}: {} has another distance: {} and {}",
                                                 i / options_.k, peer.name(), rows.distances[i],
                                                 nearest.distances[i]));
            std::vector<std::uint32_t> counts(queries.size());
            std::vector<PeerRows> of_threads;
            peer.radius(queries, radius, threads_, counts, of_threads);
            for (std::size_t i = 0; i < counts.size(); ++i)
                if (counts[i] != lists.offsets[i + 1] - lists.offsets[i])
                    throw InputError(fmt::format("query {}: {} finds {}, raydix {}", i, peer.name(),
                                                 counts[i],
                                                 lists.offsets[i + 1] - lists.offsets[i]));
            double of_peer = 0;
            for (const PeerRows& part : of_threads)
                for (const float distance : part.distances) of_peer += distance;
            if (std::abs(of_peer - sum) > 1e-9 * sum)
                throw InputError(peer.name() + " has other distances within the radius");
        }
        return static_cast<double>(lists.counts.found) / static_cast<double>(queries.size());
    }

    Contest build_contest(const std::vector<Vec3>& points) const {
        Contest contest{"build, one thread", static_cast<double>(points.size()), {}};
        contest.works.emplace_back(
            "raydix", [&points] { const Points index = build_points(points, {.threads = 1}); });
        for (const int leaf : options_.leaves)
            contest.works.emplace_back(fmt::format("leaf {}", leaf),
                                       [&points, leaf] { const PointPeer peer(points, leaf); });
        return contest;
    }
    Contest knn_contest(const std::string& order, const Points& index,
                        const std::vector<PointPeer>& peers, const std::vector<Vec3>& queries) {
        Contest contest{"knn " + order, static_cast<double>(queries.size()), {}};
        indices_.resize(queries.size() * options_.k);
        distances_.resize(queries.size() * options_.k);
        contest.works.emplace_back("raydix", [&, this] {
            raydix::knn(index, queries, options_.k, indices_, distances_, {.threads = threads_});
        });
        for (const PointPeer& peer : peers)
            contest.works.emplace_back(
                peer.name(), [&, this] { peer.knn(queries, options_.k, threads_, rows_); });
        return contest;
    }
    Contest radius_contest(const std::string& order, const Points& index,
                           const std::vector<PointPeer>& peers, const std::vector<Vec3>& queries,
                           float radius) {
        Contest contest{"radius " + order, static_cast<double>(queries.size()), {}};
        contest.works.emplace_back("raydix", [&, radius, this] {
            const auto lists = radius_search(index, queries, radius, {.threads = threads_});
        });
        counts_.resize(queries.size());
        for (const PointPeer& peer : peers)
            contest.works.emplace_back(peer.name(), [&, radius, this] {
                std::vector<PeerRows> rows;
                peer.radius(queries, radius, threads_, counts_, rows);
            });
        return contest;
    }
    /// One call a query, on one thread.
    Contest single_contest(const std::string& order, const Points& index,
                           const std::vector<PointPeer>& peers, const std::vector<Vec3>& queries) {
        Contest contest{"knn single " + order, static_cast<double>(queries.size()), {}};
        contest.works.emplace_back("raydix", [&, this] {
            const std::size_t k = options_.k;
            for (std::size_t i = 0; i < queries.size(); ++i)
                raydix::knn(index, queries[i], std::span(indices_).subspan(i * k, k),
                            std::span(distances_).subspan(i * k, k));
        });
        for (const PointPeer& peer : peers)
            contest.works.emplace_back(peer.name(),
                                       [&, this] { peer.knn(queries, options_.k, 1, rows_); });
        return contest;
    }

    /// A warm-up each, then rounds of one each; the ratio is to the faster peer's median.
    Json run(const Contest& contest) const {
        for (const auto& [name, work] : contest.works) work();
        std::vector<std::vector<double>> times(contest.works.size());
        for (int round = 0; round < options_.rounds; ++round)
            for (std::size_t w = 0; w < contest.works.size(); ++w) {
                const double start = seconds_of(clock_);
                contest.works[w].second();
                times[w].push_back((seconds_of(clock_) - start) / contest.count * 1e9);
            }
        Json json{{"question", contest.question}, {"ns", Json::object()}};
        double best = INFINITY;
        std::string best_name;
        for (std::size_t w = 0; w < times.size(); ++w) {
            const cli::Spread spread = cli::spread_of(times[w]);
            json["ns"][contest.works[w].first] = spread_json(spread);
            if (w == 0 || spread.median >= best) continue;
            best = spread.median;
            best_name = contest.works[w].first;
        }
        const cli::Spread ours = cli::spread_of(times[0]);
        json["ratio"] = times.size() > 1 ? Json(ours.median / best) : Json(nullptr);
        if (options_.common.prints_tables())
            fmt::print("{:<24} {:>10.1f} {:>10.1f} {:>10.1f} {:>22} {:>7.3f}\n", contest.question,
                       ours.median, ours.min, ours.max,
                       fmt::format("{:.1f} ({})", best, best_name.substr(best_name.rfind('l'))),
                       ours.median / best);
        std::fflush(stdout);
        return json;
    }

    const PointBench& options_;
    int threads_;
    clockid_t clock_;
    std::vector<std::uint32_t> indices_, counts_;
    std::vector<float> distances_;
    PeerRows rows_;
};

void add_options(CLI::App& app, PointBench& options) {
    app.add_option("SCENES", options.scenes,
                   "Point clouds, or meshes for their vertices (default: a million uniform and a "
                   "million clustered points)");
    app.add_option("--leaf", options.leaves, "Leaf sizes of nanoflann")
        ->delimiter(',')
        ->check(CLI::Range(1, 1024))
        ->capture_default_str();
    app.add_option("--queries", options.queries, "Most queries: points of the scene, shuffled")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    app.add_option("--knn", options.k, "Neighbours of a query")
        ->check(CLI::Range(1, 1024))
        ->capture_default_str();
    app.add_option("--found", options.mean_found,
                   "The radius is chosen so that a query finds this many on average")
        ->check(cli::finite_number(false))
        ->capture_default_str();
    app.add_option("--radius", options.radius, "The radius itself")
        ->check(cli::finite_number(false));
    app.add_option("--rounds", options.rounds, "Timed rounds after a warm-up")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str();
    add_clock_option(app, options.clock);
    cli::add_common_options(app, options.common);
}

}  // namespace
}  // namespace raydix::bench

int main(int argc, char** argv) {
    CLI::App app("Our index of points beside nanoflann.", "raydix bench points");
    raydix::bench::PointBench options;
    raydix::bench::add_options(app, options);
    app.callback([&] {
        if (options.scenes.empty())
            options.scenes = {"builtin:uniform?points=1000000", "builtin:clustered?points=1000000"};
        raydix::bench::PointStudy(options).run();
    });
    return raydix::cli::run_program(app, argc, argv);
}
