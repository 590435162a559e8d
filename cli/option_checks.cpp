#include "option_checks.h"

#include <fmt/format.h>
#include <raydix/error.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <filesystem>
#include <system_error>

namespace raydix::cli {

CLI::Validator whole_number(std::uint64_t least, std::uint64_t most) {
    const bool open = most == std::numeric_limits<std::uint64_t>::max();
    const auto fault = [least, most](std::string& text) {
        std::uint64_t value = 0;
        const char* end = text.data() + text.size();
        const auto [rest, error] = std::from_chars(text.data(), end, value);
        if (error != std::errc() || rest != end || value < least || value > most)
            return fmt::format("'{}' is not a whole number from {} to {}", text, least, most);
        text = std::to_string(value);
        return std::string();
    };
    return {fault, open ? "NONNEGATIVE" : fmt::format("INT in [{} - {}]", least, most)};
}

bool is_given(const CLI::App& command, const char* name) {
    const CLI::Option* option = command.get_option_no_throw(name);
    return option != nullptr && option->count() != 0;
}

void refuse_given(const CLI::App& command, std::initializer_list<const char*> names,
                  const std::string& why) {
    for (const char* name : names)
        if (is_given(command, name)) throw CLI::ValidationError(name, why);
}

CLI::Validator file_name() {
    return CLI::Validator(
        [](const std::string& name) {
            return std::string(name.empty() ? "the name of the file is empty" : "");
        },
        "");
}

void require_writable(const std::string& file) {
    if (file.empty()) return;
    struct stat is;
    int error = 0;
    const std::filesystem::path path(file);
    const std::string folder = path.has_parent_path() ? path.parent_path().string() : ".";
    if (::stat(file.c_str(), &is) == 0) {
        // Pipes and devices show it when they are opened.
        if (S_ISDIR(is.st_mode)) error = EISDIR;
        if (S_ISREG(is.st_mode) && ::access(file.c_str(), W_OK) != 0) error = errno;
    } else if (::lstat(file.c_str(), &is) != 0 && ::access(folder.c_str(), W_OK | X_OK) != 0) {
        error = errno;
    }
    if (error != 0)
        throw InputError(file + ": cannot write: " + std::generic_category().message(error));
}

void require_picture(const std::string& file) {
    const std::string ending = CLI::detail::to_lower(std::filesystem::path(file).extension());
    if (!file.empty() && ending != ".png" && ending != ".exr")
        throw InputError(file + ": unknown picture type '" + ending + "'; known: .png .exr");
    require_writable(file);
}

}  // namespace raydix::cli
