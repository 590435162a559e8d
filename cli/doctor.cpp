// raydix doctor: what this machine offers to the library, and what that means.
#include <fmt/format.h>
#include <raydix/device.h>
#include <raydix/machine.h>

#include <array>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "options.h"
#include "other_program.h"
#include "output.h"

namespace raydix::cli {
namespace {

struct Finding {
    std::string what, found, meaning;
};

/// The word in brackets of the system's file, or "" without one.
std::string transparent_huge_pages() {
    std::ifstream file("/sys/kernel/mm/transparent_hugepage/enabled");
    std::string line;
    std::getline(file, line);
    const auto from = line.find('['), to = line.find(']');
    return from < to && to != std::string::npos ? line.substr(from + 1, to - from - 1)
                                                : std::string();
}

std::string meaning_of_huge_pages(const std::string& mode) {
    if (mode == "always" || mode == "madvise") return "large arrays lie in large pages";
    if (mode == "never") return "large arrays lie in pages of 4 KB: large scenes trace slower";
    return "the system does not tell";
}

std::string meaning_of_isa(const std::string& isa) {
    if (isa == "avx512") return "rays go through the widest kernels";
    if (isa == "avx2") return "rays go through kernels of 8 lanes; avx512 would have 16";
    return "rays go through kernels of 4 lanes, the oldest that there are";
}

std::string meaning_of(const DeviceDescription& device) {
    if (!device.missing.empty()) return "not used: " + device.missing;
    return "can be used: --device " + device.selector;
}

std::vector<Finding> examine() {
    const MachineInfo machine = machine_info();
    const std::string pages = transparent_huge_pages();
    std::vector<Finding> all = {
        {"processor", machine.cpu, "what --device cpu runs on"},
        {"instruction set", machine.isa, meaning_of_isa(machine.isa)},
        {"threads", std::to_string(machine.cores),
         "so many run at most, unless --threads says less"},
        {"huge pages", pages.empty() ? "unknown" : pages, meaning_of_huge_pages(pages)},
    };
    for (const DeviceDescription& device : list_devices())
        all.push_back(
            {"device " + device.selector,
             device.name.empty()
                 ? "none"
                 : device.name + (device.driver.empty() ? "" : ", driver " + device.driver),
             meaning_of(device)});
    for (const auto& [what, program, use] :
         {std::array{"MPI", "raydix_mpi", "mpirun -n N raydix mpi"},
          std::array{"Embree", "bench_cpu", "raydix bench cpu and bench scene"},
          std::array{"nanoflann", "bench_points", "raydix bench points"}}) {
        const bool there = !program_beside(program).empty();
        all.push_back({what, there ? "built in" : "none",
                       there ? std::string(use) + " can be used"
                             : std::string(use) + " cannot: " + program + " was not built"});
    }
    return all;
}

Json devices_json() {
    Json devices = Json::array();
    for (const DeviceDescription& d : list_devices())
        devices.push_back({{"selector", d.selector},
                           {"name", d.name},
                           {"driver", d.driver},
                           {"usable", d.missing.empty()},
                           {"missing", d.missing}});
    return devices;
}

void run_doctor(const CommonOptions& common) {
    const std::vector<Finding> findings = examine();
    Json document = new_document("doctor");
    for (const Finding& f : findings)
        document["findings"].push_back(
            {{"what", f.what}, {"found", f.found}, {"meaning", f.meaning}});
    document["devices"] = devices_json();
    if (common.prints_tables())
        for (const Finding& f : findings)
            fmt::print("{:<16} {}\n{:<16}   {}\n", f.what, f.found, "", f.meaning);
    write_json(document, common);
}

}  // namespace

void add_doctor_command(CLI::App& app) {
    auto common = std::make_shared<CommonOptions>();
    CLI::App* command =
        app.add_subcommand("doctor", "What this machine offers, and what that means");
    add_common_options(*command, *common);
    command->callback([common] { run_doctor(*common); });
}

}  // namespace raydix::cli
