#include "raydix.h"

#include <raydix/error.h>
#include <raydix/version.h>

#include <string>

#include "help_pages.h"
#include "options.h"
#include "program.h"

namespace raydix::cli {

int run_raydix(int argc, char** argv) {
    CLI::App app("raydix builds spatial trees in parallel and traces rays through them.", "raydix");
    app.set_version_flag("--version", std::string("raydix ") + raydix::version);
    app.require_subcommand(1);
    try {
        add_info_command(app);
        add_scenes_command(app);
        add_build_command(app);
        add_check_command(app);
        add_trace_command(app);
        add_render_command(app);
        add_query_command(app);
        add_simulate_command(app);
        add_bench_command(app);
        add_mpi_command(app);
        add_report_command(app);
        add_doctor_command(app);
        add_completion_command(app);
        add_man_command(app);
    } catch (const BackendUnavailable& error) {  // some options list what the processor can do
        complain(error.what());
        return 1;
    }
    group_options(app);
    return run_program(app, argc, argv);
}

}  // namespace raydix::cli
