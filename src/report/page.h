// Sections -> one HTML page that needs nothing from outside.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace raydix::report {

/// A figure to read from across the room. Texts are plain, `badge` is HTML.
struct Tile {
    std::string value, unit, what, badge;
};

/// Part of the page. `summary` and `html` are HTML, the other texts plain.
struct Section {
    std::string id, title;
    std::string html = {};
    std::vector<Tile> tiles = {};
    std::vector<std::string> summary = {};  // sentences for the head of the page
};

struct Page {
    std::string title, subtitle;
    std::vector<Section> sections = {};
};

[[nodiscard]] std::string page_html(const Page& page);

/// What all pages carry within them.
[[nodiscard]] std::string_view page_style();
[[nodiscard]] std::string_view page_script();

}  // namespace raydix::report
