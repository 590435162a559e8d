// The warp simulator: traversal kernels of Aila and Laine 2009 on a simulated SIMT machine, which
// says what the kernel could reach there if memory were infinitely fast. All its rates are
// simulated ones.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace raydix {

enum class WarpKernel : std::uint32_t {
    packet,
    while_while,
    if_if,
    speculative_while_while,
    persistent_packet,
    persistent_while_while,
    persistent_if_if,
    persistent_speculative_while_while,
    ray_replacement,
    work_queue,
    dynamic_fetch,
};
[[nodiscard]] std::span<const WarpKernel> warp_kernels();
[[nodiscard]] std::string_view warp_kernel_name(WarpKernel kernel);
/// Throws InputError that lists the known names.
[[nodiscard]] WarpKernel warp_kernel_from_name(std::string_view name);

/// A tree of triangles in the form that the kernels read: node pairs of 64 bytes (`pair64`) and
/// Woop's triangles of 48 bytes (`woop48`), as in Aila and Laine 2009.
class WarpTree {
public:
    /// Throws InputError if the tree holds boxes or points.
    explicit WarpTree(const Bvh& bvh);
    ~WarpTree();
    WarpTree(WarpTree&&) noexcept;
    WarpTree& operator=(WarpTree&&) noexcept;

    [[nodiscard]] bool empty() const;
    [[nodiscard]] std::uint32_t max_depth() const;
    [[nodiscard]] std::uint64_t bytes() const;

    struct Arrays;
    [[nodiscard]] const Arrays& arrays() const { return *arrays_; }

private:
    std::unique_ptr<Arrays> arrays_;
};

/// The scalar reference: closest hits with Woop's triangle test, one ray at a time. Not the
/// library's watertight test: hits may differ from trace() at edges and in the last bits.
/// rays [n] -> hits [n].
void trace_reference(const WarpTree& tree, std::span<const Ray> rays, std::span<TreeHit> hits,
                     bool any_hit = false, int threads = 0);

/// Native instructions that one issue of an operation takes.
struct OperationCost {
    std::string operation;
    std::uint32_t instructions = 0;
    std::string origin;       // where the number comes from
    std::string kernel = {};  // empty: in all kernels that have no count of their own
};

/// A SIMT machine. Rates are per clock and multiprocessor.
struct MachineModel {
    std::string name;
    std::string origin;  // where the figures come from
    std::uint32_t multiprocessors = 1;
    double clock_ghz = 1.0;
    double lanes_per_clock = 32;          // lane instructions issued; a warp of 32 takes 32 of them
    double warp_issue_clocks = 1;         // least clocks between two instructions of one warp
    std::uint32_t resident_lanes = 1024;  // in flight
    std::uint32_t block_lanes = 128;      // of one block; a block's place is free when all are done
    // The memory model: a transaction brings up to 16 bytes a lane from one 128-byte line.
    double l1_transactions_per_clock = 1;
    double l2_gb_per_s = 100, dram_gb_per_s = 100;
    std::uint32_t l1_bytes = 16384;  // of each multiprocessor
    std::uint32_t l2_bytes = 1u << 20;
    std::vector<OperationCost> costs;  // every operation once, or once for each kernel
};

/// `gtx285`, `gtx285_enum_popc`, `gtx480`, `gtx680`, `h200`. Throws InputError that lists them.
[[nodiscard]] MachineModel machine_model(std::string_view name);
[[nodiscard]] std::span<const std::string_view> machine_model_names();
/// A JSON file with the fields of MachineModel; what it leaves out comes from the machine that its
/// "base" names. Throws InputError that names the file and the field.
[[nodiscard]] MachineModel load_machine_model(const std::filesystem::path& file);

struct SimulateOptions {
    WarpKernel kernel = WarpKernel::while_while;
    MachineModel machine;
    int width = 32;        // lanes of a warp: 1, 2, 4, 8, 16, 32 or 64
    bool any_hit = false;  // rays end at their first hit
    bool memory = false;   // also run the memory model
    // The rays are this part of a launch: as many of the persistent warps trace them. Matters to
    // the bound only; times of a part say nothing.
    double part_of_launch = 1.0;
};

/// How often an operation was issued, for how many lanes in sum, and at what cost.
struct OperationFigure {
    std::string_view operation;
    std::uint64_t issues = 0, lanes = 0;
    std::uint32_t instructions = 0;
};

/// Figures of one or more launches; those of several add up.
struct Simulation {
    std::uint64_t rays = 0, launches = 0, hits = 0;
    std::vector<OperationFigure> operations;
    std::uint64_t instructions = 0;       // issued, once for all lanes of a warp
    std::uint64_t lane_instructions = 0;  // of which active lanes made use
    double scheduled_clocks = 0;          // launches one after the other, with their tails
    double idle_issues = 0;               // lost after the last ray or block was handed out
    double issue_slots = 0;               // of all clocks of all launches
    // Warp execution times in instructions: of a batch, or of a warp's life where rays are
    // replaced. Bin k of 8 an octave: [2^(k / 8), 2^((k + 1) / 8)).
    std::array<std::uint64_t, 256> warp_times{};
    std::uint64_t l1_transactions = 0, l2_bytes = 0, dram_bytes = 0;  // of the memory model

    void add(const Simulation& other);
};

/// Rates in Mrays/s, all simulated.
struct SimulatedRates {
    double bound = 0;      // the issue limit alone (docs/contract.md 7)
    double scheduled = 0;  // with the distribution of work and the tails of launches
    double memory = 0;     // the lower of `bound` and the memory limits; 0 without the memory model
    double simd_efficiency = 0;
};
[[nodiscard]] SimulatedRates simulated_rates(const Simulation& simulation,
                                             const SimulateOptions& options);

/// Runs one launch through each of `runs`. rays [n] -> hits [runs][n]. Every ray is traced by the
/// kernel itself; hits are its hits. The same figures for every thread count. Throws InputError: an
/// unknown width, a machine without a cost for an operation, a rate that is not positive.
[[nodiscard]] std::vector<Simulation> simulate(const WarpTree& tree, std::span<const Ray> rays,
                                               std::span<const SimulateOptions> runs,
                                               std::vector<std::vector<TreeHit>>* hits = nullptr,
                                               int threads = 0);

}  // namespace raydix
