#include "report/figure.h"

#include <fmt/format.h>

#include "report/html.h"
#include "report/svg.h"

namespace raydix::report {
namespace {

std::string swatch(const LegendItem& item) {
    Svg svg(26, 12, item.name);
    const std::string colour = colour_class(item.colour);
    switch (item.kind) {
        case LegendItem::Kind::line:
            svg.line(0, 6, 26, 6, "stroke " + colour + " " + dash_class(item.dash));
            svg.marker(item.shape, 13, 6, colour);
            break;
        case LegendItem::Kind::markers:
            svg.marker(item.shape, 13, 6, colour);
            break;
        case LegendItem::Kind::box:
            svg.rect(6, 0, 14, 12, "fill " + colour);
            break;
        case LegendItem::Kind::outline:
            svg.rect(6.5, 0.5, 13, 11, "outline " + colour);
            break;
        case LegendItem::Kind::limit:
            svg.rect(4.5, 1, 17, 10, "limit");
            break;
        case LegendItem::Kind::mark:
            svg.line(13, 0, 13, 12, "mark-line");
            break;
    }
    return svg.str();
}

}  // namespace

std::string badge(Origin origin) {
    switch (origin) {
        case Origin::measured:
            return "<span class=\"badge measured\">measured</span>";
        case Origin::simulated:
            return "<span class=\"badge simulated\">simulated</span>";
        case Origin::modelled:
            return "<span class=\"badge simulated\">modelled</span>";
        case Origin::published:
            return "<span class=\"badge published\">published</span>";
        case Origin::none:
            break;
    }
    return "";
}

std::string origin_suffix(Origin origin) {
    switch (origin) {
        case Origin::simulated:
            return " (simulated)";
        case Origin::modelled:
            return " (modelled)";
        case Origin::published:
            return " (published)";
        case Origin::measured:
        case Origin::none:
            break;
    }
    return "";
}

std::string legend_html(const std::vector<LegendItem>& legend) {
    if (legend.empty()) return {};
    std::string out = "<ul class=\"legend\">";
    for (const LegendItem& item : legend)
        out += "<li>" + swatch(item) + "<span>" + breakable(item.name) + "</span></li>";
    return out + "</ul>\n";
}

std::string figure_html(const Figure& figure) {
    std::string out = "<figure class=\"plot\"><figcaption><span class=\"title\">" +
                      escaped(figure.title) + "</span> " + badge(figure.origin);
    if (!figure.subtitle.empty())
        out += "<span class=\"subtitle\">" + breakable(figure.subtitle) + "</span>";
    out += "</figcaption>";
    out += legend_html(figure.legend) + figure.svg;
    if (!figure.note.empty()) out += "<p class=\"note\">" + escaped(figure.note) + "</p>";
    return out + "</figure>\n";
}

}  // namespace raydix::report
