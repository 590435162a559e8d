// How the builders of the LBVH family scale: what their launches do, counted as they run, and a
// model of how long machines of any size take for them (Karras 2012, section 5).
#pragma once

#include <raydix/bvh.h>
#include <raydix/mesh.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace raydix {

/// One launch. All its items may run at once. The next launch waits for them.
struct LaunchFigures {
    std::string label;
    std::uint64_t items = 0;  // work items
    std::uint64_t bytes = 0;  // that they read and write, each access counted
    std::uint64_t steps = 0;  // accesses that wait for the one before them, of all items together
    std::uint32_t longest_chain = 0;  // steps of the item, or row of items, that has most of them
    double ms = 0;                    // on this machine, without counting: the median of all runs
};

/// The hierarchy and the boxes of one builder, as launches.
struct HierarchyRun {
    Builder builder = Builder::karras;
    Fit fit = Fit::as_published;
    int bits = 63, max_leaf = 1;
    std::uint32_t keys = 0, inner_nodes = 0, max_depth = 0;
    std::vector<LaunchFigures> launches;
    std::vector<std::uint64_t> items_per_level;  // inner nodes at each depth, the root's first;
                                                 // empty unless boxes are fitted by levels
    std::string refusal;                         // why the builder does not run here, else empty

    /// Of all launches together.
    [[nodiscard]] double measured_ms() const;
};

/// Runs the hierarchy and the box fitting of options.builder, one of the LBVH family, over the
/// triangles of `mesh` or, if it has none, over its vertices: once to count, once to warm up, and
/// `repeat` times to measure. They run as launches on the CPU, with options.threads threads.
/// Primitives that are not valid are left out; options.strict has no effect. Throws InputError: a
/// builder that is not of the LBVH family, any reinsertion rounds, a number that is no fit, an
/// index past the vertices, threads out of range.
[[nodiscard]] HierarchyRun study_hierarchy(const MeshView& mesh, const BuildOptions& options,
                                           int repeat);

/// What the model knows of a machine. `lanes` items run at once. An item takes `item_ns`, and
/// `step_ns` for each of its steps. All items share `bytes_per_ns`. A step of the longest chain
/// waits `latency_ns` for memory.
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

/// The machines `gtx480` and `h200`. `origin` says which of their figures are estimates.
[[nodiscard]] std::vector<LaunchMachine> study_machines();
/// Measures this machine with `threads` threads (0: all it has), in about a second. Its loops are
/// none of the builders'.
[[nodiscard]] LaunchMachine measure_this_machine(int threads);

/// Predicts the milliseconds that `machine` with `factor` times its lanes and bandwidth takes.
/// Launches run one after the other. Each takes launch_us and the largest of three times: (items *
/// item_ns + steps * step_ns) / lanes, bytes / bytes_per_ns, and longest_chain * latency_ns.
[[nodiscard]] double predicted_ms(const HierarchyRun& run, const LaunchMachine& machine,
                                  double factor = 1);

}  // namespace raydix
