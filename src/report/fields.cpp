#include "report/fields.h"

#include <fmt/format.h>
#include <raydix/error.h>

#include <cmath>
#include <limits>

#include "report/number_text.h"

namespace raydix::report {
namespace {

constexpr int deepest = 64;
const Json nothing;

}  // namespace

Document parse_document(const std::string& name, std::string_view text) {
    const auto limit_depth = [&](int depth, Json::parse_event_t, Json&) {
        if (depth > deepest)
            throw InputError(fmt::format("{}: JSON: nested deeper than {} levels", name, deepest));
        return true;
    };
    Document document{name, {}, {}};
    try {
        document.root = Json::parse(text.begin(), text.end(), limit_depth);
    } catch (const Json::parse_error& error) {
        throw InputError(fmt::format("{}: JSON: not valid at byte {}", name, error.byte));
    } catch (const Json::exception&) {
        throw InputError(name + ": JSON: a number is out of range");
    }
    if (!document.root.is_object())
        throw InputError(name + ": JSON: not an object, so not a result of a raydix command");
    document.command = text_at(document.root, "command");
    return document;
}

const Json& at(const Json& value, std::string_view path) {
    const Json* here = &value;
    while (!path.empty()) {
        const std::size_t dot = std::min(path.find('.'), path.size());
        if (!here->is_object()) return nothing;
        const auto found = here->find(std::string(path.substr(0, dot)));
        if (found == here->end()) return nothing;
        here = &*found;
        path.remove_prefix(std::min(dot + 1, path.size()));
    }
    return *here;
}

std::vector<const Json*> objects_at(const Json& value, std::string_view path) {
    std::vector<const Json*> objects;
    const Json& list = at(value, path);
    if (!list.is_array()) return objects;
    for (const Json& element : list)
        if (element.is_object()) objects.push_back(&element);
    return objects;
}

std::optional<double> number_at(const Json& value, std::string_view path) {
    const Json& field = at(value, path);
    if (!field.is_number()) return std::nullopt;
    const auto number = field.get<double>();
    return std::isfinite(number) ? std::optional(number) : std::nullopt;
}

std::string text_at(const Json& value, std::string_view path) {
    const Json& field = at(value, path);
    if (field.is_string()) return field.get<std::string>();
    if (field.is_boolean()) return field.get<bool>() ? "yes" : "no";
    if (field.is_number_integer()) return with_decimals(field.get<double>(), 0);
    return field.is_number() ? significant(field.get<double>(), 4) : "";
}

std::string setting_at(const Json& value, std::string_view path) {
    const Json& field = at(value, path);
    if (field.is_number_float()) return fmt::format("{}", field.get<double>());
    return field.is_number() ? field.dump() : text_at(value, path);
}

std::vector<double> numbers_at(const Json& value, std::string_view path) {
    std::vector<double> numbers;
    const Json& list = at(value, path);
    if (!list.is_array()) return numbers;
    for (const Json& element : list)
        numbers.push_back(element.is_number() ? element.get<double>()
                                              : std::numeric_limits<double>::quiet_NaN());
    return numbers;
}

SpreadFields spread_at(const Json& value, std::string_view path) {
    if (const auto one = number_at(value, path)) return {one, one, one};
    const Json& field = at(value, path);
    return {number_at(field, "median"), number_at(field, "min"), number_at(field, "max")};
}

std::string machine_text(const Document& document) {
    const Json& machine = at(document.root, "machine");
    std::string text = text_at(machine, "cpu");
    if (text.empty()) text = "a machine that it does not name";
    if (const auto cores = number_at(machine, "cores"))
        text += fmt::format(", {:.0f} {}", *cores, *cores == 1 ? "core" : "cores");
    for (const char* field : {"isa", "gpu"})
        if (const std::string part = text_at(machine, field); !part.empty()) text += ", " + part;
    return text;
}

double or_nan(std::optional<double> value) {
    return value.value_or(std::numeric_limits<double>::quiet_NaN());
}

}  // namespace raydix::report
