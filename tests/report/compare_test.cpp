// Two documents of one command: which settings differ, and which figures are judged.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <raydix/report.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace raydix {
namespace {

using Json = nlohmann::ordered_json;

/// Without the places where long words may break.
std::string page_of(const std::vector<Json>& documents) {
    ReportInput input;
    for (std::size_t i = 0; i < documents.size(); ++i)
        input.documents.push_back({fmt::format("d{}.json", i), documents[i].dump()});
    std::string html = make_report(input);
    for (std::size_t at = 0; (at = html.find("<wbr>", at)) != std::string::npos;) html.erase(at, 5);
    return html;
}

bool holds(const std::string& html, const std::string& part) {
    return html.find(part) != std::string::npos;
}

/// The cells of the setting in the table of those that differ; "" if it is not there.
std::string setting_in(const std::string& html, const std::string& name) {
    const std::size_t table = html.find("Settings that differ");
    if (table == std::string::npos) return {};
    const std::size_t begin = html.find(fmt::format(">{}</th>", name), table),
                      end = html.find("</table>", table);
    if (begin > end) return {};
    return html.substr(begin, html.find("</tr>", begin) - begin);
}

Json build_document() {
    return Json::parse(R"({"command": "build", "version": "0", "seed": 1,
        "machine": {"cpu": "made up", "cores": 2}, "scene": {"name": "hall.obj", "triangles": 100},
        "build": {"tree": "bvh", "builder": "karras", "bits": 63, "max_leaf": 4, "device": "cpu",
                  "fit": null, "threads": 2, "primitives": 100, "nodes": 7, "sah": 12.5, "epo": 3.5,
                  "sah_constants": {"node": 1.0, "primitive": 1.0}, "epo_sample": 1.0,
                  "layout": "binary", "bytes": 1000, "tree_hash": "00ff",
                  "ms": {"sort": 1.0, "total": 4.0}}})");
}

Json trace_document() {
    Json document = build_document();
    document["command"] = "trace";
    document["build"]["layout"] = "wide8";
    document["trace"] = Json::parse(R"([{"rays": "ao", "mode": "any", "kernel": "engine",
        "device": "cpu", "count": 10, "hits": 5, "mrays_per_s": 2.0, "node_visits_per_ray": 7.5,
        "triangle_tests_per_ray": 2.5, "camera": "all", "cameras": null, "size": "64x48",
        "samples": 4, "ao_radius": 0.5, "isa": "avx2", "path": "automatic",
        "paths": {"packet": 1}, "repeat": 5}])");
    return document;
}

TEST(Comparison, CostsOfTheSahAreAnotherUnit) {
    Json other = build_document();
    other["build"]["sah_constants"]["node"] = 5.0;
    other["build"]["sah"] = 40.5;
    const std::string html = page_of({build_document(), other});
    EXPECT_FALSE(holds(html, "settings are the same"));
    EXPECT_TRUE(holds(setting_in(html, "sah_node"), ">5<"));
    EXPECT_TRUE(holds(html, "not judged, other work: sah_node"));
    EXPECT_FALSE(holds(html, "\xE2\x96\xBC worse"));
    EXPECT_TRUE(holds(html, "2 of other work"));  // EPO has the costs in it, too
}

TEST(Comparison, CostsThatDifferInTheLastDigitAreTold) {
    Json a = build_document(), b = build_document();
    a["build"]["sah_constants"]["node"] = 1.0000001;
    b["build"]["sah_constants"]["node"] = 1.0000002;
    EXPECT_FALSE(setting_in(page_of({a, b}), "sah_node").empty());
}

TEST(Comparison, TimesWithoutTheirLayoutAreOtherWork) {
    Json before = build_document(), now = build_document();
    before["build"]["layout"] = now["build"]["layout"] = "wide8";
    now["build"]["binary"] = {{"ms", {{"total", 4.0}}}};
    now["build"]["ms"]["total"] = 9.0;
    EXPECT_TRUE(holds(page_of({before, now}), "other work: whether the layout is in the times"));
    before["build"]["binary"] = now["build"]["binary"];
    EXPECT_TRUE(holds(page_of({before, now}), "\xE2\x96\xBC worse"));
}

