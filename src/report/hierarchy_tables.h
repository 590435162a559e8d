// A document of `bench hierarchy` as plain structs, and its tables.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "report/fields.h"

namespace raydix::report {

/// One builder, one way to fit boxes, one scene, one number of threads.
struct StudyRun {
    std::string scene, builder, form, fit, refusal;
    bool size_series = false;
    std::optional<double> keys, bits, threads, inner_nodes, depth;
    std::optional<double> measured, predicted;                  // ms, here
    std::map<std::string, std::vector<double>> simulated = {};  // machine -> ms for each factor
    std::vector<double> levels = {};                            // nodes on each
    std::vector<const Json*> launches = {};
    std::string worst = {};  // the kernel that the prediction misses by most

    [[nodiscard]] bool by_levels() const { return fit == "levels"; }
    /// Of a BVH: codes, sorts and other trees are no rivals of it.
    [[nodiscard]] bool is_builder() const { return !fit.empty(); }
    /// Not for this processor alone: its launches are known.
    [[nodiscard]] bool scales() const { return form != "tuned"; }
    [[nodiscard]] std::optional<double> error() const;
    /// "karras, published, boxes in one pass"
    [[nodiscard]] std::string name() const;
    /// From the smallest machine to the largest.
    [[nodiscard]] std::optional<double> speed_up(const std::string& machine) const;
};

/// The runs over one scene with codes of one length.
struct StudyScene {
    std::string scene;
    std::optional<double> keys, bits;
    std::vector<const StudyRun*> all;
    std::vector<const StudyRun*> one_each;  // without repeats for other numbers of threads

    [[nodiscard]] std::string title() const;
    [[nodiscard]] std::vector<std::string> machines() const;
};

/// "gtx480", and the first factor behind it where that is not 1.
[[nodiscard]] std::string times_machine(const std::string& machine,
                                        const std::vector<double>& factors);

/// Refers to the document.
struct Study {
    explicit Study(const Document& source);
    const Document* document;
    std::vector<double> factors;
    std::vector<StudyRun> runs;

    [[nodiscard]] std::vector<StudyScene> scenes() const;
};

/// All runs, whole builds, launches by label, and the constants of the machines.
[[nodiscard]] std::string study_tables(const Study& study);

}  // namespace raydix::report
