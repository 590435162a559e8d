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

void add(CompareRow& row, Measure measure) {
    if (measure.value.median) row.measures.push_back(std::move(measure));
}

CompareRow build_row(const Document& document) {
    const Json& b = at(document.root, "build");
    CompareRow row{scene_name(document.root) + ", " + text_at(b, "tree"), {}};
    for (const char* stage : {"total", "bounds", "codes", "sort", "hierarchy", "fit", "layout"}) {
        const std::string name = stage;
        const SpreadFields ms{number_at(b, "ms." + name), number_at(b, "ms_spread.min." + name),
                              number_at(b, "ms_spread.max." + name)};
        add(row, {"build, " + name, "ms", Better::lower, Origin::measured, ms});
    }
    add(row, {"into kept memory", "ms", Better::lower, Origin::measured, spread_at(b, "kept_ms")});
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
        add(row, {count.name, count.unit, count.better, Origin::none, spread_at(b, count.field)});
    return row;
}

void trace_rows(const Document& document, std::vector<CompareRow>& rows) {
    for (const Json* t : objects_at(document.root, "trace")) {
        CompareRow row{key_of(*t, {"rays", "mode", "kernel", "device"}, scene_name(document.root)),
                       {}};
        add(row,
            {"rate", "Mrays/s", Better::higher, Origin::measured, spread_at(*t, "mrays_per_s")});
        add(row, {"node visits", "per ray", Better::lower, Origin::none,
                  spread_at(*t, "node_visits_per_ray")});
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
        CompareRow row{key_of(*s, {"kernel", "rays", "mode", "machine", "width"}, scene), {}};
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
        CompareRow row{key_of(*m, {"kernel", "rays", "device"}, scene_name(*m)) + ", measured", {}};
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

namespace {

/// The values of a field over all rows, each once: "0.003, 1".
std::string values_of(const std::vector<const Json*>& rows, const char* field) {
    std::vector<std::string> seen;
    for (const Json* row : rows)
        if (const std::string text = text_at(*row, field);
            !text.empty() && std::ranges::find(seen, text) == seen.end())
            seen.push_back(text);
    std::string all;
    for (const std::string& text : seen) all += (all.empty() ? "" : ", ") + text;
    return all;
}

}  // namespace

std::vector<std::pair<std::string, std::string>> settings_of(const Document& document) {
    std::vector<std::pair<std::string, std::string>> settings{
        {"raydix", text_at(document.root, "version")}};
    for (const char* field : {"cpu", "cores", "isa", "gpu"})
        settings.emplace_back(field, text_at(document.root, std::string("machine.") + field));
    for (const char* field : {"tree", "builder", "bits", "max_leaf", "reinsertion_rounds", "layout",
                              "device", "threads", "tree_hash"})
        settings.emplace_back(field, text_at(document.root, std::string("build.") + field));
    settings.emplace_back("leaves", text_at(document.root, "max_leaf"));
    const std::vector<const Json*> simulated = objects_at(document.root, "simulate");
    settings.emplace_back("sample asked for, of the rays", values_of(simulated, "sample"));
    settings.emplace_back("part of the rays that was traced", values_of(simulated, "part_taken"));
    settings.emplace_back("builder of simulated trees", values_of(simulated, "builder"));
    return settings;
}

}  // namespace raydix::report
