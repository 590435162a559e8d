#include "cpu_builds.h"

#include <fmt/format.h>

#include "bench_clock.h"
#include "child_process.h"
#include "cli/output.h"

namespace raydix::bench {
namespace {

using cli::Json;

constexpr int builds_of_a_process = 4;  // one fresh, the others into kept memory

std::vector<std::string> arguments_of(const PeerName& peer, const std::string& scene,
                                      const CpuBench& options, int threads) {
    std::vector<std::string> arguments{"--build-of", peer.text,
                                       "--threads",  std::to_string(threads),
                                       "--seed",     std::to_string(options.common.seed),
                                       "--clock",    options.clock};
    if (options.sah) arguments.emplace_back("--sah");
    arguments.emplace_back("--");
    arguments.push_back(scene);
    return arguments;
}

/// What the processes of one peer with one number of threads have printed.
struct PeerBuilds {
    BuildFigures figures;
    std::vector<double> fresh_ms, kept_ms, copy_ms;

    void add(const Json& printed) {
        fresh_ms.push_back(printed["fresh_ms"].get<double>());
        for (const Json& ms : printed["kept_ms"]) kept_ms.push_back(ms.get<double>());
        for (const Json& ms : printed["copy_ms"]) copy_ms.push_back(ms.get<double>());
        figures.bytes = {printed["bytes"].get<std::uint64_t>(),
                         printed["bytes_referenced"].get<std::uint64_t>()};
        if (!printed["sah"].is_null()) figures.sah = printed["sah"].get<double>();
    }
    [[nodiscard]] BuildFigures summed_up() const {
        BuildFigures all = figures;
        all.fresh_ms = cli::spread_of(fresh_ms);
        all.kept_ms = cli::spread_of(kept_ms);
        if (!copy_ms.empty()) all.copy_ms = cli::spread_of(copy_ms);
        return all;
    }
};

}  // namespace

std::vector<BuildFigures> measure_builds(const std::string& scene, const CpuBench& options,
                                         const std::vector<int>& thread_counts) {
    std::vector<PeerBuilds> all;
    for (const PeerName& peer : peers_of(options)) {
        if (peer.robust()) continue;
        for (const int threads : thread_counts) {
            BuildFigures& figures = all.emplace_back().figures;
            figures.peer = peer;
            figures.threads = threads;
        }
    }
    cli::Progress progress("builds of " + scene, options.common);
    for (int round = 0; round < options.rounds; ++round)
        for (std::size_t k = 0; k < all.size(); ++k) {
            const BuildFigures& of = all[k].figures;
            all[k].add(Json::parse(
                output_of_this_program(arguments_of(of.peer, scene, options, of.threads))));
            progress.show((round + double(k + 1) / double(all.size())) / options.rounds);
        }
    std::vector<BuildFigures> figures;
    for (const PeerBuilds& builds : all) figures.push_back(builds.summed_up());
    return figures;
}

void print_builds_of_one_peer(const CpuBench& options) {
    Model scene = load_flat_model(options.scenes.front(), options.common.seed);
    scene.mesh().vertices.reserve(scene.mesh().vertices.size() + 1);
    const auto peer = make_peer({options.build_of}, scene.mesh(), options, options.common.threads);
    const clockid_t clock = clock_from(options.clock);
    Json result{{"fresh_ms", nullptr}, {"kept_ms", Json::array()}, {"copy_ms", Json::array()}};
    for (int k = 0; k < builds_of_a_process; ++k) {
        const double start = seconds_of(clock);
        peer->build();
        const double ms = 1e3 * (seconds_of(clock) - start);
        if (k == 0) {
            result["fresh_ms"] = ms;
            continue;
        }
        result["kept_ms"].push_back(ms);
        if (const auto copy = peer->copy_ms()) result["copy_ms"].push_back(*copy);
    }
    const PeerBytes bytes = peer->bytes();
    const std::optional<double> sah = options.sah ? peer->sah() : std::nullopt;
    result["bytes"] = bytes.own;
    result["bytes_referenced"] = bytes.referenced;
    result["sah"] = sah ? Json(*sah) : Json(nullptr);
    fmt::print("{}\n", result.dump());
}

}  // namespace raydix::bench
