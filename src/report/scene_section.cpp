// Documents of `info`, `check` and `scenes` -> what the scenes hold and whether trees are sound.
#include <fmt/format.h>

#include "report/html.h"
#include "report/number_text.h"
#include "report/sections.h"
#include "report/table.h"

namespace raydix::report {
namespace {

using Format = Column::Format;

std::string box_text(const Json& bounds) {
    if (!bounds.is_array() || bounds.size() != 2) return {};
    std::string text;
    for (const Json& corner : bounds) {
        const std::vector<double> v = numbers_at(corner, "");
        if (v.size() != 3) return {};
        text += fmt::format("{}({}, {}, {})", text.empty() ? "" : " to ", significant(v[0]),
                            significant(v[1]), significant(v[2]));
    }
    return text;
}

std::string scene_table(const Documents& documents) {
    Table table{.title = "Scenes",
                .columns = {{"scene"},
                            {"triangles", Format::integer},
                            {"points", Format::integer},
                            {"vertices", Format::integer},
                            {"box"},
                            {"zero area", Format::integer, "triangles"},
                            {"repeated index", Format::integer, "triangles"},
                            {"not finite", Format::integer, "vertices"},
                            {"out of range", Format::integer, "vertices"},
                            {"unreferenced", Format::integer, "vertices"},
                            {"left out of trees", Format::integer, "triangles"},
                            {"cameras", Format::integer},
                            {"size", Format::number, "MB"},
                            {"loading", Format::number, "ms"}}};
    for (const Document& document : documents) {
        if (document.command != "info") continue;
        const Json& s = at(document.root, "scene");
        auto size = number_at(s, "bytes");
        if (size) *size /= 1e6;
        table.rows.push_back(
            {scene_name(document.root), number_at(s, "triangles"), number_at(s, "points"),
             number_at(s, "vertices"), box_text(at(s, "bounds")),
             number_at(s, "zero_area_triangles"), number_at(s, "repeated_index_triangles"),
             number_at(s, "non_finite_vertices"), number_at(s, "out_of_range_vertices"),
             number_at(s, "unreferenced_vertices"), number_at(s, "left_out_triangles"),
             number_at(s, "cameras"), size, number_at(document.root, "load_ms")});
    }
    table.drop_empty_columns();
    return table_html(table);
}

/// What a `check` object says: in a cell and in the summary.
struct CheckVerdict {
    bool known, good;
    std::string cell, sentence;
};

/// Of a tree, or of two that were compared.
CheckVerdict verdict_of(const Json& check, const std::string& document) {
    const Json& ok = at(check, "ok");
    const bool known = ok.is_boolean(), good = known && ok.get<bool>();
    const Json& pair = at(check, "compared");
    if (pair.is_array() && pair.size() == 2 && pair[0].is_string() && pair[1].is_string()) {
        const std::string a = pair[0].get<std::string>(), b = pair[1].get<std::string>();
        const std::string where = text_at(check, "difference");
        const std::string both = breakable(a) + " and " + breakable(b);
        return {known, good,
                a + " and " + b + (good ? ": the same \xE2\x9C\x93" : " differ: " + where),
                good ? fmt::format("Compared: the trees of {} are the same.", both)
                     : fmt::format("<span class=\"warning\">The trees of {} differ: {}</span>",
                                   both, escaped(where))};
    }
    const std::string why = text_at(check, "broken");
    return {
        known, good, good ? "\xE2\x9C\x93 every invariant holds" : "\xE2\x9C\x97 broken: " + why,
        good ? fmt::format("Checked: every invariant of the tree in {} holds.", breakable(document))
             : fmt::format("<span class=\"warning\">The tree checked in {} is broken: {}</span>",
                           breakable(document), escaped(why))};
}

std::string check_table(const Documents& documents, Section& section) {
    Table table{
        .title = "Checks",
        .columns = {
            {"document"}, {"result"}, {"nodes", Format::integer}, {"primitives", Format::integer}}};
    for (const Document& document : documents) {
        const Json& check = at(document.root, "check");
        if (!check.is_object()) continue;
        const CheckVerdict verdict = verdict_of(check, document.name);
        Cell result(verdict.known ? verdict.cell : "says neither yes nor no");
        result.mark = !verdict.known ? Cell::Mark::even
                      : verdict.good ? Cell::Mark::better
                                     : Cell::Mark::alert;
        table.rows.push_back(
            {document.name, result, number_at(check, "nodes"), number_at(check, "primitives")});
        if (verdict.known) section.summary.push_back(verdict.sentence);
    }
    return table_html(table);
}

}  // namespace

Section scene_section(const Documents& documents) {
    Section section{.id = "scenes", .title = "Scenes and checks"};
    section.html = scene_table(documents) + check_table(documents, section);
    for (const Document& document : documents)
        if (document.command == "info")
            section.summary.push_back(fmt::format(
                "{} has {} triangles and {} vertices.", strong(scene_name(document.root)),
                escaped(text_at(document.root, "scene.triangles")),
                escaped(text_at(document.root, "scene.vertices"))));
    return section;
}

}  // namespace raydix::report
