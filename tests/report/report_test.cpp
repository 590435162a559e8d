// Whole pages from documents: sound, odd, broken and hostile ones.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/report.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>
#include <string>

#include "support/support.h"

namespace raydix {
namespace {

using Json = nlohmann::ordered_json;

Json build_document(double total) {
    Json document = Json::parse(R"({"command": "build", "version": "0",
        "machine": {"cpu": "made up", "cores": 2}, "scene": {"name": "hall.obj", "triangles": 100},
        "build": {"tree": "bvh", "builder": "karras", "bits": 63, "max_leaf": 4, "device": "cpu",
                  "threads": 2, "primitives": 100, "nodes": 7, "sah": 12.5, "bytes": 1000,
                  "tree_hash": "00ff", "ms": {"sort": 1.0, "fit": 2.0}}})");
    document["build"]["ms"]["total"] = total;
    return document;
}

std::string page_of(const std::vector<Json>& documents) {
    ReportInput input;
    for (std::size_t i = 0; i < documents.size(); ++i)
        input.documents.push_back({fmt::format("d{}.json", i), documents[i].dump()});
    return make_report(input);
}

bool holds(const std::string& html, const std::string& part) {
    return html.find(part) != std::string::npos;
}

std::string shared_document(const std::string& name) {
    std::ifstream in(test::source_file("tests/report/documents/" + name));
    std::ostringstream text;
    text << in.rdbuf();
    return text.str();
}

void expect_whole(const std::string& html) {
    EXPECT_TRUE(html.starts_with("<!DOCTYPE html>"));
    EXPECT_TRUE(html.ends_with("</body></html>\n"));
    for (const char* tag : {"section", "table", "details", "figure", "svg", "div", "ul"}) {
        const auto count = [&](const std::string& part) {
            std::size_t n = 0;
            for (std::size_t at = 0; (at = html.find(part, at)) != std::string::npos; ++at) ++n;
            return n;
        };
        EXPECT_EQ(count(fmt::format("<{}>", tag)) + count(fmt::format("<{} ", tag)),
                  count(fmt::format("</{}>", tag)))
            << tag;
    }
}

TEST(MakeReport, ABuildHasItsTimesAndItsTree) {
    const std::string html = page_of({build_document(4)});
    expect_whole(html);
    EXPECT_TRUE(holds(html, "<section id=\"builds\">"));
    EXPECT_FALSE(holds(html, "<section id=\"comparison\">"));
    EXPECT_FALSE(holds(html, "<section id=\"simulated\">"));
    EXPECT_TRUE(holds(html, "hall.obj"));
    EXPECT_TRUE(holds(html, "4.00&nbsp;ms"));
    EXPECT_TRUE(holds(html, "Measured on made up, 2 cores"));
}

TEST(MakeReport, TheSameDocumentsGiveTheSamePage) {
    EXPECT_EQ(page_of({build_document(4), build_document(5)}),
              page_of({build_document(4), build_document(5)}));
}

TEST(MakeReport, TwoOfACommandAreCompared) {
    const std::string faster = page_of({build_document(4), build_document(2)});
    EXPECT_TRUE(holds(faster, "<section id=\"comparison\">"));
    EXPECT_TRUE(holds(faster, "\xE2\x96\xB2 better"));
    EXPECT_FALSE(holds(faster, "\xE2\x96\xBC worse"));
    EXPECT_TRUE(holds(faster, "0.50 \xC3\x97"));
    const std::string slower = page_of({build_document(2), build_document(4)});
    EXPECT_TRUE(holds(slower, "\xE2\x96\xBC worse"));
    EXPECT_TRUE(holds(slower, "2.00 \xC3\x97"));
    const std::string close = page_of({build_document(4), build_document(4.01)});
    EXPECT_FALSE(holds(close, "\xE2\x96\xBC worse"));
    EXPECT_TRUE(holds(close, "within 2 %"));
}

TEST(MakeReport, AStageThatOneDoesNotHaveIsNoGain) {
    Json without = build_document(4);
    without["build"]["ms"]["sort"] = 0.0;
    for (const bool first : {false, true}) {
        const std::string html =
            first ? page_of({without, build_document(4)}) : page_of({build_document(4), without});
        EXPECT_TRUE(holds(html, "differs"));
        EXPECT_FALSE(holds(html, "0.00 \xC3\x97"));
        EXPECT_FALSE(holds(html, "\xE2\x96\xB2 better"));
        EXPECT_FALSE(holds(html, "\xE2\x96\xBC worse"));
    }
}

TEST(MakeReport, OverlappingSpreadsAreNoChange) {
    Json a = build_document(4), b = build_document(5);
    a["build"]["ms_spread"] = {{"min", {{"total", 3.0}}}, {"max", {{"total", 5.5}}}};
    b["build"]["ms_spread"] = {{"min", {{"total", 4.5}}}, {"max", {{"total", 6.0}}}};
    const std::string html = page_of({a, b});
    EXPECT_TRUE(holds(html, "within the spread"));
    EXPECT_FALSE(holds(html, "\xE2\x96\xBC worse"));
}

TEST(MakeReport, OnlyRowsThatMatchAreCompared) {
    Json other = build_document(2);
    other["scene"]["name"] = "church.obj";
    const std::string html = page_of({build_document(4), other});
    EXPECT_TRUE(holds(html, "have no row in common"));
    EXPECT_FALSE(holds(html, "\xE2\x96\xB2 better"));
    // Three of one scene are a series, not a pair.
    EXPECT_FALSE(holds(page_of({build_document(4), build_document(3), build_document(2)}),
                       "<section id=\"comparison\">"));
}

Json ranks_document() {
    Json document = Json::parse(R"({"command": "mpi bench weak", "cloud": "uniform", "points": 1000,
        "queries": 100, "k": 8, "seed": 1, "alone_compute_s_most": 1.25, "model": {"latency_s": 2e-6, "bytes_per_s": 1e10},
        "predicted": {"ranks": 4, "knn_compute_s_most": 1.3, "rounds": 5}})");
    for (const int ranks : {1, 2, 4})
        document["counted"].push_back({{"ranks", ranks},
                                       {"knn_compute_s_most", 1 + 0.1 * ranks},
                                       {"ranks_touched", 1.25},
                                       {"rounds", ranks}});
    // The lead of the other way falls from 1/2 to 2 over a factor of 100: they cross at the middle.
    document["modelled"] = {{{"ranks", 100}, {"forwarding_s", 2.0}, {"broadcast_s", 1.0}},
                            {{"ranks", 10000}, {"forwarding_s", 2.0}, {"broadcast_s", 4.0}}};
    return document;
}

