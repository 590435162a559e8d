#include "cpu_figures.h"

#include <algorithm>

namespace raydix::bench {
namespace {

using cli::Json;
using cli::Spread;

template <class T, class Make>
Json or_null(const std::optional<T>& value, const Make& make) {
    return value ? Json(make(*value)) : Json(nullptr);
}
Json spread_or_null(const std::optional<Spread>& spread) {
    return or_null(spread, cli::spread_json);
}

Spread spread_from(const Json& json) {
    return {json.at("median").get<double>(), json.at("min").get<double>(),
            json.at("max").get<double>()};
}
std::optional<Spread> spread_or_none(const Json& json) {
    return json.is_null() ? std::nullopt : std::optional(spread_from(json));
}

Json build_json(const BuildFigures& b, std::uint64_t triangles) {
    return {{"peer", b.peer.text},
            {"threads", b.threads},
            {"fresh_ms", cli::spread_json(b.fresh_ms)},
            {"kept_ms", cli::spread_json(b.kept_ms)},
            {"copy_ms", spread_or_null(b.copy_ms)},
            {"bytes", b.bytes.own},
            {"bytes_referenced", b.bytes.referenced},
            {"bytes_per_triangle", double(b.bytes.own) / double(triangles)},
            {"sah", or_null(b.sah, [](double sah) { return sah; })}};
}

BuildFigures build_from(const Json& json) {
    BuildFigures b;
    b.peer.text = json.at("peer").get<std::string>();
    b.threads = json.at("threads").get<int>();
    b.fresh_ms = spread_from(json.at("fresh_ms"));
    b.kept_ms = spread_from(json.at("kept_ms"));
    b.copy_ms = spread_or_none(json.at("copy_ms"));
    b.bytes = {json.at("bytes").get<std::uint64_t>(),
               json.at("bytes_referenced").get<std::uint64_t>()};
    if (!json.at("sah").is_null()) b.sah = json.at("sah").get<double>();
    return b;
}

Json mode_json(const ModeFigures& m) {
    Json json{{"peer", m.peer.text},
              {"mode", m.name},
              {"call", m.single ? "single" : "batch"},
              {"default", m.automatic},
              {"threads", m.threads},
              {"mrays_per_s", spread_or_null(m.mrays_per_s)},
              {"different_hits", nullptr}};
    if (!m.peer.ours())
        json["different_hits"] = {{"hit_or_miss", m.differences.hit_or_miss},
                                  {"distance", m.differences.distance}};
    return json;
}

ModeFigures mode_from(const Json& json) {
    ModeFigures m;
    m.peer.text = json.at("peer").get<std::string>();
    m.name = json.at("mode").get<std::string>();
    m.single = json.at("call").get<std::string>() == "single";
    m.automatic = json.at("default").get<bool>();
    m.threads = json.at("threads").get<int>();
    m.mrays_per_s = spread_or_none(json.at("mrays_per_s"));
    if (const Json& other = json.at("different_hits"); !other.is_null())
        m.differences = {other.at("hit_or_miss").get<std::uint64_t>(),
                         other.at("distance").get<std::uint64_t>()};
    return m;
}

Json workload_json(const WorkloadFigures& w) {
    Json json{{"workload", w.name},
              {"count", w.rays},
              {"calls", w.calls},
              {"hits", w.hits},
              {"modes", Json::array()}};
    for (const ModeFigures& m : w.modes) json["modes"].push_back(mode_json(m));
    return json;
}

WorkloadFigures workload_from(const Json& json) {
    WorkloadFigures w;
    w.name = json.at("workload").get<std::string>();
    w.rays = json.at("count").get<std::uint64_t>();
    w.calls = json.at("calls").get<std::uint64_t>();
    w.hits = json.at("hits").get<std::uint64_t>();
    for (const Json& mode : json.at("modes")) w.modes.push_back(mode_from(mode));
    return w;
}

}  // namespace

bool SceneFigures::has(const std::string& workload) const {
    return std::ranges::any_of(workloads, [&](const auto& w) { return w.name == workload; });
}

Json figures_json(const SceneFigures& figures) {
    Json json{{"name", figures.scene},          {"group", figures.group},
              {"triangles", figures.triangles}, {"threads", figures.threads},
              {"builds", Json::array()},        {"workloads", Json::array()}};
    for (const BuildFigures& b : figures.builds)
        json["builds"].push_back(build_json(b, figures.triangles));
    for (const WorkloadFigures& w : figures.workloads)
        json["workloads"].push_back(workload_json(w));
    return json;
}

SceneFigures figures_from(const Json& json) {
    SceneFigures figures;
    figures.scene = json.at("name").get<std::string>();
    figures.group = json.at("group").get<std::string>();
    figures.triangles = json.at("triangles").get<std::uint64_t>();
    figures.threads = json.at("threads").get<int>();
    for (const Json& build : json.at("builds")) figures.builds.push_back(build_from(build));
    for (const Json& w : json.at("workloads")) figures.workloads.push_back(workload_from(w));
    return figures;
}

}  // namespace raydix::bench
