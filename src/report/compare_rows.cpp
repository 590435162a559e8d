#include "report/compare_rows.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "report/hierarchy_tables.h"
#include "report/sections.h"

namespace raydix::report {
namespace {

using Better = Measure::Better;

/// Joins what is there: "figure, primary, closest".
std::string key_of(const Json& row, const std::vector<const char*>& fields, std::string key) {
    for (const char* field : fields)
        if (const std::string text = text_at(row, field); !text.empty())
            key += (key.empty() ? "" : ", ") + text;
    return key;
}

/// Of the documents of each command: what the scene is, as far as they say.
Settings scene_work(const Document& document, const std::string& scene) {
    Settings work{{"triangles", setting_at(document.root, "scene.triangles")}};
    if (scene.starts_with("builtin:")) work.emplace_back("seed", setting_at(document.root, "seed"));
    return work;
}

/// Which rays a row of `trace` or `simulate` is about.
Settings ray_work(const Document& document, const Json& row, const std::string& scene) {
    Settings work = scene_work(document, scene);
    for (const char* field : {"camera", "size", "samples", "ao_radius"})
        work.emplace_back(field, setting_at(row, field));
    // Null means those of the scene; where there is no such field nothing is known.
    for (const Json* holder : {&row, &document.root})
        if (holder->contains("cameras")) {
            const std::string file = setting_at(*holder, "cameras");
            work.emplace_back("cameras", file.empty() ? "those of the scene" : file);
            break;
        }
    const bool by_chance = !setting_at(row, "samples").empty();
    if (by_chance && !scene.starts_with("builtin:"))
        work.emplace_back("seed", setting_at(document.root, "seed"));
    return work;
}

void add(CompareRow& row, Measure measure) {
    if (measure.value.median) row.measures.push_back(std::move(measure));
}

/// Documents of before `build.binary` have the times of the binary tree alone, whatever the layout.
Settings work_of_times(const Json& build) {
    const std::string layout = text_at(build, "layout");
    if (layout.empty() || layout == "binary" || at(build, "builder").is_null()) return {};
    const bool is_in = at(build, "binary").is_object();
    return {{"whether the layout is in the times", is_in ? "yes" : "no"}};
}

/// SAH and EPO are sums over costs and triangles that the run was told.
Settings work_of_figure(const Json& build, const std::string& field) {
    if (field == "peak_bytes") return work_of_times(build);
    if (field == "sah")
        return {{"sah_node", setting_at(build, "sah_constants.node")},
                {"sah_primitive", setting_at(build, "sah_constants.primitive")}};
    if (field == "epo")
        return {{"epo_sample", setting_at(build, "epo_sample")},
                {"sah_node", setting_at(build, "sah_constants.node")},
                {"sah_primitive", setting_at(build, "sah_constants.primitive")}};
    return {};
}

CompareRow build_row(const Document& document) {
    const Json& b = at(document.root, "build");
    CompareRow row{scene_name(document.root) + ", " + text_at(b, "tree"),
                   {},
                   scene_work(document, scene_name(document.root))};
    for (const char* stage : {"total", "bounds", "codes", "sort", "hierarchy", "fit", "layout"}) {
        const std::string name = stage;
        const SpreadFields ms{number_at(b, "ms." + name), number_at(b, "ms_spread.min." + name),
                              number_at(b, "ms_spread.max." + name)};
        const bool has_layout = name == "total" || name == "layout";
        add(row, {"build, " + name, "ms", Better::lower, Origin::measured, ms, true,
                  has_layout ? work_of_times(b) : Settings{}});
    }
    add(row, {"into kept memory", "ms", Better::lower, Origin::measured, spread_at(b, "kept_ms"),
              true, work_of_times(b)});
    struct Count {
        const char *field, *name, *unit;
        Better better;
    };
    for (const Count& count :
         {Count{"sah", "SAH", "", Better::lower}, Count{"epo", "EPO", "", Better::lower},
          Count{"bytes", "size", "bytes", Better::lower},
          Count{"peak_bytes", "peak of the build", "bytes", Better::lower},
          Count{"nodes", "nodes", "", Better::neither},
          Count{"max_depth", "depth", "", Better::neither}})
        add(row, {count.name, count.unit, count.better, Origin::none, spread_at(b, count.field),
                  true, work_of_figure(b, count.field)});
    return row;
}

void trace_rows(const Document& document, std::vector<CompareRow>& rows) {
    for (const Json* t : objects_at(document.root, "trace")) {
        CompareRow row{key_of(*t, {"rays", "mode", "kernel", "device"}, scene_name(document.root)),
                       {},
                       ray_work(document, *t, scene_name(document.root))};
        row.work.emplace_back("number of rays", setting_at(*t, "count"));
        const std::string layout = text_at(document.root, "build.layout");
        add(row,
            {"rate", "Mrays/s", Better::higher, Origin::measured, spread_at(*t, "mrays_per_s")});
        // Nodes of another width are other work.
        add(row, {"node visits",
                  "per ray",
                  Better::lower,
                  Origin::none,
                  spread_at(*t, "node_visits_per_ray"),
                  true,
                  {{"layout", layout}}});
        add(row, {"triangle tests", "per ray", Better::lower, Origin::none,
                  spread_at(*t, "triangle_tests_per_ray")});
        add(row, {"hits", "", Better::neither, Origin::none, spread_at(*t, "hits")});
        rows.push_back(std::move(row));
    }
}

/// Two standard errors of the sample to either side; none for a run over all rays, not known for a
/// single part.
Measure simulated_measure(const Json& row, Measure measure, const char* field) {
    measure.origin = Origin::simulated;
    measure.value = spread_at(row, field);
    const std::optional<double> error = number_at(row, "sampling_error");
    measure.error_known = error.has_value() || number_at(row, "part_taken").value_or(1) >= 1;
    if (error && measure.value.median) {
        const double around = 2 * *error * std::fabs(*measure.value.median);
        measure.value.min = *measure.value.median - around;
        measure.value.max = *measure.value.median + around;
    }
    return measure;
}

void simulate_rows(const Document& document, std::vector<CompareRow>& rows) {
    for (const Json* s : objects_at(document.root, "simulate")) {
        const std::string scene = scene_name(at(*s, "scene").is_null() ? document.root : *s);
        CompareRow row{key_of(*s, {"kernel", "rays", "mode", "machine", "width"}, scene),
                       {},
                       ray_work(document, *s, scene)};
        const auto put = [&](const char* name, const char* unit, Better better, const char* field) {
            add(row, simulated_measure(*s, {name, unit, better, {}, {}}, field));
        };
        put("bound", "Mrays/s", Better::higher, "mrays_per_s_bound");
        put("scheduled", "Mrays/s", Better::higher, "mrays_per_s_scheduled");
        put("memory", "Mrays/s", Better::higher, "mrays_per_s_memory");
        put("SIMD efficiency", "", Better::higher, "simd_efficiency");
        put("instructions", "per ray", Better::lower, "instructions_per_ray");
        // The number of hits has no meaning of its own where rays are left out.
        if (number_at(*s, "part_taken").value_or(1) >= 1) put("hits", "", Better::neither, "hits");
        rows.push_back(std::move(row));
    }
    for (const Json* m : objects_at(document.root, "measured")) {
        CompareRow row{key_of(*m, {"kernel", "rays", "device"}, scene_name(*m)) + ", measured",
                       {},
                       ray_work(document, *m, scene_name(*m))};
        add(row,
            {"rate", "Mrays/s", Better::higher, Origin::measured, spread_at(*m, "mrays_per_s")});
        rows.push_back(std::move(row));
    }
}

void hierarchy_rows(const Document& document, std::vector<CompareRow>& rows) {
    const std::vector<double> factors = numbers_at(document.root, "factors");
    for (const Json* r : objects_at(document.root, "runs")) {
        const char* threads = text_at(*r, "threads") == "1" ? " thread" : " threads";
        CompareRow row{scene_name(*r) + ", " + key_of(*r, {"keys"}, "") + " keys, " +
                           key_of(*r, {"builder", "form"}, "") + ", boxes " + text_at(*r, "fit") +
                           ", " + text_at(*r, "bits") + " bits, " + text_at(*r, "threads") +
                           threads,
                       {}};
        add(row, {"hierarchy and boxes", "ms", Better::lower, Origin::measured,
                  spread_at(*r, "measured_ms")});
        if (const Json& machines = at(*r, "simulated_ms"); machines.is_object())
            for (const auto& [machine, ms] : machines.items())
                if (const auto list = numbers_at(ms, ""); !list.empty())
                    add(row, {times_machine(machine, factors),
                              "ms",
                              Better::lower,
                              Origin::simulated,
                              {list.front(), list.front(), list.front()}});
        rows.push_back(std::move(row));
    }
    for (const Json* b : objects_at(document.root, "builds")) {
        CompareRow row{key_of(*b, {"builder"}, scene_name(*b)) + ", " + text_at(*b, "bits") +
                           " bits, " + text_at(*b, "threads") + " threads, whole build",
                       {}};
        add(row, {"total", "ms", Better::lower, Origin::measured, spread_at(*b, "ms.total")});
        rows.push_back(std::move(row));
    }
}

}  // namespace

std::vector<CompareRow> compare_rows(const Document& document) {
    std::vector<CompareRow> rows;
    if (document.command == "build" && at(document.root, "build").is_object())
        rows.push_back(build_row(document));
    if (document.command == "trace") trace_rows(document, rows);
    if (document.command == "simulate" || document.command == "bench traversal")
        simulate_rows(document, rows);
    if (document.command == "bench hierarchy") hierarchy_rows(document, rows);
    return rows;
}

std::string what_differs(const Settings& a, const Settings& b) {
    std::string names;
    for (const auto& [name, value] : a)
        for (const auto& [other, other_value] : b)
            if (name == other && !value.empty() && !other_value.empty() && value != other_value)
                names += (names.empty() ? "" : ", ") + name;
    return names;
}

}  // namespace raydix::report