TEST(MakeReport, RanksAreCountedAndModelled) {
    const std::string html = page_of({ranks_document()});
    expect_whole(html);
    EXPECT_TRUE(holds(html, "<section id=\"ranks\">"));
    EXPECT_FALSE(holds(html, "<section id=\"other\">"));
    EXPECT_TRUE(holds(html, "the slowest of 4 ranks computes <strong>1.27</strong>"));
    EXPECT_TRUE(holds(html, "With every rank alone at the same time it is 1.25 s"));
    EXPECT_TRUE(holds(html, "beyond the crossing at about 1,000 ranks"));
    EXPECT_TRUE(holds(html, "on 10,000 ranks the other way takes 2.00 times as long"));
    EXPECT_TRUE(holds(html, "seconds (log scale) (modelled)"));
    EXPECT_TRUE(holds(html, "<span class=\"badge simulated\">modelled</span>"));
    EXPECT_TRUE(holds(html, "1.25 \xC3\x97"));  // 5 rounds were predicted, 4 counted
    Json bare = Json::parse(R"({"command": "mpi bench strong", "counted": 3, "modelled": [{}]})");
    expect_whole(page_of({bare}));
}

TEST(MakeReport, MadeUpSimulationsAreShownAndLabelled) {
    for (const char* name : {"simulate.json", "traversal.json"}) {
        ReportInput input;
        input.documents = {{name, shared_document(name)}};
        ASSERT_FALSE(input.documents[0].json.empty());
        const std::string html = make_report(input);
        expect_whole(html);
        EXPECT_TRUE(holds(html, "<section id=\"simulated\">"));
        EXPECT_TRUE(holds(html, "persistent_speculative_while_while"));
        EXPECT_TRUE(holds(html, "upper bound, Mrays/s (simulated)"));
        EXPECT_TRUE(holds(html, "SIMD efficiency by operation"));
        EXPECT_EQ(holds(html, "does not hold"), std::string(name) == "traversal.json");
        EXPECT_EQ(holds(html, "other edition"), std::string(name) == "traversal.json");
    }
}

