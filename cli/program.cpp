#include "program.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <new>
#include <string>
#include <string_view>

namespace raydix::cli {
namespace {

/// One line, whatever the names of files hold.
int report(std::string_view reason, int code = 1) {
    std::string line = "raydix: ";
    for (const char c : reason) {
        const auto byte = static_cast<unsigned char>(c);
        line += byte < 0x20 || byte == 0x7F ? fmt::format("\\x{:02X}", byte) : std::string(1, c);
    }
    fmt::print(stderr, "{}\n", line);
    return code;
}

/// 0 if only help or the version was asked for.
int usage(const CLI::App& app, const CLI::ParseError& error, const char* first_word) {
    if (error.get_exit_code() == 0) return app.exit(error);
    const bool unknown = app.get_require_subcommand_min() > 0 && first_word != nullptr &&
                         first_word[0] != '-' &&
                         app.get_subcommands([&](const CLI::App* command) {
                                return command->get_name() == first_word;
                            })
                             .empty();
    const std::string reason =
        unknown ? fmt::format("'{}' is not a command", first_word) : error.what();
    return report(reason + "; run with --help for more information", 2);
}

}  // namespace

int run_program(CLI::App& app, int argc, char** argv) {
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        if (usage(app, error, argv[1]) != 0) return 2;
    } catch (const std::bad_alloc&) {
        return report("not enough memory");
    } catch (const std::exception& error) {
        return report(error.what());
    }
    // Tables are buffered: a full disk shows here.
    if (std::fflush(stdout) != 0)
        return report(std::string("standard output: cannot be written: ") + std::strerror(errno));
    return 0;
}

}  // namespace raydix::cli
