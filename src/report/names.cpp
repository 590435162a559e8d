#include "report/names.h"

#include <algorithm>

#include "report/number_text.h"

namespace raydix::report {
namespace {

void append(std::string& list, const std::string& part) {
    if (part.empty()) return;
    if (!list.empty()) list += ", ";
    list += part;
}

}  // namespace

Names distinct_names(const std::vector<std::vector<std::string>>& parts, std::size_t always) {
    Names names;
    names.each.resize(parts.size());
    std::size_t fields = 0;
    for (const auto& row : parts) fields = std::max(fields, row.size());
    const auto part = [&](std::size_t row, std::size_t field) {
        return field < parts[row].size() ? parts[row][field] : std::string();
    };
    for (std::size_t field = 0; field < fields; ++field) {
        bool shared = field != always;
        for (std::size_t row = 1; row < parts.size(); ++row)
            shared = shared && part(row, field) == part(0, field);
        if (shared) append(names.common, part(0, field));
        for (std::size_t row = 0; row < parts.size() && !shared; ++row)
            append(names.each[row], part(row, field));
    }
    for (std::string& name : names.each)
        if (name.empty()) name = "without a name";
    return names;
}

void tell_apart(std::vector<std::string>& names, const std::vector<std::string>& beside) {
    const std::vector<std::string> before = names;
    for (std::size_t i = 0; i < names.size(); ++i)
        if (std::ranges::count(before, before[i]) > 1) append(names[i], beside[i]);
}

std::string listed(const std::vector<std::string>& names) {
    std::string text;
    for (std::size_t i = 0; i < names.size(); ++i) {
        if (i != 0) text += i + 1 == names.size() ? " and " : ", ";
        text += names[i];
    }
    return text;
}

std::string counted(double count, const std::string& what) {
    return with_decimals(count, 0) + " " + what + (count == 1 ? "" : "s");
}

}  // namespace raydix::report
