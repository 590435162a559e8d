// The list of built-in scenes, and the reading of their specifications.
#include "scene/builtin.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <string>

#include <raydix/error.h>

namespace raydix {

namespace {

using builtin::Arguments;

constexpr double most_triangles = 20e6, most_points = 50e6;

constexpr BuiltinParameter atrium_parameters[] = {
    {"triangles", 1e6, 10e3, most_triangles, "wanted number of triangles, met within 5 %"}};
constexpr BuiltinParameter grove_parameters[] = {
    {"triangles", 1e6, 10e3, most_triangles, "wanted number of triangles, met within 5 %"}};
constexpr BuiltinParameter figure_parameters[] = {
    {"triangles", 1e6, 5e3, most_triangles, "wanted number of triangles, met within 5 %"}};
constexpr BuiltinParameter soup_parameters[] = {
    {"triangles", 100e3, 0, most_triangles, "number of triangles"}};
constexpr BuiltinParameter uniform_parameters[] = {
    {"points", 1e6, 0, most_points, "number of points"}};
constexpr BuiltinParameter clustered_parameters[] = {
    {"points", 1e6, 0, most_points, "number of points"},
    {"clusters", 100, 1, 1e6, "number of clusters"}};
constexpr BuiltinParameter lidar_parameters[] = {
    {"points", 1e6, 0, most_points, "number of echoes"},
    {"beams", 64, 1, 128, "lasers, one above the other"},
    {"triangles", 200e3, 10e3, most_triangles, "of the atrium that is scanned"},
    {"noise_mm", 10, 0, 1000, "deviation of the measured range in millimetres"},
    {"dropout_percent", 2, 0, 90, "share of the echoes that are lost"}};

/// Their order is that of makers below.
constexpr BuiltinScene scenes[] = {
    {"atrium",
     "hall with columns, arches, stairs, galleries and furniture; huge and tiny triangles",
     atrium_parameters},
    {"grove", "terrain with trees, leaves, grass and rocks; much overlap", grove_parameters},
    {"figure", "closed, dense, scan-like surface of a sitting cat; even triangles",
     figure_parameters},
    {"soup", "random triangles of mixed sizes", soup_parameters},
    {"uniform", "points spread evenly over the unit cube", uniform_parameters},
    {"clustered", "points in dense clusters of mixed sizes", clustered_parameters},
    {"lidar", "points that a spinning scanner sees inside the atrium", lidar_parameters},
};

using Maker = BuiltinResult (*)(const Arguments&, std::uint64_t seed, const SceneTracer&);
constexpr Maker makers[] = {
    [](const Arguments& a, std::uint64_t seed, const SceneTracer&) {
        return builtin::make_atrium(a["triangles"], seed);
    },
    [](const Arguments& a, std::uint64_t seed, const SceneTracer&) {
        return builtin::make_grove(a["triangles"], seed);
    },
    [](const Arguments& a, std::uint64_t seed, const SceneTracer&) {
        return builtin::make_figure(a["triangles"], seed);
    },
    [](const Arguments& a, std::uint64_t seed, const SceneTracer&) {
        return builtin::make_soup(a["triangles"], seed);
    },
    [](const Arguments& a, std::uint64_t seed, const SceneTracer&) {
        return builtin::make_uniform(a["points"], seed);
    },
    [](const Arguments& a, std::uint64_t seed, const SceneTracer&) {
        return builtin::make_clustered(a["points"], a["clusters"], seed);
    },
    [](const Arguments& a, std::uint64_t seed, const SceneTracer& tracer) {
        const builtin::LidarOptions options{
            .points = a["points"],
            .beams = a["beams"],
            .triangles = a["triangles"],
            .noise = 1e-3 * static_cast<double>(a["noise_mm"]),
            .dropout = 1e-2 * static_cast<double>(a["dropout_percent"])};
        return builtin::make_lidar(options, seed, tracer);
    },
};
static_assert(std::size(scenes) == std::size(makers));

template <class Named>
std::string names(std::span<const Named> all) {
    std::string list;
    for (const Named& one : all) list += (list.empty() ? "" : ", ") + std::string(one.name);
    return list;
}

/// Position of `name` in `all`, or all.size().
template <class Named>
std::size_t find_name(std::span<const Named> all, std::string_view name) {
    std::size_t i = 0;
    while (i < all.size() && all[i].name != name) ++i;
    return i;
}

/// Text up to the next `end`, which is dropped; `rest` keeps what follows.
std::string_view take_until(std::string_view& rest, char end) {
    const std::size_t at = rest.find(end);
    const std::string_view text = rest.substr(0, at);
    rest = at == std::string_view::npos ? std::string_view{} : rest.substr(at + 1);
    return text;
}

std::uint64_t read_value(std::string_view scene, const BuiltinParameter& parameter,
                         std::string_view text) {
    double value = 0.0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const bool whole = error == std::errc{} && end == text.data() + text.size() &&
                       value >= parameter.min_value && value <= parameter.max_value &&
                       std::floor(value) == value;
    if (!whole)
        throw InputError(
            fmt::format("builtin:{}: {}={}: must be a whole number from {:.0f} to {:.0f}", scene,
                        parameter.name, text, parameter.min_value, parameter.max_value));
    return static_cast<std::uint64_t>(value);
}

Arguments read_arguments(const BuiltinScene& scene, std::string_view text) {
    std::vector<std::uint64_t> values;
    for (const BuiltinParameter& parameter : scene.parameters)
        values.push_back(static_cast<std::uint64_t>(parameter.default_value));
    std::vector<bool> given(values.size());
    while (!text.empty()) {
        std::string_view value = take_until(text, '&');
        const std::string_view key = take_until(value, '=');
        const std::size_t i = find_name(scene.parameters, key);
        if (i == scene.parameters.size())
            throw InputError(fmt::format("builtin:{}: unknown parameter '{}'; there are: {}",
                                         scene.name, key, names(scene.parameters)));
        if (given[i])
            throw InputError(fmt::format("builtin:{}: '{}' is given twice", scene.name, key));
        given[i] = true;
        values[i] = read_value(scene.name, scene.parameters[i], value);
    }
    return {scene.parameters, std::move(values)};
}

}  // namespace

std::span<const BuiltinScene> builtin_scenes() { return scenes; }

BuiltinResult make_builtin(std::string_view spec, std::uint64_t seed, const SceneTracer& tracer) {
    std::string_view rest = spec;
    const std::string_view name = take_until(rest, '?');
    const std::size_t i = find_name(builtin_scenes(), name);
    if (i == std::size(scenes))
        throw InputError(fmt::format("builtin:{}: unknown scene '{}'; there are: {}", spec, name,
                                     names(builtin_scenes())));
    BuiltinResult result = makers[i](read_arguments(scenes[i], rest), seed, tracer);
    result.mesh.name = "builtin:" + std::string(spec);
    return result;
}

namespace builtin {

std::uint64_t Arguments::operator[](std::string_view name) const {
    return values_.at(find_name(parameters_, name));
}

Camera camera(std::string_view name, Vec3 position, Vec3 target, float vfov) {
    return {std::string(name), position, target, {0, 1, 0}, vfov};
}

}  // namespace builtin
}  // namespace raydix
