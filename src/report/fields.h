// Documents as the commands write them, read with suspicion: any field may be absent, null or of
// another kind than expected, and none of that is an error.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace raydix::report {

using Json = nlohmann::ordered_json;

struct Document {
    std::string name;  // of its file
    Json root;         // an object
    std::string command;
};

/// Throws InputError "NAME: reason": not JSON, nested too deep, not an object.
[[nodiscard]] Document parse_document(const std::string& name, std::string_view text);

/// value["a"]["b"] for "a.b"; null if it is not there.
[[nodiscard]] const Json& at(const Json& value, std::string_view path);
/// The elements of a list at `path` that are objects; none if there is no list.
[[nodiscard]] std::vector<const Json*> objects_at(const Json& value, std::string_view path);

[[nodiscard]] std::optional<double> number_at(const Json& value, std::string_view path);
/// Texts as they are, numbers and truth values as text; empty if absent.
[[nodiscard]] std::string text_at(const Json& value, std::string_view path);
/// The same with all digits of a number: texts that differ where the values do.
[[nodiscard]] std::string setting_at(const Json& value, std::string_view path);
/// All numbers of a list; what is none of them becomes NaN.
[[nodiscard]] std::vector<double> numbers_at(const Json& value, std::string_view path);

/// {median, min, max}, or one number that is all three.
struct SpreadFields {
    std::optional<double> median, min, max;
};
[[nodiscard]] SpreadFields spread_at(const Json& value, std::string_view path);

/// "AMD EPYC, 2 cores, avx512", with the GPU if there is one.
[[nodiscard]] std::string machine_text(const Document& document);

/// NaN for nothing, as the plots want it.
[[nodiscard]] double or_nan(std::optional<double> value);

}  // namespace raydix::report
