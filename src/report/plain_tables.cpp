#include "report/plain_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "report/html.h"
#include "report/names.h"
#include "report/number_text.h"
#include "report/table.h"

namespace raydix::report {
namespace {

constexpr int deepest_shown = 4;
constexpr std::size_t most_listed = 8, most_columns = 24, most_tables = 40;

bool is_rows(const Json& value) {
    return value.is_array() && !value.empty() &&
           std::ranges::all_of(value, [](const Json& element) { return element.is_object(); });
}

/// A value in a few words.
Cell plain_cell(const Json& value) {
    if (value.is_number()) return value.get<double>();
    if (value.is_string()) return shortened(value.get<std::string>(), 400);
    if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
    if (value.is_object())
        return fmt::format("({})", counted(static_cast<double>(value.size()), "field"));
    if (!value.is_array()) return "";
    const bool plain = std::ranges::none_of(value, &Json::is_structured);
    if (!plain || value.size() > most_listed)
        return fmt::format("({})", counted(static_cast<double>(value.size()), "value"));
    std::string text;
    for (const Json& element : value) {
        const Cell cell = plain_cell(element);
        text += (text.empty() ? "" : ", ") + (cell.value ? significant(*cell.value, 4) : cell.text);
    }
    return text;
}

/// "a.b" -> value for everything below an object that is no object itself.
using Flat = std::vector<std::pair<std::string, const Json*>>;
void flatten(const Json& object, const std::string& prefix, int depth, Flat& out) {
    for (const auto& [key, value] : object.items()) {
        if (value.is_object() && !value.empty() && depth < deepest_shown)
            flatten(value, prefix + key + ".", depth + 1, out);
        else
            out.emplace_back(prefix + key, &value);
    }
}

std::string rows_table(const std::string& title, const Json& list, Origin origin) {
    std::vector<Flat> rows;
    std::vector<std::string> names;
    for (const Json& element : list) {
        rows.emplace_back();
        flatten(element, "", deepest_shown - 1, rows.back());
        for (const auto& [name, value] : rows.back())
            if (names.size() <= most_columns && std::ranges::find(names, name) == names.end())
                names.push_back(name);
    }
    Table table;
    table.title = title;
    table.origin = origin;
    if (names.size() > most_columns) {
        names.pop_back();
        table.note = fmt::format("Only the first {} fields of each row are shown.", most_columns);
    }
    for (const std::string& name : names) {
        const bool numeric = std::ranges::all_of(rows, [&](const Flat& row) {
            const auto found = std::ranges::find(row, name, &Flat::value_type::first);
            return found == row.end() || found->second->is_number() || found->second->is_null();
        });
        table.columns.push_back({name, numeric ? Column::Format::mixed : Column::Format::text});
    }
    for (const Flat& row : rows) {
        table.rows.emplace_back(names.size());
        for (const auto& [name, value] : row)
            if (const auto found = std::ranges::find(names, name); found != names.end())
                table.rows.back()[static_cast<std::size_t>(found - names.begin())] =
                    plain_cell(*value);
    }
    return table_html(table);
}

/// What tells a row from its neighbours.
std::string name_of_row(const Json& row, std::size_t k) {
    for (const Json& value : row)
        if (value.is_string()) return shortened(value.get<std::string>(), 80);
    return std::to_string(k + 1);
}

/// The table of a list, and those of lists within its rows. `shown`: tables so far.
void append_rows(const std::string& title, const Json& list, Origin origin, std::size_t& shown,
                 std::string& html) {
    html += rows_table(title, list, origin);
    ++shown;
    for (std::size_t k = 0; k < list.size(); ++k) {
        Flat fields;
        flatten(list[k], "", deepest_shown - 1, fields);
        for (const auto& [name, field] : fields)
            if (is_rows(*field) && shown < most_tables)
                append_rows(fmt::format("{}, {}: {}", title, name_of_row(list[k], k), name), *field,
                            origin, shown, html);
    }
}

}  // namespace

std::string plain_tables(const std::string& title, const Json& value, Origin origin) {
    if (is_rows(value)) return rows_table(title, value, origin);
    Table table;
    table.title = title;
    table.origin = origin;
    table.columns = {{"field"}, {"value", Column::Format::text}};
    Flat fields;
    if (value.is_object())
        flatten(value, "", 1, fields);
    else
        fields.emplace_back(title, &value);
    std::string lists;
    std::size_t shown = 0;
    for (const auto& [name, field] : fields) {
        if (is_rows(*field) && shown < most_tables) {
            append_rows(title + ": " + name, *field, origin, shown, lists);
        } else {
            table.rows.push_back({name, plain_cell(*field)});
        }
    }
    return table_html(table) + lists;
}

}  // namespace raydix::report
