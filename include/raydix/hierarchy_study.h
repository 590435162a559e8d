// How the builders of the LBVH family scale, and the stages and trees around them: what their
// launches do, counted as they run; what they take on this machine; and models of how long machines
// of any size take for them (Karras 2012, section 5).
#pragma once

#include <raydix/bvh.h>
#include <raydix/mesh.h>

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace raydix {

/// Whose kernels a row of the study is made of.
enum class StudyForm {
    launches,   // ours, for any backend
    published,  // those of the source, where they differ from ours: K12's two kernels without
                // ranks, the counter of garanzha
    tuned       // ours for this processor alone; timed as a whole, nothing is counted
};
[[nodiscard]] std::string_view study_form_name(StudyForm form);

/// A row of the study.
struct StudyCase {
    std::string subject;  // codes, sort, karras, apetrei, garanzha, lauterbach, octree, kdtree
    StudyForm form = StudyForm::launches;
    Fit fit = Fit::as_published;  // of the four builders: levels or atomic

    [[nodiscard]] bool is_builder() const;  // one of the four
    [[nodiscard]] std::string name() const;
};
/// All there are.
[[nodiscard]] std::vector<StudyCase> study_cases();

/// One launch. All its items may run at once. The next launch waits for them.
struct LaunchFigures {
    std::string label;
    std::uint64_t items = 0;  // work items
    std::uint64_t bytes = 0;  // that they read and write, each access counted
    std::uint64_t steps = 0;  // accesses that wait for the one before them, of all items together
    std::uint32_t longest_chain = 0;  // steps of the item, or row of items, that has most of them
    double ms = 0;                    // on this machine, without counting: the median of all runs
};

/// What one case does over one input, as launches.
struct HierarchyRun {
    StudyCase what;
    int bits = 30, max_leaf = 1, threads = 1;
    std::uint32_t keys = 0;
    std::uint32_t inner_nodes = 0;  // of trees; of an octree all nodes
    std::uint32_t max_depth = 0;    // of BVHs and k-d trees
    std::vector<LaunchFigures> launches = {};
    std::vector<std::uint64_t> items_per_level =
        {};  // inner nodes at each depth, the root's first;
             // empty unless boxes are fitted by levels
    std::string digest =
        {};  // of a BVH: links, boxes and leaves in preorder; equal for equal trees
    std::string refusal = {};  // why the case does not run here, else empty

    /// Of all launches together.
    [[nodiscard]] double measured_ms() const;
};

struct StudyOptions {
    int bits = 30;
    int max_leaf = 1;
    int threads = 1;
    int repeat = 5;  // timed rounds behind one that warms up; each goes through all cases in turn
    std::vector<StudyCase> cases = study_cases();
};

/// Runs the cases over the triangles of each mesh or, if it has none, over its vertices. Launches
/// run on the CPU. With one thread their times are its processor time, else those of the clock on
/// the wall. Each round goes through all meshes, so that what slows the machine down for a while
/// slows all of them. Primitives that are not valid are left out; of no valid one there is nothing
/// to run. Throws InputError: a case that is none of study_cases, an index past the vertices,
/// options out of range.
[[nodiscard]] std::vector<std::vector<HierarchyRun>> study_hierarchies(
    std::span<const MeshView> meshes, const StudyOptions& options);
/// The same for one mesh.
[[nodiscard]] std::vector<HierarchyRun> study_hierarchy(const MeshView& mesh,
                                                        const StudyOptions& options);

/// What an item or a step of one kernel of one case takes on this machine with one thread. Measured
/// on inputs of several sizes.
struct KernelCost {
    struct Point {
        double keys, ns;
    };
    std::string kernel;         // "case: label"
    std::vector<Point> points;  // ascending by keys

    /// Between two sizes on a line over the logarithm of the size, beyond them the nearest.
    [[nodiscard]] double at(double keys) const;
};

/// This machine with one thread.
struct MeasuredCosts {
    double launch_us = 0;   // of an empty launch
    double latency_ns = 0;  // of one load that no cache holds
    std::vector<KernelCost> kernels;
    std::string origin;

    [[nodiscard]] const KernelCost* find(const std::string& kernel) const;
};

/// A sheet of about so many triangles, bent at random: what kernels are measured on. No scene of
/// the study is one.
[[nodiscard]] Mesh cost_sheet(std::uint32_t triangles, std::uint64_t seed);

/// Measures launches and latency, and takes the costs of kernels from runs over sheets of several
/// sizes with one thread.
[[nodiscard]] MeasuredCosts costs_of(std::span<const std::vector<HierarchyRun>> sheets);

/// Predicts one launch of `run` on `factor` times this machine: launch_us, and its work, (items +
/// steps) * the kernel's cost, over as many threads as there are items, `factor` at most; not less
/// than the longest chain takes. NaN for a kernel that was not measured.
[[nodiscard]] double predicted_ms(const HierarchyRun& run, const LaunchFigures& launch,
                                  const MeasuredCosts& costs, double factor = 1);
/// The sum over launches. NaN for factor > 1 if the case is tuned: nothing is known of its
/// launches.
[[nodiscard]] double predicted_ms(const HierarchyRun& run, const MeasuredCosts& costs,
                                  double factor = 1);

/// What the model knows of a machine that is not at hand. `lanes` items run at once. An item takes
/// `item_ns`, and `step_ns` for each of its steps. All items share `bytes_per_ns`. A step of the
/// longest chain waits `latency_ns` for memory.
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

/// Predicts the milliseconds that `machine` with `factor` times its lanes and bandwidth takes.
/// Launches run one after the other. Each takes launch_us and the largest of three times: (items *
/// item_ns + steps * step_ns) / lanes, bytes / bytes_per_ns, and longest_chain * latency_ns. NaN
/// for a tuned case.
[[nodiscard]] double predicted_ms(const HierarchyRun& run, const LaunchMachine& machine,
                                  double factor = 1);

}  // namespace raydix
