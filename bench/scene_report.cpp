#include "scene_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <tuple>

namespace raydix::bench {
namespace {

using cli::Json;
using cli::Spread;

/// Million rays or queries a second, or milliseconds.
Spread figure_of(const Question& question, const TimedMode& mode) {
    if (question.in_ms) return cli::spread_of(mode.ms);
    std::vector<double> rates;
    for (const double ms : mode.ms) rates.push_back(double(question.count) / (1e3 * ms));
    return cli::spread_of(rates);
}

Json mode_json(const Question& question, const TimedMode& mode) {
    Json json{{"side", mode.side},
              {"mode", mode.name},
              {"call", mode.single ? "single" : "batch"},
              {question.in_ms ? "ms" : "mrays_per_s", cli::spread_json(figure_of(question, mode))},
              {"answers", nullptr}};
    if (mode.differences)
        json["answers"] = {{"equal", mode.differences->equal},
                           {"other_primitive", mode.differences->other_primitive},
                           {"hit_or_miss", mode.differences->hit_or_miss},
                           {"distance", mode.differences->distance},
                           {"explained", mode.differences->explained},
                           {"unexplained", mode.differences->unexplained()}};
    return json;
}

Json question_json(const Question& question) {
    Json json{{"workload", question.workload},
              {"scene", question.scene},
              {"question", question.text},
              {"primitives", question.primitives},
              {"count", question.count},
              {"hits", question.hits},
              {"modes", Json::array()},
              {"ratios", Json::array()},
              {"ratio_of", question.compares_times ? "times" : "rates"}};
    for (const TimedMode& mode : question.modes) json["modes"].push_back(mode_json(question, mode));
    for (const Ratio& r : ratios_of(question)) {
        const TimedMode& peer = question.modes[r.peer];
        json["ratios"].push_back({{"figure", r.figure},
                                  {"peer", peer.side + ", " + peer.name},
                                  {"ratio", r.median},
                                  {"min", r.min},
                                  {"max", r.max}});
    }
    return json;
}

std::string figure_text(const Question& question, const TimedMode& mode) {
    return fmt::format("{:.2f}", figure_of(question, mode).median);
}

std::string differences_text(const TimedMode& mode) {
    if (!mode.differences) return "-";
    return fmt::format("{} / {} / {}", mode.differences->equal, mode.differences->different(),
                       mode.differences->unexplained());
}

void print_row(const Question& question, const std::string& figure, const std::string& ours,
               const TimedMode* peer, const std::string& ratio) {
    fmt::print("  {:<26} {:<14} {:>14} {:>9} {:<40} {:<20} {}\n", question.text, figure, ours,
               peer == nullptr ? "-" : figure_text(question, *peer),
               peer == nullptr ? "-" : peer->side + ", " + peer->name, ratio,
               peer == nullptr ? "-" : differences_text(*peer));
}

}  // namespace

Json group_json(const SceneGroup& group) {
    Json json{{"group", group.name}, {"seed", group.seed}, {"questions", Json::array()}};
    for (const Question& question : group.questions)
        json["questions"].push_back(question_json(question));
    return json;
}

void print_group_head(const SceneGroup& group, const SceneBench& options, int threads) {
    fmt::print(
        "\n{}, seed {}: quality {}, {} threads, {} rounds, {} time; million rays or queries a "
        "second, commits in ms\n  {:<26} {:<14} {:>14} {:>9} {:<40} {:<20} {}\n",
        group.name, group.seed, options.quality, threads, options.rounds, options.clock, "question",
        "figure", "raydix", "peer", "best of the peer", "ratio (min, max)",
        "answers: equal / different / unexplained");
}

void print_question(const Question& question, const Question* before) {
    if (before == nullptr ||
        std::tie(question.workload, question.scene) != std::tie(before->workload, before->scene))
        fmt::print("{}: {}, {} primitives\n", question.workload, question.scene,
                   cli::grouped(question.primitives));
    for (const Ratio& r : ratios_of(question))
        print_row(question, r.figure, figure_text(question, question.modes[r.ours]),
                  &question.modes[r.peer],
                  fmt::format("{:.2f} ({:.2f}, {:.2f})", r.median, r.min, r.max));
}

Json summary_json(const std::vector<SceneGroup>& groups) {
    struct Row {
        std::string group, workload, figure;
        bool less_is_better;
        std::vector<std::pair<double, std::string>> values;
    };
    std::vector<Row> rows;
    for (const SceneGroup& group : groups)
        for (const Question& question : group.questions)
            for (const Ratio& r : ratios_of(question)) {
                auto row = std::find_if(rows.begin(), rows.end(), [&](const Row& known) {
                    return std::tie(known.group, known.workload, known.figure) ==
                           std::tie(group.name, question.workload, r.figure);
                });
                if (row == rows.end())
                    row = rows.insert(
                        rows.end(),
                        {group.name, question.workload, r.figure, question.compares_times, {}});
                row->values.emplace_back(r.median, question.scene + ", " + question.text);
            }
    Json summary = Json::array();
    for (const Row& row : rows) {
        std::vector<double> values;
        for (const auto& [value, where] : row.values) values.push_back(value);
        const auto [least, most] = std::minmax_element(row.values.begin(), row.values.end());
        const auto& worst = row.less_is_better ? *most : *least;
        summary.push_back({{"group", row.group},
                           {"workload", row.workload},
                           {"figure", row.figure},
                           {"median", cli::spread_of(values).median},
                           {"worst", worst.first},
                           {"worst_at", worst.second}});
    }
    return summary;
}

void print_summary(const Json& summary) {
    fmt::print("\nratios over all scenes and questions\n{:<10} {:<10} {:<14} {:>8} {:>8}  {}\n",
               "group", "workload", "figure", "median", "worst", "worst at");
    for (const Json& row : summary)
        fmt::print("{:<10} {:<10} {:<14} {:>8.2f} {:>8.2f}  {}\n", row["group"].get<std::string>(),
                   row["workload"].get<std::string>(), row["figure"].get<std::string>(),
                   row["median"].get<double>(), row["worst"].get<double>(),
                   row["worst_at"].get<std::string>());
}

}  // namespace raydix::bench
