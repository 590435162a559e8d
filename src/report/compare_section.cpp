// Two documents of one command -> their rows beside each other, with ratios. Rows are compared
// where exactly two documents have them, so that old and new runs of several scenes fall into
// pairs.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "report/compare_rows.h"
#include "report/compare_settings.h"
#include "report/html.h"
#include "report/number_text.h"
#include "report/sections.h"
#include "report/table.h"

namespace raydix::report {
namespace {

using Format = Column::Format;
using Better = Measure::Better;

// A measured change below this says nothing where no spread is known.
constexpr double least_change = 0.02;

enum class Verdict { better, worse, even, differs, unknown, other_work };

bool overlap(const SpreadFields& a, const SpreadFields& b) {
    return a.min && a.max && b.min && b.max && *a.min <= *b.max && *b.min <= *a.max;
}

Verdict verdict_of(const Measure& a, const Measure& b) {
    const double first = *a.value.median, second = *b.value.median;
    if (first == second) return Verdict::even;
    if (a.origin == Origin::simulated) {
        if (!a.error_known || !b.error_known) return Verdict::unknown;
        if (overlap(a.value, b.value)) return Verdict::even;
    }
    if (a.origin == Origin::measured) {
        // A stage of which one of the two builders has nothing: its work is in another stage.
        if (first == 0 || second == 0) return Verdict::differs;
        const double scale = std::fmax(std::fabs(first), std::fabs(second));
        if (overlap(a.value, b.value) || std::fabs(first - second) < least_change * scale)
            return Verdict::even;
    }
    if (a.better == Better::neither) return Verdict::differs;
    return (second < first) == (a.better == Better::lower) ? Verdict::better : Verdict::worse;
}

/// `work`: what it was that differs.
Cell verdict_cell(Verdict verdict, const Measure& a, const Measure& b, const std::string& work) {
    Cell cell;
    switch (verdict) {
        case Verdict::better:
            cell = Cell("\xE2\x96\xB2 better");
            cell.mark = Cell::Mark::better;
            break;
        case Verdict::worse:
            cell = Cell("\xE2\x96\xBC worse");
            cell.mark = Cell::Mark::worse;
            break;
        case Verdict::differs:
            cell = Cell("differs");
            break;
        case Verdict::unknown:
            cell = Cell("open: its error is not known");
            cell.mark = Cell::Mark::even;
            break;
        case Verdict::other_work:
            cell = Cell("not judged, other work: " + work);
            cell.mark = Cell::Mark::even;
            break;
        case Verdict::even:
            cell = Cell(*a.value.median == *b.value.median ? "= equal"
                        : a.origin == Origin::simulated    ? "within the sampling error"
                        : overlap(a.value, b.value)        ? "within the spread"
                                                           : "within 2 %");
            cell.mark = Cell::Mark::even;
            break;
    }
    return cell;
}

Cell value_cell(const Measure& measure) {
    Cell cell(measure.value.median);
    cell.text = measure.unit;
    const SpreadFields& v = measure.value;
    if (v.min && v.max && *v.min < *v.max)
        cell.tip = significant(*v.min) + " to " + significant(*v.max) + " " + measure.unit;
    return cell;
}

struct Tally {
    std::size_t better = 0, worse = 0, even = 0, differs = 0, unknown = 0, other_work = 0, rows = 0;
    double best_gain = 1, worst_loss = 1;  // as factors, both above 1
    std::string best, worst;
};

class Pair {
public:
    Pair(const Document& first, const Document& second) : first_(first), second_(second) {
        table_.title = "Row by row";
        table_.columns = {{"row"},
                          {"figure"},
                          {"kind"},
                          {"first", Format::mixed},
                          {"second", Format::mixed},
                          {"second / first", Format::ratio},
                          {"the second is"}};
    }

    void add(const CompareRow& a, const CompareRow& b) {
        ++tally_.rows;
        for (const Measure& m : a.measures)
            for (const Measure& n : b.measures)
                if (m.name == n.name) add_measure(a.key, m, n, work_between(a, m, b, n));
    }

    [[nodiscard]] std::string html(std::size_t without_partner) const {
        std::string out =
            fmt::format("<h3>{}: {} <small>(first)</small> and {} <small>(second)</small></h3>\n",
                        escaped(first_.command), breakable(first_.name), breakable(second_.name));
        out += settings_table() + table_html(table_);
        if (without_partner != 0)
            out += fmt::format(
                "<p class=\"note\">{} rows are in one of the two documents only, and "
                "left out.</p>\n",
                without_partner);
        return out;
    }

