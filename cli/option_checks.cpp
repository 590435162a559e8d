#include "option_checks.h"

#include <fmt/format.h>
#include <raydix/error.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

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

namespace {

/// A name of a file as given, and where.
struct NamedFile {
    std::string option, path;
    bool may_replace = false;  // what is read
};

bool is_one_of(const std::string& name, std::initializer_list<std::string_view> names) {
    return std::ranges::find(names, name) != names.end();
}

/// Pipes and devices take any number of results.
bool same_file(const std::string& a, const std::string& b) {
    namespace fs = std::filesystem;
    std::error_code error;
    if (fs::exists(a, error) && !fs::is_regular_file(a, error)) return false;
    if (fs::equivalent(a, b, error)) return true;
    return fs::weakly_canonical(fs::absolute(a, error), error) ==
           fs::weakly_canonical(fs::absolute(b, error), error);
}

void collect_files(const CLI::App& command, std::vector<NamedFile>& written,
                   std::vector<NamedFile>& read) {
    for (const CLI::Option* option : command.get_options()) {
        const std::string name = option->get_single_name();
        const bool output = is_one_of(name, {"output", "json", "hits", "save-rays", "state"});
        const bool input =
            option->get_positional() ||
            is_one_of(name, {"with", "queries", "rays", "cameras", "machine", "picture"});
        for (const std::string& file : option->results()) {
            if (file.empty() || file == "-") continue;
            if (output)
                written.push_back(
                    {"--" + name, file,
                     name == "state" || (name == "output" && command.get_name() == "build")});
            else if (input)
                read.push_back({option->get_positional() ? name : "--" + name, file});
        }
    }
    for (const CLI::App* chosen : command.get_subcommands()) collect_files(*chosen, written, read);
}

}  // namespace

void refuse_shared_files(const CLI::App& program) {
    std::vector<NamedFile> written, read;
    collect_files(program, written, read);
    for (std::size_t k = 0; k < written.size(); ++k) {
        const NamedFile& file = written[k];
        for (std::size_t other = 0; other < k; ++other)
            if (same_file(file.path, written[other].path))
                throw CLI::ValidationError(
                    file.option,
                    fmt::format("{} is the file of {} too", file.path, written[other].option));
        if (file.may_replace) continue;
        for (const NamedFile& source : read)
            if (same_file(file.path, source.path))
                throw CLI::ValidationError(
                    file.option,
                    fmt::format("would replace {}, which is read ({})", file.path, source.option));
    }
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
