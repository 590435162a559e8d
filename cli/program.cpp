#include "program.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <exception>
#include <iostream>
#include <new>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "option_checks.h"

namespace raydix::cli {
namespace {

int report(std::string_view reason, int code = 1) {
    complain(reason);
    return code;
}

/// No file that the program opens takes the number of a standard stream that is closed: texts for
/// the stream would go into it.
void occupy_closed_streams() {
    int descriptor = 0;
    while (descriptor >= 0 && descriptor <= 2) descriptor = open("/dev/null", O_RDONLY);
    if (descriptor > 2) close(descriptor);
}

bool is_number(std::string_view text) {
    double value = 0;
    const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc() && rest == text.data() + text.size();
}

/// As CLI11 understands them: -.5 would be an option to it, and what follows --epo its number.
std::vector<std::string> words_of(int argc, char** argv) {
    std::vector<std::string> words(argv, argv + argc);
    for (std::size_t i = 1; i < words.size(); ++i) {
        std::string& word = words[i];
        const bool has_number = i + 1 < words.size() && is_number(words[i + 1]);
        if (word == "--epo" && !has_number) word = "--epo=1";
        if (word.starts_with("-.") && word.size() > 2 && word[2] >= '0' && word[2] <= '9')
            word.insert(1, "0");
    }
    return words;
}

/// "", or which word is no command, or no option, where a command is needed.
std::string unknown_command(const CLI::App& app, const std::vector<std::string>& words) {
    const CLI::App* at = &app;
    for (std::size_t i = 1; i < words.size() && at->get_require_subcommand_min() > 0; ++i) {
        if (words[i].starts_with("-")) {
            const std::string name = words[i].substr(0, words[i].find('='));
            if (at->get_option_no_throw(name) != nullptr) return {};
            return fmt::format("'{}' is not an option of {}; a command comes first", name,
                               at->get_name());
        }
        const std::vector<const CLI::App*> there =
            at->get_subcommands([](const CLI::App*) { return true; });
        const auto found = std::ranges::find(there, words[i], &CLI::App::get_name);
        if (found == there.end()) {
            if (at == &app) return fmt::format("'{}' is not a command", words[i]);
            std::string names;
            for (const CLI::App* one : there)
                names += (names.empty() ? "" : ", ") + one->get_name();
            return fmt::format("'{}' is not known to {}; there are {}", words[i], at->get_name(),
                               names);
        }
        at = *found;
    }
    return {};
}

/// 0 if only help or the version was asked for.
int usage(const CLI::App& app, const CLI::ParseError& error,
          const std::vector<std::string>& words) {
    if (error.get_exit_code() == 0) return app.exit(error);
    std::string fault = unknown_command(app, words);
    // CLI11 names these from the last to the first.
    if (fault.empty() && dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr)
        fault = fmt::format("not expected: {}", fmt::join(app.remaining(true), " "));
    return report((fault.empty() ? error.what() : fault) + "; run with --help for more information",
                  2);
}

}  // namespace

void complain(std::string_view reason) {
    std::string line = "raydix: ";
    for (const char c : reason) {
        const auto byte = static_cast<unsigned char>(c);
        line += byte < 0x20 || byte == 0x7F ? fmt::format("\\x{:02X}", byte) : std::string(1, c);
    }
    line += '\n';
    static_cast<void>(std::fputs(line.c_str(), stderr));
}

int run_program(CLI::App& app, int argc, char** argv) {
    occupy_closed_streams();
    const std::vector<std::string> words = words_of(argc, argv);
    std::vector<const char*> pointers;
    for (const std::string& word : words) pointers.push_back(word.c_str());
    app.parse_complete_callback([&app] { refuse_shared_files(app); });
    try {
        app.parse(argc, pointers.data());
    } catch (const CLI::ParseError& error) {
        if (usage(app, error, words) != 0) return 2;
    } catch (const std::bad_alloc&) {
        return report("not enough memory");
    } catch (const std::system_error& error) {
        // fmt calls standard output "file".
        const bool printing = std::string_view(error.what()).starts_with("cannot write to file");
        return report(printing ? "standard output: cannot be written: " + error.code().message()
                               : error.what());
    } catch (const std::exception& error) {
        return report(error.what());
    }
    // Tables are buffered: a full disk shows here, or did at an earlier flush.
    if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0 || !std::cout)
        return report(std::string("standard output: cannot be written: ") +
                      std::strerror(errno != 0 ? errno : EIO));
    return 0;
}

}  // namespace raydix::cli
