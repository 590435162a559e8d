#include "cpu_builds.h"

#include <fmt/format.h>

#include "child_process.h"
#include "cli/output.h"
#include "measure/stopwatch.h"

namespace raydix::bench {
namespace {

using cli::Json;

constexpr int builds_of_a_process = 4;  // one fresh, the others into kept memory

std::vector<std::string> arguments_of(const PeerName& peer, const std::string& scene,
                                      const CpuBench& options, int threads) {
    std::vector<std::string> arguments{"--build-of", peer.text, "--threads",
                                       std::to_string(threads)};
    const auto add = [&](const char* option, auto value) {
        arguments.emplace_back(option);
        arguments.push_back(std::to_string(value));
    };
    add("--max-leaf", options.max_leaf);
    add("--width", options.width);
    add("--seed", options.common.seed);
    if (options.sah) arguments.emplace_back("--sah");
    arguments.emplace_back("--");
    arguments.push_back(scene);
    return arguments;
}

void add_process(PeerBuilds& builds, const Json& printed) {
    builds.fresh_ms.push_back(printed["fresh_ms"].get<double>());
    for (const Json& ms : printed["kept_ms"]) builds.kept_ms.push_back(ms.get<double>());
    for (const Json& ms : printed["layout_ms"]) builds.layout_ms.push_back(ms.get<double>());
    builds.bytes = {printed["bytes"].get<std::uint64_t>(),
                    printed["bytes_referenced"].get<std::uint64_t>()};
    if (!printed["sah"].is_null()) builds.sah = printed["sah"].get<double>();
}

}  // namespace

std::vector<PeerBuilds> measure_builds(const std::string& scene, const CpuBench& options,
                                       const std::vector<int>& thread_counts) {
    std::vector<PeerBuilds> all;
    for (const PeerName& peer : peers_of(options))
        for (const int threads : thread_counts) {
            PeerBuilds& builds = all.emplace_back();
            builds.peer = peer;
            builds.threads = threads;
        }
    cli::Progress progress("builds of " + scene, options.common);
    for (int round = 0; round < options.rounds; ++round)
        for (std::size_t k = 0; k < all.size(); ++k) {
            add_process(all[k], Json::parse(output_of_this_program(
                                    arguments_of(all[k].peer, scene, options, all[k].threads))));
            progress.show((round + double(k + 1) / double(all.size())) / options.rounds);
        }
    return all;
}

void print_builds_of_one_peer(const CpuBench& options) {
    Model scene = load_flat_model(options.scenes.front(), options.common.seed);
    scene.mesh().vertices.reserve(scene.mesh().vertices.size() + 1);
    const auto peer = make_peer({options.build_of}, scene.mesh(), options, options.common.threads);
    Json result{{"fresh_ms", nullptr}, {"kept_ms", Json::array()}, {"layout_ms", Json::array()}};
    for (int k = 0; k < builds_of_a_process; ++k) {
        peer->prepare();
        Stopwatch watch;
        peer->build();
        const double ms = watch.lap();
        if (k == 0) {
            result["fresh_ms"] = ms;
            continue;
        }
        result["kept_ms"].push_back(ms);
        if (const auto layout = peer->layout_ms()) result["layout_ms"].push_back(*layout);
    }
    const PeerBytes bytes = peer->bytes();
    const std::optional<double> sah = options.sah ? peer->sah() : std::nullopt;
    result["bytes"] = bytes.own;
    result["bytes_referenced"] = bytes.referenced;
    result["sah"] = sah ? Json(*sah) : Json(nullptr);
    fmt::print("{}\n", result.dump());
}

}  // namespace raydix::bench