TEST(MakeReport, AMeasuredRateAboveItsBoundIsAnAlarm) {
    Json document = Json::parse(shared_document("traversal.json"));
    EXPECT_FALSE(holds(page_of({document}), "the model is wrong there"));
    // Above what memory allows by the model, not above what it issues.
    document["measured"][0]["percent_of_simulated"] = 120.0;
    document["measured"][0]["mrays_per_s_bound"] = 2778.0;
    EXPECT_FALSE(holds(page_of({document}), "the model is wrong there"));
    EXPECT_TRUE(holds(page_of({document}), "above the limit"));
    document["measured"][0]["mrays_per_s_bound"] = 2776.0;
    EXPECT_TRUE(holds(page_of({document}), "the model is wrong there"));
    EXPECT_TRUE(holds(page_of({document}), "above the bound"));
}

TEST(MakeReport, APublishedRateAboveItsBoundIsAnAlarm) {
    Json document = Json::parse(shared_document("traversal.json"));
    EXPECT_FALSE(holds(page_of({document}), "differ from the authors' there"));
    document["published"][0]["mrays_per_s"] = 600.0;  // the bound is 584.7
    EXPECT_TRUE(holds(page_of({document}), "differ from the authors' there"));
}

Json simulated_document(double bound, Json error, double part) {
    return {{"command", "simulate"},
            {"version", "1"},
            {"scene", {{"name", "hall.obj"}}},
            {"simulate",
             {{{"kernel", "packet"},
               {"rays", "primary"},
               {"machine", "gtx285"},
               {"mrays_per_s_bound", bound},
               {"sample", part},
               {"part_taken", part},
               {"sampling_error", error}}}}};
}

TEST(MakeReport, SimulatedFiguresDifferBeyondTheirSamplingErrorOnly) {
    const Json whole = simulated_document(100, 0.0, 1.0);
    const std::string near = page_of({whole, simulated_document(104, 0.03, 0.003)});
    EXPECT_TRUE(holds(near, "within the sampling error"));
    EXPECT_FALSE(holds(near, "\xE2\x96\xB2 better"));
    EXPECT_FALSE(holds(near, "settings are the same"));
    EXPECT_TRUE(holds(near, "part of the rays that was traced"));
    const std::string far = page_of({whole, simulated_document(107, 0.03, 0.003)});
    EXPECT_TRUE(holds(far, "\xE2\x96\xB2 better"));
    const std::string unknown = page_of({whole, simulated_document(500, nullptr, 0.003)});
    EXPECT_TRUE(holds(unknown, "its error is not known"));
    EXPECT_FALSE(holds(unknown, "\xE2\x96\xB2 better"));
    // Two runs over all rays have no error.
    const std::string exact = page_of({whole, simulated_document(100.1, 0.0, 1.0)});
    EXPECT_TRUE(holds(exact, "\xE2\x96\xB2 better"));
    EXPECT_TRUE(holds(exact, "settings are the same"));
}

TEST(MakeReport, MeasuredRowsAreCalledByTheirDevice) {
    const Json document{{"command", "bench traversal"},
                        {"measured",
                         {{{"scene", "hall.obj"},
                           {"kernel", "packet"},
                           {"rays", "primary"},
                           {"device", "EPYC (OpenCL on a CPU)"},
                           {"mrays_per_s", 1.5}}}}};
    const std::string html = page_of({document, document});
    EXPECT_TRUE(holds(html, "EPYC (OpenCL on a CPU),<wbr> measured"));
    EXPECT_FALSE(holds(html, "on a GPU"));
}

TEST(MakeReport, TheBestBoundNamesItsError) {
    Json document = simulated_document(100, 0.03, 0.01);
    Json second = document["simulate"][0];
    second["kernel"] = "if_if";
    second["mrays_per_s_bound"] = 95.0;
    document["simulate"].push_back(second);
    const std::string html = page_of({document});
    EXPECT_TRUE(holds(html, "\xC2\xB1 6"));
    EXPECT_TRUE(holds(html, "within the error also"));
    document["simulate"][1]["mrays_per_s_bound"] = 80.0;
    EXPECT_FALSE(holds(page_of({document}), "within the error also"));
}

