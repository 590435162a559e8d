// What no other part of the page shows, and which documents the page is made from.
#include <algorithm>
#include <set>

#include "report/html.h"
#include "report/number_text.h"
#include "report/plain_tables.h"
#include "report/sections.h"
#include "report/table.h"

namespace raydix::report {
namespace {

/// Top-level fields that some section reads, by command.
const std::map<std::string, std::set<std::string>>& known_fields() {
    static const std::set<std::string> ranks_fields{"cloud",
                                                    "given",
                                                    "partition",
                                                    "points",
                                                    "queries",
                                                    "k",
                                                    "model",
                                                    "counted",
                                                    "predicted",
                                                    "seed",
                                                    "alone_compute_s_most",
                                                    "modelled"};
    static const std::map<std::string, std::set<std::string>> known{
        {"build", {"build"}},
        {"trace", {"build", "trace"}},
        {"simulate", {"build", "simulate", "machines"}},
        {"bench traversal",
         {"build", "simulate", "machines", "measured", "published", "claims", "ranking",
          "width_sweep"}},
        {"bench hierarchy",
         {"max_leaf", "factors", "runs", "builds", "machines", "hierarchy_claims", "gpu"}},
        {"mpi bench weak", ranks_fields},
        {"mpi bench strong", ranks_fields},
        {"check", {"check"}},
        {"info", {"build"}},
        {"render", {"render"}}};
    return known;
}

const std::set<std::string> common_fields{"command", "version", "machine", "load_ms", "seed"};

}  // namespace

Section other_section(const Documents& documents) {
    Section section{.id = "other", .title = "Other fields"};
    for (const Document& document : documents) {
        const auto known = known_fields().find(document.command);
        Json rest = Json::object();
        for (const auto& [key, value] : document.root.items()) {
            const bool shown =
                common_fields.contains(key) ||
                (known != known_fields().end() && (known->second.contains(key) || key == "scene"));
            if (!shown) rest[key] = value;
        }
        if (known == known_fields().end())
            section.html += "<p class=\"note\">" + breakable(document.name) + " is " +
                            (document.command.empty()
                                 ? "of no command"
                                 : "of the command \xE2\x80\x9C" + escaped(document.command) +
                                       "\xE2\x80\x9D, which this page has no part for") +
                            "; it is shown as it is.</p>\n";
        if (!rest.empty()) section.html += plain_tables(document.name, rest);
    }
    return section;
}

Section sources_section(const Documents& documents) {
    Section section{.id = "sources", .title = "Sources"};
    Table table{.title = "Documents of this page",
                .note =
                    "Made by \xE2\x80\x9Craydix report\xE2\x80\x9D from these files alone; every "
                    "figure above is one of theirs or computed from them.",
                .columns = {{"document"}, {"command"}, {"scene"}, {"machine"}, {"raydix"}}};
    for (const Document& document : documents) {
        const bool has_scene = !at(document.root, "scene").is_null();
        table.rows.push_back({document.name, document.command,
                              has_scene ? scene_name(document.root) : "", machine_text(document),
                              text_at(document.root, "version")});
    }
    section.html = table_html(table);
    return section;
}

std::string scene_name(const Json& holder) {
    const Json& scene = at(holder, "scene");
    std::string name = scene.is_object() ? text_at(scene, "name") : text_at(holder, "scene");
    return name.empty() ? "a scene without a name" : name;
}

std::string strong(const std::string& text) { return "<strong>" + breakable(text) + "</strong>"; }

std::string strong(const std::string& number, const std::string& unit) {
    return "<strong>" + escaped(number) + "&nbsp;" + escaped(unit) + "</strong>";
}

}  // namespace raydix::report
