// How the builders of the LBVH family scale: what their launches do, counted as they run, and a
// model of how long machines of any size take for them (Karras 2012, section 5, "scaling").
#pragma once

#include <raydix/bvh.h>
#include <raydix/mesh.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace raydix {

/// One launch: all its items may run at once, and the next launch waits for them.
struct LaunchFigures {
    std::string label;
    std::uint64_t items = 0;  // work items
    std::uint64_t bytes = 0;  // read and written by them, each access counted
    std::uint64_t steps = 0;  // accesses that wait for the one before, of all items together
    std::uint32_t longest_chain = 0;  // the same of the item, or row of items, that waits longest
    double ms = 0;                    // on this machine, of a run that counts nothing; median
};

/// Hierarchy and boxes of one builder.
struct HierarchyRun {
    Builder builder = Builder::karras;
    Fit fit = Fit::as_published;
    int bits = 63, max_leaf = 1;
    std::uint32_t keys = 0, inner_nodes = 0, max_depth = 0;
    std::vector<LaunchFigures> launches;
    std::vector<std::uint64_t> items_per_level;  // inner nodes at each depth, the root's first
    std::string refusal;                         // why the builder does not run here, else empty

    [[nodiscard]] double measured_ms() const;
};

/// Runs hierarchy and box fitting of `options.builder` (one of the LBVH family) over the triangles
/// or points of `mesh`, once counting and `repeat` times for the time, as launches on the CPU with
/// options.threads threads. Throws InputError as build_bvh does.
[[nodiscard]] HierarchyRun study_hierarchy(const MeshView& mesh, const BuildOptions& options,
                                           int repeat);

/// What the model knows of a machine. `lanes` items run at once, each `step_ns` for a step and
/// `item_ns` for an item; all of them share `bytes_per_ns`; a step of the longest chain waits
/// `latency_ns` for memory.
struct LaunchMachine {
    std::string name;
    double lanes = 1;
    double item_ns = 1;
    double step_ns = 1;
    double bytes_per_ns = 1;
    double latency_ns = 100;
    double launch_us = 5;
    std::string origin;  // where the numbers are from
};

/// `gtx480` and `h200`.
[[nodiscard]] std::vector<LaunchMachine> study_machines();
/// This machine with `threads` threads (0: all): every figure measured now, on loops that are none
/// of the builders', in about a second.
[[nodiscard]] LaunchMachine measure_this_machine(int threads);

/// Milliseconds that `machine` with `factor` times its lanes and bandwidth would take: for each
/// launch launch_us + max(work, bytes, longest chain), launches one after the other.
[[nodiscard]] double predicted_ms(const HierarchyRun& run, const LaunchMachine& machine,
                                  double factor = 1);

}  // namespace raydix
