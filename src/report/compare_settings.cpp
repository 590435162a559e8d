#include "report/compare_settings.h"

#include <algorithm>

namespace raydix::report {
namespace {

using JsonRows = std::vector<const Json*>;

/// The values of a field over all rows, each once: "0.003, 1".
std::string values_of(const JsonRows& rows, const char* field) {
    std::vector<std::string> seen;
    for (const Json* row : rows)
        if (const std::string text = setting_at(*row, field);
            !text.empty() && std::ranges::find(seen, text) == seen.end())
            seen.push_back(text);
    std::string all;
    for (const std::string& text : seen) all += (all.empty() ? "" : ", ") + text;
    return all;
}

struct SettingField {
    const char *path, *name;
};

// Of `build`, or of each of `builds`.
constexpr SettingField build_fields[] = {{"tree", "tree"},
                                         {"builder", "builder"},
                                         {"quality", "quality"},
                                         {"bits", "bits"},
                                         {"max_leaf", "max_leaf"},
                                         {"max_level", "max_level"},
                                         {"reinsertion_rounds", "reinsertion_rounds"},
                                         {"fit", "fit"},
                                         {"layout", "layout"},
                                         {"device", "device"},
                                         {"device_name", "device_name"},
                                         {"threads", "threads"},
                                         {"repeat", "repeat"},
                                         {"sah_constants.node", "sah_node"},
                                         {"sah_constants.primitive", "sah_primitive"},
                                         {"epo_sample", "epo_sample"},
                                         {"tree_hash", "tree_hash"}};

// Of rows of rays: each of `trace`, `simulate` and `measured`.
constexpr SettingField ray_fields[] = {{"camera", "camera"},
                                       {"cameras", "cameras"},
                                       {"size", "size"},
                                       {"samples", "samples"},
                                       {"ao_radius", "ao_radius"},
                                       {"launch_rays", "launch_rays"},
                                       {"path", "path"},
                                       {"isa", "instruction set of the engine"},
                                       {"repeat", "repeat"},
                                       {"simulated.machine", "machine"},
                                       {"sample", "sample asked for, of the rays"},
                                       {"part_taken", "part of the rays that was traced"},
                                       {"builder", "builder of simulated trees"}};

// Of the document.
constexpr SettingField document_fields[] = {{"version", "raydix"},
                                            {"machine.cpu", "cpu"},
                                            {"machine.cores", "cores"},
                                            {"machine.isa", "isa"},
                                            {"machine.gpu", "gpu"},
                                            {"seed", "seed"},
                                            {"scene.triangles", "triangles"},
                                            {"scene.flattened", "flattened"},
                                            {"max_leaf", "leaves"},
                                            {"repeat", "repeat"},
                                            {"memory", "memory"},
                                            {"cameras", "cameras"},
                                            {"error", "error"},
                                            {"sweep_sample", "sweep_sample"},
                                            {"ao_radius", "ao_radius"}};

std::string paths_of(const JsonRows& traces) {
    std::string all;
    for (const Json* trace : traces)
        if (const Json& paths = at(*trace, "paths"); paths.is_object())
            for (const auto& [path, batches] : paths.items())
                all += (all.empty() ? "" : ", ") + path;
    return all;
}

/// Each number of a machine: one of a file may have the name of another.
void add_machine(const Json& machine, Settings& settings) {
    const std::string name = text_at(machine, "name");
    for (const auto& [field, value] : machine.items())
        if (field != "name" && field != "origin")
            settings.emplace_back(name + ": " + field, setting_at(machine, field));
    for (const Json* cost : objects_at(machine, "costs")) {
        const std::string kernel = setting_at(*cost, "kernel");
        settings.emplace_back(name + ": cost of " + setting_at(*cost, "operation") +
                                  (kernel.empty() ? "" : " of " + kernel),
                              setting_at(*cost, "instructions"));
    }
}

}  // namespace

Settings settings_of(const Document& document) {
    Settings all;
    for (const auto& [path, name] : document_fields)
        all.emplace_back(name, setting_at(document.root, path));
    JsonRows builds = objects_at(document.root, "builds");
    if (const Json& build = at(document.root, "build"); build.is_object())
        builds.insert(builds.begin(), &build);
    for (const auto& [path, name] : build_fields) all.emplace_back(name, values_of(builds, path));
    const JsonRows traces = objects_at(document.root, "trace");
    JsonRows rays = traces;
    for (const char* list : {"simulate", "measured"}) {
        const JsonRows more = objects_at(document.root, list);
        rays.insert(rays.end(), more.begin(), more.end());
    }
    for (const auto& [path, name] : ray_fields) all.emplace_back(name, values_of(rays, path));
    all.emplace_back("paths that were taken", paths_of(traces));
    for (const Json* machine : objects_at(document.root, "machines")) add_machine(*machine, all);
    Settings settings;
    for (const auto& setting : all)
        if (!setting.second.empty() &&
            std::ranges::find(settings, setting.first, &Settings::value_type::first) ==
                settings.end())
            settings.push_back(setting);
    return settings;
}

std::vector<DifferentSetting> different_settings(const Document& first, const Document& second) {
    const Settings a = settings_of(first), b = settings_of(second);
    const auto value_in = [](const Settings& settings, const std::string& name) {
        const auto found = std::ranges::find(settings, name, &Settings::value_type::first);
        return found == settings.end() ? std::string() : found->second;
    };
    std::vector<DifferentSetting> different;
    for (const auto& [name, value] : a)
        if (const std::string other = value_in(b, name); other != value)
            different.push_back({name, value, other});
    for (const auto& [name, value] : b)
        if (value_in(a, name).empty()) different.push_back({name, "", value});
    return different;
}

}  // namespace raydix::report
