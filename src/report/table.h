// Rows of texts and numbers -> an HTML table whose columns can be sorted, numbers aligned by their
// points.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "report/figure.h"

namespace raydix::report {

struct Column {
    // number: the same digits behind the point all the way down; mixed: each cell its own digits;
    // percent: of a part 0..1; ratio: "1.23 x"
    enum class Format { text, number, mixed, integer, percent, ratio };
    std::string title;
    Format format = Format::text;
    std::string unit = {};
    Origin origin = Origin::none;
    std::string help = {};  // shown under the pointer
};

struct Cell {
    enum class Mark { none, better, worse, even, alert };
    std::string text;             // of a text column, or beside the number
    std::optional<double> value;  // of the other columns; nothing: a dash
    std::string tip;
    std::optional<double> shade;  // 0..1: how strongly the cell is coloured
    Mark mark = Mark::none;
    std::string swatch;  // colour class drawn before the text

    Cell() = default;
    Cell(std::string t) : text(std::move(t)) {}  // NOLINT: cells are written as what they hold
    Cell(const char* t) : text(t) {}             // NOLINT
    Cell(std::optional<double> v) : value(v) {}  // NOLINT
    Cell(double v) : value(v) {}                 // NOLINT
};

struct Table {
    std::string title = {}, note = {};
    Origin origin = Origin::none;
    std::vector<Column> columns = {};
    std::vector<std::vector<Cell>> rows = {};  // short rows end with dashes

    /// Takes out the columns in which no row has anything.
    void drop_empty_columns();
};

/// Rows beyond this many are left out, and the page says so.
inline constexpr std::size_t most_table_rows = 2000;

/// Empty text if there are no rows. The first column is the head of its row.
[[nodiscard]] std::string table_html(const Table& table);

}  // namespace raydix::report