TEST(MakeReport, KernelsThatMayBeAsFastStandBesideTheFirst) {
    Json document = Json::parse(shared_document("traversal.json"));
    std::string html = page_of({document});
    EXPECT_TRUE(holds(html, "Which kernel"));
    EXPECT_TRUE(holds(html, "if_if 1.02 (0.97 to 1.07)"));
    EXPECT_FALSE(holds(html, "packet 2.00"));
    EXPECT_TRUE(holds(html, ">none<"));
    document["ranking"][1]["kernels"][1].update(
        {{"low", nullptr}, {"high", nullptr}, {"behind", nullptr}, {"needs", "needs more"}});
    html = page_of({document});
    EXPECT_TRUE(holds(html, "while_while 2.00 (needs more)"));
    EXPECT_FALSE(holds(html, ">none<"));
    document.erase("ranking");
    EXPECT_FALSE(holds(page_of({document}), "Which kernel"));
}

TEST(MakeReport, ClaimsSayWhatTheyWouldTake) {
    Json document = Json::parse(shared_document("traversal.json"));
    document["claims"][2]["verdict"] = "needs whole launches";
    EXPECT_TRUE(holds(page_of({document}), "needs whole launches"));
}

TEST(MakeReport, ClaimsWithoutAVerdictAreNotCountedAmongThoseThatHaveOne) {
    Json document = Json::parse(shared_document("traversal.json"));
    document["claims"] = Json::array();
    const auto add = [&](const char* verdict, const Json& holds) {
        document["claims"].push_back({{"claim", "c"}, {"verdict", verdict}, {"holds", holds}});
    };
    add("needs rays", nullptr);
    add("needs rays", nullptr);
    const std::string none = page_of({document});
    EXPECT_TRUE(holds(none, "No claim of the paper has a verdict here: 2 need rays."));
    EXPECT_FALSE(holds(none, "claims of the paper hold here"));
    add("holds", true);
    add("open", nullptr);
    add("needs whole launches", nullptr);
    const std::string some = page_of({document});
    EXPECT_TRUE(holds(some, "Of 2 claims of the paper that have a verdict, <strong>1 holds"));
    EXPECT_TRUE(holds(some, "and 1 stays open; 2 need rays and 1 needs whole launches."));
    EXPECT_TRUE(holds(some, "1 of 2"));
}

TEST(MakeReport, TheLowestSahIsThatOfAllTreesOfTheTable) {
    Json again = build_document(4), better = build_document(4), other = build_document(4);
    again["build"]["reinsertion_rounds"] = 2;
    again["build"]["sah"] = 12.25;
    again["build"]["tree_hash"] = "11ff";
    better["command"] = "trace";
    better["build"]["builder"] = "sbvh";
    better["build"]["sah"] = 11.125;
    better["build"]["tree_hash"] = "22ff";
    const std::string html = page_of({build_document(4), again, better, better});
    EXPECT_TRUE(holds(html, "the lowest SAH cost, 11.12, is that of <strong>sbvh"));
    EXPECT_TRUE(holds(html, "the highest, 12.50, is that of karras."));
    EXPECT_TRUE(holds(html, "karras, 2 rounds of reinsertion"));
    EXPECT_FALSE(holds(html, "give the same tree"));  // one tree, traced twice
    // Costs of other constants are no rivals.
    better["build"]["sah_constants"] = {{"node", 2.0}, {"primitive", 1.0}};
    EXPECT_FALSE(holds(page_of({build_document(4), better}), "the lowest SAH cost"));
    // What nothing else tells apart its document does.
    EXPECT_TRUE(holds(page_of({build_document(4), build_document(2)}), "karras, d1.json"));
}

TEST(MakeReport, NothingToSayIsNoSummary) {
    for (const Json& document : {Json::parse(R"({"command": "scenes", "scenes": []})"),
                                 Json::parse(R"({"command": "simulate", "simulate": []})")})
        EXPECT_FALSE(holds(page_of({document}), "Summary"));
    EXPECT_TRUE(holds(page_of({build_document(4)}), "<a href=\"#summary\">Summary</a>"));
}

