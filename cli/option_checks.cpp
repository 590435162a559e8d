#include "option_checks.h"

#include <fmt/format.h>
#include <raydix/error.h>
#include <raydix/files.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

#include "options.h"

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
    bool may_replace = false;  // a .rdx file that is read
    bool is_scene = false;     // with what load_model reads beside it
};

/// Behind PREFIX of --out, whatever the kind of query.
constexpr std::string_view endings_of_out[] = {
    "indices",   "distances", "offsets",          "points",          "uv",     "geometries",
    "instances", "pairs",     "pairs-geometries", "pairs-instances", "inside", "occluded",
    "prims",     "t"};

bool is_one_of(const std::string& name, std::initializer_list<std::string_view> names) {
    return std::ranges::find(names, name) != names.end();
}

/// What `file` leads to through links, also where nothing stands there yet.
std::filesystem::path followed(const std::string& file) {
    constexpr int max_links = 40;
    std::filesystem::path path = file;
    std::error_code error;
    for (int k = 0; k < max_links && std::filesystem::is_symlink(path, error); ++k) {
        const auto next = std::filesystem::read_symlink(path, error);
        if (error) break;
        path = path.parent_path() / next;  // an absolute `next` stands alone
    }
    return std::filesystem::absolute(path, error);
}

/// Pipes and devices take any number of results.
bool same_file(const std::string& a, const std::string& b) {
    namespace fs = std::filesystem;
    std::error_code error;
    if (fs::exists(a, error) && !fs::is_regular_file(a, error)) return false;
    if (fs::equivalent(a, b, error)) return true;
    return fs::weakly_canonical(followed(a), error) == fs::weakly_canonical(followed(b), error);
}

void collect_written(const CLI::App& command, const std::string& name, const std::string& file,
                     std::vector<NamedFile>& written) {
    const std::string option = "--" + name;
    if (name == "out") {
        for (const std::string_view ending : endings_of_out)
            written.push_back({option, fmt::format("{}.{}.npy", file, ending)});
        return;
    }
    written.push_back({option, file, name == "output" && command.get_name() == "build"});
    const CLI::Option* mode = command.get_option_no_throw("--mode");
    if (name == "hits" && mode != nullptr && mode->count() != 0 && mode->results().back() == "all")
        written.push_back({option, offsets_file(file)});
}

void collect_files(const CLI::App& command, std::vector<NamedFile>& written,
                   std::vector<NamedFile>& read) {
    for (const CLI::Option* option : command.get_options()) {
        const std::string name = option->get_single_name();
        const bool is_argument = option->get_positional();
        for (const std::string& file : option->results()) {
            if (file.empty() || file == "-") continue;
            if (is_one_of(name, {"output", "json", "hits", "save-rays", "state", "out"}))
                collect_written(command, name, file, written);
            else if (is_argument || is_one_of(name, {"with", "same", "queries", "rays", "cameras",
                                                     "machine", "picture"}))
                read.push_back({is_argument ? name : "--" + name, file, false,
                                is_argument ? name != "RESULT"
                                            : is_one_of(name, {"with", "same", "queries"})});
        }
    }
    for (const CLI::App* chosen : command.get_subcommands()) collect_files(*chosen, written, read);
}

/// Adds what scenes are read with. A file that is not there yet replaces none of these.
void add_files_of_scenes(const std::vector<NamedFile>& written, std::vector<NamedFile>& read) {
    const auto is_there = [](const NamedFile& file) {
        std::error_code error;
        return std::filesystem::is_regular_file(file.path, error);
    };
    if (std::ranges::none_of(written, is_there)) return;
    for (std::size_t k = 0, named = read.size(); k < named; ++k) {
        if (!read[k].is_scene || is_rdx(read[k].path)) continue;
        for (const std::filesystem::path& file : files_of_model(read[k].path))
            read.push_back({read[k].option, file.string()});
    }
}

}  // namespace

std::string offsets_file(const std::string& hits_file) {
    return std::filesystem::path(hits_file).replace_extension(".offsets.npy").string();
}

void refuse_shared_files(const CLI::App& program) {
    std::vector<NamedFile> written, read;
    collect_files(program, written, read);
    for (std::size_t k = 0; k < written.size(); ++k)
        for (std::size_t other = 0; other < k; ++other)
            if (same_file(written[k].path, written[other].path))
                throw CLI::ValidationError(written[k].option,
                                           fmt::format("{} is the file of {} too", written[k].path,
                                                       written[other].option));
    add_files_of_scenes(written, read);
    for (const NamedFile& file : written)
        for (const NamedFile& source : read)
            if (!(file.may_replace && is_rdx(source.path)) && same_file(file.path, source.path))
                throw CLI::ValidationError(
                    file.option,
                    fmt::format("would replace {}, which is read ({})", file.path, source.option));
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

}  // namespace raydix::cli
