// Documents -> parts of the page, one function for each kind of question. A part for which no
// document has anything is empty.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "report/fields.h"
#include "report/names.h"
#include "report/page.h"

namespace raydix::report {

using Documents = std::vector<Document>;

/// The same name has the same colour all over the page.
class NameColours {
public:
    [[nodiscard]] int of(const std::string& name) {
        return numbers_.try_emplace(name, static_cast<int>(numbers_.size())).first->second;
    }

private:
    std::map<std::string, int> numbers_;
};

struct PageColours {
    NameColours builders, kernels, stages, operations;
};

/// Build times by stage and tree statistics.
[[nodiscard]] Section build_section(const Documents& documents, PageColours& colours);
/// Rates of rays through trees.
[[nodiscard]] Section trace_section(const Documents& documents);
/// Kernels on simulated machines.
[[nodiscard]] Section simulate_section(const Documents& documents, PageColours& colours);
/// Measured beside simulated and published; the paper's claims; widths.
[[nodiscard]] Section traversal_section(const Documents& documents, PageColours& colours);
/// Builders over sizes of scenes and machines.
[[nodiscard]] Section hierarchy_section(const Documents& documents, PageColours& colours);
/// Queries over MPI ranks, counted and modelled.
[[nodiscard]] Section ranks_section(const Documents& documents);
/// Documents of one command against the first of them.
[[nodiscard]] Section compare_section(const Documents& documents);
/// What `info` and `check` found.
[[nodiscard]] Section scene_section(const Documents& documents);
/// What no other part shows, as plain tables.
[[nodiscard]] Section other_section(const Documents& documents);
/// Which documents the page is made from.
[[nodiscard]] Section sources_section(const Documents& documents);

/// "builtin:figure" of a document or of a row in it; "a scene without a name" if it has none.
[[nodiscard]] std::string scene_name(const Json& holder);

/// What a tree was built with, beside its builder: bits, leaves, rounds of reinsertion, costs of
/// the SAH. Texts to put beside each other, empty where a build says nothing or does what is usual.
[[nodiscard]] std::vector<std::string> tree_settings(const Json& build);

/// `<strong>` around escaped text, for sentences.
[[nodiscard]] std::string strong(const std::string& text);
/// The same with a number: "3.02 ms", never broken between the two.
[[nodiscard]] std::string strong(const std::string& number, const std::string& unit);

}  // namespace raydix::report