TEST(Comparison, HowATreeIsBuiltIsJudged) {
    for (const auto& [field, value] :
         std::vector<std::pair<std::string, Json>>{{"fit", "levels"}, {"threads", 1}}) {
        Json other = build_document();
        other["build"][field] = value;
        other["build"]["ms"]["total"] = 2.0;
        const std::string html = page_of({build_document(), other});
        EXPECT_FALSE(setting_in(html, field).empty()) << field;
        EXPECT_TRUE(holds(html, "\xE2\x96\xB2 better")) << field;
    }
}

TEST(Comparison, OtherRaysAreOtherWork) {
    const std::vector<std::pair<std::string, Json>> changes{{"camera", "0"},
                                                            {"size", "32x24"},
                                                            {"samples", 8},
                                                            {"ao_radius", 0.25},
                                                            {"cameras", "c.json"}};
    for (const auto& [field, value] : changes) {
        Json other = trace_document();
        other["trace"][0][field] = value;
        other["trace"][0]["mrays_per_s"] = 4.0;
        const std::string html = page_of({trace_document(), other});
        EXPECT_FALSE(holds(html, "settings are the same")) << field;
        EXPECT_FALSE(setting_in(html, field).empty()) << field;
        EXPECT_TRUE(holds(html, "not judged, other work: " + field)) << field;
        EXPECT_FALSE(holds(html, "\xE2\x96\xB2 better")) << field;
    }
    Json seeded = trace_document();
    seeded["seed"] = 2;
    EXPECT_TRUE(holds(page_of({trace_document(), seeded}), "not judged, other work: seed"));
    Json more = trace_document();
    more["trace"][0]["count"] = 20;
    EXPECT_TRUE(holds(page_of({trace_document(), more}), "other work: number of rays"));
    Json scene = trace_document();
    scene["scene"]["triangles"] = 99;
    EXPECT_TRUE(holds(page_of({trace_document(), scene}), "other work: triangles"));
}

TEST(Comparison, HowRaysGoIsJudged) {
    const std::vector<std::pair<std::string, std::string>> changes{{"isa", "sse4"},
                                                                   {"path", "single"}};
    for (const auto& [field, value] : changes) {
        Json other = trace_document();
        other["trace"][0][field] = value;
        other["trace"][0]["mrays_per_s"] = 1.0;
        const std::string html = page_of({trace_document(), other});
        const std::string name = field == "isa" ? "instruction set of the engine" : field;
        EXPECT_TRUE(holds(setting_in(html, name), value)) << field;
        EXPECT_TRUE(holds(html, "\xE2\x96\xBC worse")) << field;
        EXPECT_FALSE(holds(html, "not judged")) << field;
    }
    Json older = trace_document();  // of before there was `path`
    older["trace"][0].erase("path");
    older["trace"][0]["paths"] = {{"single", 1}};
    EXPECT_TRUE(
        holds(setting_in(page_of({trace_document(), older}), "paths that were taken"), "single"));
}

TEST(Comparison, VisitsOfOtherNodesAreOtherWork) {
    Json other = trace_document();
    other["build"]["layout"] = "wide4";
    other["trace"][0]["node_visits_per_ray"] = 9.5;
    other["trace"][0]["mrays_per_s"] = 1.0;
    const std::string html = page_of({trace_document(), other});
    EXPECT_TRUE(holds(html, "not judged, other work: layout"));
    EXPECT_TRUE(holds(html, "\xE2\x96\xBC worse"));  // the rate
}

