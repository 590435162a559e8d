#include "report/page.h"

#include "report/html.h"

namespace raydix::report {
namespace {

// Only the script whose hash this is may run, whatever the documents hold; nothing may be loaded.
constexpr std::string_view policy =
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; "
    "form-action 'none'; script-src 'sha256-ssr0VN2arQUg2JeHSdDM84nYN4dGSdmQem8+h6YaLKk='";

std::string head(const Page& page) {
    std::string out =
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
        "<meta http-equiv=\"Content-Security-Policy\" content=\"";
    out += policy;
    out +=
        "\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
        "<meta name=\"color-scheme\" content=\"light dark\">\n"
        "<link rel=\"icon\" href=\"data:,\">\n<title>";
    out += escaped(page.title) + "</title>\n<style>";
    out += page_style();
    return out + "</style></head>\n<body>\n";
}

std::string tile_html(const Tile& tile) {
    std::string value = breakable(tile.value);
    if (!tile.unit.empty()) value += " <small>" + escaped(tile.unit) + "</small>";
    return "<li><b>" + value + "</b><span class=\"what\">" + breakable(tile.what) + "</span>" +
           tile.badge + "</li>";
}

/// Empty if no section has anything to say.
std::string summary_html(const Page& page) {
    std::string tiles, said;
    for (const Section& section : page.sections) {
        for (const Tile& tile : section.tiles) tiles += tile_html(tile);
        if (section.summary.empty()) continue;
        said += "<h3>" + escaped(section.title) + "</h3>\n<ul class=\"said\">\n";
        for (const std::string& sentence : section.summary) said += "<li>" + sentence + "</li>\n";
        said += "</ul>\n";
    }
    if (tiles.empty() && said.empty()) return {};
    std::string out = "<section id=\"summary\"><h2>Summary</h2>\n";
    if (!tiles.empty()) out += "<ul class=\"tiles\">" + tiles + "</ul>\n";
    return out + said + "</section>\n";
}

}  // namespace

std::string page_html(const Page& page) {
    const std::string summary = summary_html(page);
    std::string out = head(page);
    out += "<header><h1>" + escaped(page.title) + "</h1><p class=\"lead\">" +
           breakable(page.subtitle) + "</p></header>\n";
    out += "<nav aria-label=\"Sections\"><ul>";
    if (!summary.empty()) out += "<li><a href=\"#summary\">Summary</a></li>";
    for (const Section& section : page.sections)
        if (!section.html.empty())
            out += "<li><a href=\"#" + id_of(section.id) + "\">" + escaped(section.title) +
                   "</a></li>";
    out += "</ul></nav>\n<main>\n" + summary;
    for (const Section& section : page.sections)
        if (!section.html.empty())
            out += "<section id=\"" + id_of(section.id) + "\"><h2>" + escaped(section.title) +
                   "</h2>\n" + section.html + "</section>\n";
    out += "</main>\n<script>";
    out += page_script();
    return out + "</script>\n</body></html>\n";
}

}  // namespace raydix::report
