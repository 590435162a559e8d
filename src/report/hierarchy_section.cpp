// Documents of `bench hierarchy` -> builders over the size of the scene, measured, and over the
// size of the machine, simulated (Karras 2012, section 5).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "report/bar_plot.h"
#include "report/hierarchy_tables.h"
#include "report/html.h"
#include "report/line_plot.h"
#include "report/number_text.h"
#include "report/sections.h"
#include "report/svg.h"

namespace raydix::report {
namespace {

Series series_of(const StudyRun& run, PageColours& colours) {
    const int colour = colours.builders.of(run.builder);
    return {.name = run.name(),
            .x = {},
            .y = {},
            .colour = colour,
            .dash = run.by_levels(),
            .shape = colour};
}

/// Measured milliseconds over keys, and what the model says for this machine.
std::string size_plots(const Study& study, PageColours& colours) {
    std::map<std::pair<double, double>, std::vector<const StudyRun*>> panels;  // bits, threads
    for (const StudyRun& run : study.runs)
        if (run.size_series && run.measured && run.scales())
            panels[{run.bits.value_or(0), run.threads.value_or(0)}].push_back(&run);
    std::string plots, legend;
    for (const auto& [key, runs] : panels) {
        LinePlot plot;
        plot.title = "Hierarchy and boxes over the size of the scene";
        plot.subtitle = fmt::format("{:.0f}-bit codes, {:.0f} {}", key.first, key.second,
                                    key.second == 1 ? "thread" : "threads");
        plot.x_label = "keys (log scale)";
        plot.y_label = "time, ms (log scale)";
        plot.x_unit = "keys";
        plot.y_unit = "ms";
        plot.x_scale = plot.y_scale = LinePlot::Scale::log;
        plot.origin = Origin::measured;
        std::map<std::string, std::vector<const StudyRun*>> lines;
        std::vector<std::string> order;
        for (const StudyRun* run : runs) {
            if (lines[run->name()].empty()) order.push_back(run->name());
            lines[run->name()].push_back(run);
        }
        for (const std::string& name : order) {
            std::vector<const StudyRun*>& line = lines[name];
            std::ranges::stable_sort(line, {},
                                     [](const StudyRun* r) { return r->keys.value_or(0); });
            Series series = series_of(*line.front(), colours);
            for (const StudyRun* run : line) {
                series.x.push_back(or_nan(run->keys));
                series.y.push_back(or_nan(run->measured));
            }
            plot.series.push_back(series);
        }
        if (legend.empty()) legend = legend_html(legend_of(plot));
        plot.with_legend = false;
        plots += line_plot(plot);
    }
    return plots.empty() ? "" : legend + "<div class=\"plots\">" + plots + "</div>\n";
}

const StudyScene* largest_of(const std::vector<StudyScene>& scenes) {
    const StudyScene* largest = nullptr;
    for (const StudyScene& scene : scenes)
        if (!largest || scene.keys.value_or(0) > largest->keys.value_or(0)) largest = &scene;
    return largest;
}

enum class Scaling { time, speed_up, ratio };

LinePlot scaling_frame(const Study& study, const std::string& machine, const std::string& subtitle,
                       Scaling kind) {
    LinePlot plot;
    plot.subtitle = subtitle;
    plot.x_label = "N, size of the machine (log scale)";
    plot.x_unit = "x " + machine;
    plot.x_scale = LinePlot::Scale::log_at_points;
    plot.y_scale = LinePlot::Scale::log;
    plot.origin = Origin::simulated;
    plot.title = "Time on N times " + machine;
    plot.y_label = "time, ms (log scale)";
    plot.y_unit = "ms";
    if (kind == Scaling::speed_up) {
        plot.title = "Speed-up on N times " + machine;
        plot.y_label = fmt::format("speed-up over N = {:g} (log scale)",
                                   study.factors.empty() ? 1.0 : study.factors.front());
        plot.y_unit = "times";
        plot.note = "The dotted line is the ideal: N times the machine, N times as fast.";
        plot.diagonal = true;
    }
    if (kind == Scaling::ratio) {
        plot.title = "Builder against builder on N times " + machine;
        plot.y_label = "time over the best's at this N (log scale)";
        plot.y_unit = "times the best";
        plot.reference = 1;
    }
    return plot;
}

/// Milliseconds of the best builder for each size of the machine.
std::vector<double> best_times(const Study& study, const StudyScene& scene,
                               const std::string& machine) {
    std::vector<double> best(study.factors.size(), std::numeric_limits<double>::infinity());
    for (const StudyRun* run : scene.one_each)
        if (const auto found = run->simulated.find(machine);
            run->is_builder() && found != run->simulated.end())
            for (std::size_t i = 0; i < best.size() && i < found->second.size(); ++i)
                best[i] = std::fmin(best[i], found->second[i]);
    return best;
}

LinePlot scaling_plot(const Study& study, const StudyScene& scene, const std::string& machine,
                      Scaling kind, PageColours& colours) {
    LinePlot plot = scaling_frame(study, machine, scene.title(), kind);
    const std::vector<double> best = best_times(study, scene, machine);
    for (const StudyRun* run : scene.one_each) {
        const auto found = run->simulated.find(machine);
        if (found == run->simulated.end() || found->second.empty()) continue;
        if (kind == Scaling::ratio && !run->is_builder()) continue;
        const std::vector<double>& ms = found->second;
        Series series = series_of(*run, colours);
        for (std::size_t i = 0; i < ms.size() && i < study.factors.size(); ++i) {
            series.x.push_back(study.factors[i]);
            series.y.push_back(kind == Scaling::time       ? ms[i]
                               : kind == Scaling::speed_up ? ms.front() / ms[i]
                                                           : ms[i] / best[i]);
        }
        plot.series.push_back(series);
    }
    return plot;
}

/// Time, speed-up, and time over the best builder's: a row each, a column for each machine.
std::string scaling_plots(const Study& study, const StudyScene& scene, PageColours& colours) {
    std::string plots, legend;
    for (const Scaling kind : {Scaling::time, Scaling::speed_up, Scaling::ratio})
        for (const std::string& machine : scene.machines()) {
            LinePlot plot = scaling_plot(study, scene, machine, kind, colours);
            if (plot.series.empty()) continue;
            if (legend.empty()) legend = legend_html(legend_of(plot));
            plot.with_legend = false;
            plots += line_plot(plot);
        }
    return plots.empty() ? "" : legend + "<div class=\"plots\">" + plots + "</div>\n";
}

/// Scenes in their order; all but the largest are folded away.
std::string scene_parts(const Study& study, PageColours& colours) {
    const std::vector<StudyScene> scenes = study.scenes();
    const StudyScene* largest = largest_of(scenes);
    std::string parts;
    for (const StudyScene& scene : scenes)
        if (const std::string plots = scaling_plots(study, scene, colours); !plots.empty())
            parts += fmt::format(
                "<details{}><summary>{} on larger machines {}</summary>\n{}</details>\n",
                &scene == largest ? " open" : "", breakable(scene.title()),
                badge(Origin::simulated), plots);
    return parts;
}

std::string level_plot(const Study& study) {
    LinePlot plot;
    plot.title = "Inner nodes on each level";
    plot.x_label = "level, the root is 0";
    plot.y_label = "nodes (log scale)";
    plot.y_scale = LinePlot::Scale::log;
    plot.note = "What a builder that goes level by level has to do in one launch.";
    for (const StudyRun& run : study.runs) {
        if (run.size_series || run.levels.empty()) continue;
        const std::string name =
            run.scene + (run.bits ? fmt::format(", {:.0f} bits", *run.bits) : "");
        if (std::ranges::find(plot.series, name, &Series::name) != plot.series.end()) continue;
        const int number = static_cast<int>(plot.series.size());
        Series series{.name = name,
                      .x = {},
                      .y = run.levels,
                      .colour = number,
                      .dash = number / palette_size,
                      .shape = number};
        for (std::size_t i = 0; i < run.levels.size(); ++i)
            series.x.push_back(static_cast<double>(i));
        plot.series.push_back(series);
    }
    return plot.series.empty() ? "" : line_plot(plot);
}

/// Whole builds into kept memory, a bar for each builder and number of threads.
std::string build_plots(const Study& study, PageColours& colours) {
    static const std::vector<std::string> stages{"bounds",    "codes", "sort",
                                                 "hierarchy", "fit",   "layout"};
    std::map<std::pair<std::string, std::string>, BarPlot> panels;  // scene, bits
    for (const Json* build : objects_at(study.document->root, "builds")) {
        if (!at(*build, "ms").is_object()) continue;
        const std::string scene = scene_name(*build), bits = text_at(*build, "bits");
        BarPlot& plot = panels[{scene, bits}];
        plot.title = "Whole builds by stage";
        plot.subtitle = scene + ", " + bits + "-bit codes, into kept memory";
        plot.label = "time, ms";
        plot.unit = "ms";
        plot.origin = Origin::measured;
        plot.parts.clear();
        const SpreadFields total = spread_at(*build, "ms.total");
        const std::string threads = text_at(*build, "threads");
        Bar bar{.label = text_at(*build, "builder") + ", " + threads +
                         (threads == "1" ? " thread" : " threads"),
                .total = or_nan(total.median),
                .low = or_nan(total.min),
                .high = or_nan(total.max)};
        for (const std::string& stage : stages) {
            plot.parts.push_back({stage, colours.stages.of(stage)});
            bar.parts.push_back(or_nan(spread_at(*build, "ms." + stage).median));
        }
        plot.bars.push_back(bar);
    }
    std::string plots;
    for (const auto& [key, plot] : panels) plots += bar_plot(plot);
    return plots;
}

void say_measured(const Study& study, const StudyScene& scene, Section& section) {
    std::vector<const StudyRun*> timed;
    for (const StudyRun* run : scene.all)
        if (run->measured && run->is_builder()) timed.push_back(run);
    if (timed.size() < 2) return;
    const auto [fast, slow] =
        std::ranges::minmax(timed, {}, [](const StudyRun* run) { return *run->measured; });
    const auto with_threads = [](const StudyRun& run) {
        return run.name() + (run.threads ? fmt::format(", {:.0f} {}", *run.threads,
                                                       *run.threads == 1 ? "thread" : "threads")
                                         : "");
    };
    section.summary.push_back(fmt::format(
        "Measured on {}: hierarchy and boxes of {} take {} with {}, the fastest of {} ways, and {} "
        "with {}, the slowest.",
        escaped(machine_text(*study.document)), breakable(scene.title()),
        strong(significant(*fast->measured), "ms"), strong(with_threads(*fast)), timed.size(),
        strong(significant(*slow->measured), "ms"), escaped(with_threads(*slow))));
}

void say_simulated(const Study& study, const StudyScene& scene, Section& section) {
    if (study.factors.size() < 2) return;
    for (const std::string& machine : scene.machines()) {
        const StudyRun *best = nullptr, *least = nullptr;
        for (const StudyRun* run : scene.one_each) {
            if (!run->speed_up(machine) || !run->is_builder()) continue;
            if (!best || *run->speed_up(machine) > *best->speed_up(machine)) best = run;
            if (!least || *run->speed_up(machine) < *least->speed_up(machine)) least = run;
        }
        if (!best || best == least) continue;
        section.summary.push_back(fmt::format(
            "{} On a machine {} times the size of {}, {} gains most on {}, {} over {} times that "
            "machine; {} gains least, {}.",
            badge(Origin::simulated), short_number(study.factors.back()), escaped(machine),
            strong(best->name()), breakable(scene.title()),
            strong(significant(*best->speed_up(machine)), "times"),
            short_number(study.factors.front()), strong(least->name()),
            strong(significant(*least->speed_up(machine)), "times")));
    }
}

void say_model_error(const Study& study, Section& section) {
    std::vector<double> errors;
    for (const StudyRun& run : study.runs)
        if (!run.size_series && run.threads == 1.0 && run.error()) errors.push_back(*run.error());
    if (errors.empty()) return;
    constexpr double wanted = 0.25;
    const auto within =
        std::ranges::count_if(errors, [](double e) { return std::fabs(e) <= wanted; });
    const auto [low, high] = std::ranges::minmax(errors);
    for (double& e : errors) e = std::fabs(e);
    std::ranges::sort(errors);
    const double middle = errors.size() % 2
                              ? errors[errors.size() / 2]
                              : 0.5 * (errors[errors.size() / 2 - 1] + errors[errors.size() / 2]);
    section.summary.push_back(fmt::format(
        "How good the model is: with one thread of the machine it ran on it is off by {} "
        "to {} over {} runs of scenes, by {} in the middle; {} are within {}.",
        percent(low), percent(high), errors.size(), strong(percent(middle)), within,
        percent(wanted)));
}

}  // namespace

Section hierarchy_section(const Documents& documents, PageColours& colours) {
    Section section{.id = "construction", .title = "Construction study"};
    const auto of_study = [](const Document& d) { return d.command == "bench hierarchy"; };
    const bool several = std::ranges::count_if(documents, of_study) > 1;
    for (const Document& document : documents) {
        if (!of_study(document)) continue;
        const Study study(document);
        if (several) section.html += "<h3>" + breakable(document.name) + "</h3>\n";
        section.html += size_plots(study, colours) + scene_parts(study, colours);
        const std::vector<StudyScene> scenes = study.scenes();
        if (const StudyScene* scene = largest_of(scenes)) {
            say_measured(study, *scene, section);
            say_simulated(study, *scene, section);
        }
        const std::string plots = build_plots(study, colours) + level_plot(study);
        if (!plots.empty())
            section.html +=
                "<h3>Whole builds, and their levels</h3><div class=\"plots\">" + plots + "</div>\n";
        section.html += study_tables(study);
        say_model_error(study, section);
    }
    return section;
}

}  // namespace raydix::report