TEST(Comparison, WhatADocumentDoesNotSayIsNoOtherWork) {
    Json older = trace_document();
    for (const char* field : {"camera", "cameras", "size", "samples", "path", "repeat"})
        older["trace"][0].erase(field);
    older.erase("seed");
    older["trace"][0]["mrays_per_s"] = 1.0;
    const std::string html = page_of({older, trace_document()});
    EXPECT_FALSE(holds(html, "not judged"));
    EXPECT_TRUE(holds(html, "\xE2\x96\xB2 better"));
    EXPECT_FALSE(setting_in(html, "size").empty());
    EXPECT_TRUE(holds(page_of({older, older}), "settings are the same"));
}

TEST(Comparison, SimulatedMachinesOfOneNameAreToldApart) {
    Json first = Json::parse(R"({"command": "simulate", "version": "0", "seed": 1,
        "scene": {"name": "hall.obj"}, "machines": [{"name": "mine", "l2_bytes": 1000,
            "costs": [{"operation": "visit_node", "instructions": 8}]}],
        "simulate": [{"kernel": "packet", "rays": "primary", "machine": "mine", "camera": "all",
            "size": "64x48", "samples": null, "mrays_per_s_bound": 100.0, "part_taken": 1.0,
            "sampling_error": 0.0}]})");
    Json second = first;
    second["machines"][0]["costs"][0]["instructions"] = 9;
    EXPECT_FALSE(setting_in(page_of({first, second}), "mine: cost of visit_node").empty());
    second = first;
    second["simulate"][0]["size"] = "32x24";
    second["simulate"][0]["mrays_per_s_bound"] = 120.0;
    const std::string html = page_of({first, second});
    EXPECT_TRUE(holds(html, "not judged, other work: size"));
    EXPECT_FALSE(holds(html, "\xE2\x96\xB2 better"));
}

TEST(TheTrees, EachLayoutHasARow) {
    Json wide = trace_document(), narrow = trace_document();
    wide["build"]["bytes"] = 2500000;
    narrow["build"]["layout"] = "wide4";
    narrow["build"]["bytes"] = 3750000;
    Json binary = build_document();
    binary["build"]["bytes"] = 1250000;
    const std::string html = page_of({binary, wide, narrow, wide});
    const std::size_t begin = html.find("The trees"), end = html.find("</table>", begin);
    const std::string table = html.substr(begin, end - begin);
    std::size_t rows = 0;
    for (std::size_t at = 0; (at = table.find("<tr><th", at)) != std::string::npos; ++at) ++rows;
    EXPECT_EQ(rows, 1u + 3u);  // the head, and `wide` once
    for (const char* part :
         {">binary<", ">wide8<", ">wide4<", "data-v=\"1.25\"", "data-v=\"2.5\"", "data-v=\"3.75\""})
        EXPECT_TRUE(holds(table, part)) << part;
    EXPECT_FALSE(holds(html, "give the same tree"));  // one tree in three layouts
}

TEST(TheTrees, WideLayoutsHaveTheirFigures) {
    Json document = trace_document();
    EXPECT_FALSE(holds(page_of({document}), "Wide layouts"));
    document["build"]["wide"] = Json::parse(R"({"layout": "wide8", "nodes": 41234, "leaves": 5,
        "references": 6, "max_depth": 7, "children_per_node": 6.625, "sah": 8.75, "widening": 1.25,
        "node_bytes": 4750000, "triangle_bytes": 10, "ms": 1, "layout_ms": 1.5,
        "build_ms": {"median": 33.5, "min": 33, "max": 34}, "kept_ms": {"median": 21.5}})");
    document["build"]["binary"] = {{"ms", {{"total", 17.5}}}};
    const std::string html = page_of({document});
    EXPECT_TRUE(holds(html, "Wide layouts"));
    for (const char* value : {"41234", "6.625", "8.75", "1.25", "4.75", "33.5", "21.5", "17.5"})
        EXPECT_TRUE(holds(html, fmt::format("data-v=\"{}\"", value))) << value;
}

}  // namespace
}  // namespace raydix
