// Rows that share most of their settings -> short names that say what differs, and what all share.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace raydix::report {

struct Names {
    std::vector<std::string> each;
    std::string common;  // "63 bits, 2 threads"; empty if nothing is shared
};

/// parts [row][field], empty where a row has nothing to say. The field `always` is in every name.
[[nodiscard]] Names distinct_names(const std::vector<std::vector<std::string>>& parts,
                                   std::size_t always);

/// Adds to names that several rows have what stands beside them: [row].
void tell_apart(std::vector<std::string>& names, const std::vector<std::string>& beside);

/// "a", "a and b", "a, b and c".
[[nodiscard]] std::string listed(const std::vector<std::string>& names);

/// "1 thread", "2 threads".
[[nodiscard]] std::string counted(double count, const std::string& what);

}  // namespace raydix::report
