// The raydix program. Exit code 0: done; 1: the input or the machine is at fault; 2: usage.
#include <fmt/format.h>
#include <raydix/version.h>

#include <CLI/CLI.hpp>
#include <exception>
#include <new>

#include "options.h"

namespace {

int report(const char* reason) {
    fmt::print(stderr, "raydix: {}\n", reason);
    return 1;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("raydix builds spatial trees in parallel and traces rays through them.", "raydix");
    app.set_version_flag("--version", std::string("raydix ") + raydix::version);
    app.require_subcommand(1);
    raydix::cli::add_info_command(app);
    raydix::cli::add_scenes_command(app);
    raydix::cli::add_build_command(app);
    raydix::cli::add_check_command(app);
    raydix::cli::add_trace_command(app);
    raydix::cli::add_render_command(app);
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : 2;
    } catch (const std::bad_alloc&) {
        return report("not enough memory");
    } catch (const std::exception& error) {
        return report(error.what());
    }
    return 0;
}