    [[nodiscard]] std::string sentence() const {
        std::string said = fmt::format(
            "{} against {}: of {} figures in {} matching {}, {} better, {} worse, {} equal or "
            "within their error",
            breakable(second_.name), breakable(first_.name), table_.rows.size(), tally_.rows,
            tally_.rows == 1 ? "row" : "rows", strong(std::to_string(tally_.better)),
            strong(std::to_string(tally_.worse)), tally_.even);
        if (tally_.differs) said += fmt::format(", {} different", tally_.differs);
        if (tally_.other_work) said += fmt::format(", {} of other work", tally_.other_work);
        if (tally_.unknown) said += fmt::format(", {} of unknown error", tally_.unknown);
        if (tally_.best_gain > 1)
            said += fmt::format("; most gained: {} ({} times)", breakable(tally_.best),
                                significant(tally_.best_gain));
        if (tally_.worst_loss > 1)
            said += fmt::format("; most lost: {} ({} times)", breakable(tally_.worst),
                                significant(tally_.worst_loss));
        return said + ".";
    }

private:
    /// Names of what makes two figures different questions; "" if nothing does.
    static std::string work_between(const CompareRow& a, const Measure& m, const CompareRow& b,
                                    const Measure& n) {
        const std::string of_rows = what_differs(a.work, b.work),
                          of_figures = what_differs(m.work, n.work);
        return of_rows + (of_rows.empty() || of_figures.empty() ? "" : ", ") + of_figures;
    }

    void add_measure(const std::string& key, const Measure& a, const Measure& b,
                     const std::string& work) {
        const double first = *a.value.median, second = *b.value.median;
        const bool has_ratio = first != 0 && std::isfinite(second / first) &&
                               !(a.origin == Origin::measured && second == 0);
        const auto ratio = has_ratio ? std::optional(second / first) : std::nullopt;
        const Verdict verdict = work.empty() ? verdict_of(a, b) : Verdict::other_work;
        table_.rows.push_back({key, a.name,
                               a.origin == Origin::measured    ? "measured"
                               : a.origin == Origin::simulated ? "simulated"
                                                               : "counted",
                               value_cell(a), value_cell(b), ratio,
                               verdict_cell(verdict, a, b, work)});
        count(verdict, key + ", " + a.name + origin_suffix(a.origin), ratio);
    }

    void count(Verdict verdict, const std::string& name, std::optional<double> ratio) {
        const bool factor = ratio && *ratio > 0;
        const double change = factor ? std::fmax(*ratio, 1 / *ratio) : 1;
        if (verdict == Verdict::better) {
            ++tally_.better;
            if (change > tally_.best_gain) tally_.best = name, tally_.best_gain = change;
        } else if (verdict == Verdict::worse) {
            ++tally_.worse;
            if (change > tally_.worst_loss) tally_.worst = name, tally_.worst_loss = change;
        } else {
            ++(verdict == Verdict::even         ? tally_.even
               : verdict == Verdict::unknown    ? tally_.unknown
               : verdict == Verdict::other_work ? tally_.other_work
                                                : tally_.differs);
        }
    }

    [[nodiscard]] std::string settings_table() const {
        Table table{.title = "Settings that differ",
                    .columns = {{"setting"}, {"first"}, {"second"}}};
        for (const DifferentSetting& setting : different_settings(first_, second_))
            table.rows.push_back({setting.name, setting.first, setting.second});
        if (table.rows.empty())
            return "<p class=\"note\">Machine, version and settings are the same.</p>\n";
        return table_html(table);
    }

    const Document &first_, &second_;
    Table table_;
    Tally tally_;
};

/// Documents of one command.
void compare(const std::vector<const Document*>& documents, Section& section) {
    std::vector<std::vector<CompareRow>> rows;
    std::map<std::string, std::set<std::size_t>> holders;  // of each key
    for (std::size_t d = 0; d < documents.size(); ++d) {
        rows.push_back(compare_rows(*documents[d]));
        for (const CompareRow& row : rows[d]) holders[row.key].insert(d);
    }
    for (std::size_t i = 0; i < documents.size(); ++i)
        for (std::size_t j = i + 1; j < documents.size(); ++j) {
            Pair pair(*documents[i], *documents[j]);
            std::size_t matched = 0, alone = 0;
            std::map<std::string, std::vector<const CompareRow*>> partners;
            for (const CompareRow& row : rows[j]) partners[row.key].push_back(&row);
            std::map<std::string, std::size_t> taken;  // the k-th of a key meets the k-th
            for (const CompareRow& row : rows[i]) {
                const auto found = partners.find(row.key);
                const std::size_t k = taken[row.key]++;
                const bool both = found != partners.end() && k < found->second.size() &&
                                  holders[row.key].size() == 2;
                if (both) pair.add(row, *found->second[k]);
                ++(both ? matched : alone);
            }
            if (matched == 0) continue;
            section.html += pair.html(alone + rows[j].size() - matched);
            section.summary.push_back(pair.sentence());
        }
    if (documents.size() == 2 && !rows[0].empty() && section.html.empty())
        section.html = "<p class=\"note\">The two documents of " + escaped(documents[0]->command) +
                       " have no row in common: other scenes, rays or kernels.</p>\n";
}

}  // namespace

Section compare_section(const Documents& documents) {
    Section section{.id = "comparison", .title = "Comparison"};
    std::map<std::string, std::vector<const Document*>> groups;
    for (const Document& document : documents) groups[document.command].push_back(&document);
    for (const auto& [command, group] : groups)
        if (group.size() > 1) {
            Section part = section;
            part.html.clear();
            part.summary.clear();
            compare(group, part);
            section.html += part.html;
            section.summary.insert(section.summary.end(), part.summary.begin(), part.summary.end());
        }
    return section;
}

}  // namespace raydix::report