TEST(MakeReport, APublishedRateWithinTheErrorOfItsBoundIsNoAlarm) {
    Json document = Json::parse(shared_document("traversal.json"));
    document["published"][0]["mrays_per_s"] = 600.0;  // the bound is 584.7
    for (Json& row : document["simulate"]) row["sampling_error"] = 0.03;
    const std::string html = page_of({document});
    EXPECT_FALSE(holds(html, "differ from the authors' there"));
    EXPECT_TRUE(holds(html, "above, within the error"));
    // Two documents, one row.
    Json other = document;
    other["simulate"] = Json::array();
    const std::string twice = page_of({document, other});
    const auto count = [](const std::string& text, const std::string& part) {
        std::size_t n = 0;
        for (std::size_t at = text.find(part); at != std::string::npos;
             at = text.find(part, at + 1))
            ++n;
        return n;
    };
    EXPECT_EQ(count(twice, "above, within the error"), count(html, "above, within the error"));
}

TEST(MakeReport, UnknownDocumentsAreTables) {
    const std::string html = page_of({Json::parse(R"({"command": "bench unheard-of", "answer": 42,
        "deep": {"a": {"b": {"c": {"d": {"e": {"f": 1}}}}}}, "rows": [{"x": 1, "y": {"z": "text"}}, {"x": null}],
        "mixed": [1, "two", {"three": 3}], "none": [], "nothing": {}})"),
                                      Json::parse("{}")});
    expect_whole(html);
    for (const char* part :
         {"bench unheard-of", "answer", ">42<", "y.<wbr>z", "(3 values)", "of no command"})
        EXPECT_TRUE(holds(html, part) || holds(html, "y.z")) << part;
    EXPECT_TRUE(holds(html, "this page has no part for"));
}

TEST(MakeReport, UnknownFieldsOfKnownDocumentsAreTables) {
    Json document = build_document(4);
    document["surprise"] = {{"depth", 5}};
    EXPECT_TRUE(holds(page_of({document}), "surprise.depth"));
}

TEST(MakeReport, BrokenTextNamesTheDocument) {
    const auto fault = [](const std::string& json) -> std::string {
        ReportInput input;
        input.documents = {{"bad.json", json}};
        try {
            static_cast<void>(make_report(input));
        } catch (const InputError& error) {
            return error.what();
        }
        return "none";
    };
    EXPECT_EQ(fault("{\"a\": }"), "bad.json: JSON: not valid at byte 7");
    EXPECT_EQ(fault(""), "bad.json: JSON: not valid at byte 1");
    EXPECT_EQ(fault("[1, 2]"),
              "bad.json: JSON: not an object, so not a result of a raydix command");
    EXPECT_EQ(fault("{\"a\": 1e999}"), "bad.json: JSON: a number is out of range");
    EXPECT_EQ(fault(fmt::format("{{\"a\": {}", std::string(100000, '['))),
              "bad.json: JSON: nested deeper than 64 levels");
    EXPECT_EQ(fault("{\"a\": \"\xFF\"}").substr(0, 30), "bad.json: JSON: not valid at b");
}

TEST(MakeReport, PicturesAreInThePage) {
    Picture grey{.width = 2, .height = 1, .pixels = {{0.5f, 0.5f, 0.5f}, {0, 0, 0}}};
    ReportInput input;
    input.pictures = {make_report_picture("<b>name", "what it shows", grey, false)};
    const std::string html = make_report(input);
    EXPECT_TRUE(holds(html, "src=\"data:image/png;base64,iVBORw0KGgo"));
    EXPECT_TRUE(holds(html, "width=\"2\" height=\"1\""));
    EXPECT_FALSE(holds(html, "<b>name"));
    expect_whole(html);
    test::TempFolder folder;
    save_picture(folder.path() / "p.png", grey, false);
    EXPECT_EQ(load_report_picture(folder.path() / "p.png").width, 2u);
    std::ofstream(folder.path() / "no.png") << "no picture";
    EXPECT_THROW(static_cast<void>(load_report_picture(folder.path() / "no.png")), InputError);
    EXPECT_THROW(static_cast<void>(load_report_picture(folder.path() / "absent.png")), InputError);
}

