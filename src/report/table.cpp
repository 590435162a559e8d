#include "report/table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "report/html.h"
#include "report/number_text.h"

namespace raydix::report {
namespace {

using Format = Column::Format;

// Longer heads of columns may be broken into lines.
constexpr std::size_t short_title = 16;
// Longer texts may be broken into lines.
constexpr std::size_t short_text = 40;

bool has_number(const Cell& cell) { return cell.value && std::isfinite(*cell.value); }

/// Decides the digits of one column.
int decimals_of(const Table& table, std::size_t column) {
    std::vector<double> values;
    for (const auto& row : table.rows)
        if (column < row.size() && has_number(row[column])) values.push_back(*row[column].value);
    return decimals_for(values);
}

std::string number_text(const Column& column, double value, int decimals) {
    switch (column.format) {
        case Format::percent:
            return with_decimals(100 * value, 1) + " %";
        case Format::ratio:
            return with_decimals(value, 2) + " \xC3\x97";
        case Format::integer:
            return with_decimals(value, 0);
        case Format::mixed:
        case Format::text:
            return value == std::floor(value) ? with_decimals(value, 0) : significant(value, 4);
        case Format::number:
            break;
    }
    return with_decimals(value, decimals);
}

const char* mark_class(Cell::Mark mark) {
    constexpr const char* names[] = {"", " better", " worse", " even", " alert"};
    return names[static_cast<int>(mark)];
}

std::string cell_html(const Column& column, const Cell& cell, int decimals, bool head) {
    const bool numeric = column.format != Format::text;
    std::string inner;
    if (!cell.swatch.empty()) inner = "<i class=\"swatch " + escaped(cell.swatch) + "\"></i>";
    if (has_number(cell)) {
        inner += escaped(number_text(column, *cell.value, decimals));
        if (!cell.text.empty()) inner += " <small>" + escaped(cell.text) + "</small>";
    } else {
        const bool is_short = cell.text.size() <= short_text;
        inner += cell.text.empty() ? "<span class=\"none\">\xE2\x80\x93</span>"
                 : is_short        ? escaped(cell.text)
                                   : breakable(cell.text);
    }
    const char* kind = numeric ? "num" : cell.text.size() > short_text ? "txt long" : "txt";
    std::string attributes =
        fmt::format("class=\"{}{}{}\"", kind, mark_class(cell.mark), cell.shade ? " shade" : "");
    if (has_number(cell)) attributes += fmt::format(" data-v=\"{:.17g}\"", *cell.value);
    if (!cell.tip.empty()) attributes += " title=\"" + escaped(cell.tip) + "\"";
    if (cell.shade && std::isfinite(*cell.shade))
        attributes +=
            fmt::format(" style=\"--shade:{:.0f}%\"", 100 * std::clamp(*cell.shade, 0.0, 1.0));
    return head ? "<th scope=\"row\" " + attributes + ">" + inner + "</th>"
                : "<td " + attributes + ">" + inner + "</td>";
}

std::string head_html(const Column& column) {
    std::string inner = "<span class=\"name\">" + breakable(column.title) + "</span>";
    if (!column.unit.empty()) inner += " <span class=\"unit\">" + escaped(column.unit) + "</span>";
    inner += badge(column.origin);
    return fmt::format("<th scope=\"col\" class=\"{}{}\"{}>{}</th>",
                       column.format == Format::text ? "txt" : "num",
                       column.title.size() > short_title ? " long" : "",
                       column.help.empty() ? "" : " title=\"" + escaped(column.help) + "\"", inner);
}

}  // namespace

void Table::drop_empty_columns() {
    for (std::size_t c = columns.size(); c-- > 0;) {
        const bool used = std::ranges::any_of(rows, [&](const std::vector<Cell>& row) {
            return c < row.size() && (has_number(row[c]) || !row[c].text.empty());
        });
        if (used) continue;
        columns.erase(columns.begin() + static_cast<std::ptrdiff_t>(c));
        for (auto& row : rows)
            if (c < row.size()) row.erase(row.begin() + static_cast<std::ptrdiff_t>(c));
    }
}

std::string table_html(const Table& table) {
    if (table.rows.empty()) return {};
    std::string out = "<div class=\"table\" role=\"region\" tabindex=\"0\" aria-label=\"" +
                      escaped(table.title) + "\"><table><caption>" + escaped(table.title) + " " +
                      badge(table.origin) + "</caption>\n<thead><tr>";
    std::vector<int> decimals;
    for (std::size_t c = 0; c < table.columns.size(); ++c) {
        out += head_html(table.columns[c]);
        decimals.push_back(decimals_of(table, c));
    }
    out += "</tr></thead>\n<tbody>\n";
    const std::size_t shown = std::min(table.rows.size(), most_table_rows);
    for (std::size_t r = 0; r < shown; ++r) {
        out += "<tr>";
        for (std::size_t c = 0; c < table.columns.size(); ++c) {
            static const Cell empty;
            const Cell& cell = c < table.rows[r].size() ? table.rows[r][c] : empty;
            out += cell_html(table.columns[c], cell, decimals[c], c == 0);
        }
        out += "</tr>\n";
    }
    out += "</tbody></table></div>\n";
    if (shown < table.rows.size())
        out += "<p class=\"note\">" + grouped(table.rows.size() - shown) +
               " further rows are left out; they are in the document.</p>\n";
    if (!table.note.empty()) out += "<p class=\"note\">" + escaped(table.note) + "</p>\n";
    return out;
}

}  // namespace raydix::report
