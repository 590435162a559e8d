// The raydix program.
#include <raydix/version.h>

#include <string>

#include "options.h"
#include "program.h"

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
    raydix::cli::add_query_command(app);
    raydix::cli::add_simulate_command(app);
    raydix::cli::add_bench_command(app);
    raydix::cli::add_report_command(app);
    return raydix::cli::run_program(app, argc, argv);
}