/// Values that no field expects.
Json odd_value(std::mt19937& random) {
    static const std::vector<Json> odd{nullptr,
                                       true,
                                       -1,
                                       1e300,
                                       -1e-300,
                                       0,
                                       "",
                                       "<script>",
                                       Json::array(),
                                       Json::object(),
                                       {1, nullptr},
                                       {{"median", nullptr}},
                                       "\xE2\x82\xAC",
                                       Json::array({Json::object()})};
    return odd[random() % odd.size()];
}

/// Replaces or removes one value somewhere below.
void damage(Json& value, std::mt19937& random) {
    if (!value.is_structured() || value.empty() || random() % 12 == 0) {
        value = odd_value(random);
        return;
    }
    auto it = value.begin();
    std::advance(it, static_cast<std::ptrdiff_t>(random() % value.size()));
    if (random() % 10 == 0)
        value.erase(it);
    else
        damage(*it, random);
}

TEST(MakeReport, DamagedDocumentsStillGiveAPage) {
    const std::uint32_t seed = std::random_device{}();
    SCOPED_TRACE(fmt::format("seed {}", seed));
    std::mt19937 random(seed);
    std::ifstream study(test::source_file("bench/results/hierarchy-Milan-2-cores.json"));
    Json hierarchy = Json::parse(study);
    Json& runs = hierarchy["runs"];
    while (runs.size() > 12) runs.erase(runs.size() / 2);  // enough of each kind, and quick
    Json simulate = Json::parse(shared_document("simulate.json")),
         traversal = Json::parse(shared_document("traversal.json"));
    for (Json* document : {&simulate, &traversal})
        while ((*document)["simulate"].size() > 6) (*document)["simulate"].erase(5);
    Json trace = build_document(3);
    trace["command"] = "trace";
    trace["trace"] =
        Json::parse(R"([{"rays": "ao", "mode": "any", "kernel": "scalar", "device": "cpu",
        "count": 10, "hits": 5, "mrays_per_s": {"median": 2, "min": 1, "max": 3},
        "node_visits_per_ray": 7.5, "triangle_tests_per_ray": 2.5}])");
    const Json check =
                   Json::parse(R"({"command": "check", "check": {"ok": false, "broken": "x"}})"),
               info = Json::parse(R"({"command": "info", "scene": {"name": "s", "triangles": 3,
                                      "bounds": [[0, 0, 0], [1, 1, 1]]}})");
    for (std::size_t round = 0; round < 5 * test::thorough; ++round)
        for (const Json& whole :
             {build_document(4), trace, simulate, traversal, hierarchy, check, info}) {
            Json damaged = whole;
            for (std::size_t k = 0; k <= round % 20; ++k)
                for (auto& [key, value] : damaged.items())
                    if (key != "command" && random() % 2) damage(value, random);
            const std::string html = page_of({whole, damaged});
            EXPECT_TRUE(html.ends_with("</body></html>\n"));
            EXPECT_EQ(html.find("<script>", html.find("<script>") + 1), std::string::npos)
                << "an element of the document's own";
            if (HasFailure()) return;
        }
}

TEST(ReportReferences, NameScenesAndPicturesOnce) {
    const ReportReferences references = report_references(
        {"d",
         R"({"scene": {"name": "a"}, "runs": [{"scene": "b"}, {"scene": "a"}, {"scene": 3}, {"scene": "c", "series": "size"}],
                 "render": {"file": "p.png"}})"});
    EXPECT_EQ(references.scenes, (std::vector<std::string>{"a", "b", "3"}));
    EXPECT_EQ(references.pictures, (std::vector<std::string>{"p.png"}));
}

TEST(SaveReport, WholeOrNotAtAll) {
    test::TempFolder folder;
    const auto file = folder.path() / "page.html";
    save_report(file, "old");
    save_report(file, "new");
    std::ifstream in(file);
    std::string text;
    in >> text;
    EXPECT_EQ(text, "new");
    EXPECT_THROW(save_report(folder.path() / "absent" / "page.html", "x"), InputError);
}

}  // namespace
}  // namespace raydix
