// The warp simulator: traversal kernels of Aila and Laine 2009 and 2012 on a simulated SIMT
// machine. It says what rate a kernel could reach there if memory had no delay and, if asked, what
// memory would allow. All its rates are simulated (docs/simulator.md).
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

/// The kernels (docs/algorithms/warp-kernels.md).
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
    cwbvh,             // while-while over nodes of eight children (Ylitie, Karras, Laine 2017)
    short_stack,       // while-while with a stack of four entries and a restart trail (Laine 2010)
    persistent_cwbvh,  // cwbvh by persistent warps
    persistent_short_stack,  // short_stack by persistent warps
};
[[nodiscard]] std::span<const WarpKernel> warp_kernels();
/// Those of Aila and Laine alone: what `all` means to the program.
[[nodiscard]] std::span<const WarpKernel> warp_kernel_family();
[[nodiscard]] std::string_view warp_kernel_name(WarpKernel kernel);
/// Whether it reads the wide nodes of a WarpTree, and not its pairs.
[[nodiscard]] bool reads_wide_nodes(WarpKernel kernel);
/// Whether it has a stack of four entries and a trail, which is for trees of up to 64 levels.
[[nodiscard]] bool has_short_stack(WarpKernel kernel);
/// Throws InputError that lists the known names.
[[nodiscard]] WarpKernel warp_kernel_from_name(std::string_view name);

/// A tree of triangles in the form that the kernels read, as in Aila and Laine 2009: node pairs of
/// 64 bytes (`pair64`) and Woop's triangles of 48 bytes (`woop48`). If asked for, also as a
/// compressed wide tree: nodes of 80 bytes, which `cwbvh` kernels read and no others, with
/// triangles of their own. Holds all that the kernels read: the binary tree may go.
class WarpTree {
public:
    /// `wide_nodes`: also for kernels that read_wide_nodes. Throws InputError for a tree that holds
    /// boxes or points.
    explicit WarpTree(const Bvh& bvh, bool wide_nodes = false);
    ~WarpTree();
    WarpTree(WarpTree&&) noexcept;
    WarpTree& operator=(WarpTree&&) noexcept;

    [[nodiscard]] bool empty() const;
    [[nodiscard]] bool has_wide_nodes() const;  // false if it is empty
    [[nodiscard]] std::uint32_t max_depth() const;
    [[nodiscard]] std::uint64_t bytes() const;

    struct Arrays;
    [[nodiscard]] const Arrays& arrays() const { return *arrays_; }

private:
    std::unique_ptr<Arrays> arrays_;
};

/// The scalar reference for the kernels: finds closest hits with Woop's triangle test, one ray at a
/// time. rays [n] -> hits [n]. That test is not watertight: hits may differ from those of trace()
/// at edges and in the last bits. With `any_hit` a ray ends at the first hit it meets. `threads`: 0
/// to 1,024; 0: all the machine has. Throws InputError: sizes that differ, threads out of range.
void trace_reference(const WarpTree& tree, std::span<const Ray> rays, std::span<TreeHit> hits,
                     bool any_hit = false, int threads = 0);

/// How many native instructions one issue of an operation takes.
struct OperationCost {
    std::string operation;
    std::uint32_t instructions = 0;
    std::string origin;           // where the number comes from
    std::string kernel = {};      // empty: all kernels that have no cost of their own
    std::uint32_t most = 0;       // upper end of its range if it was derived; 0: not known
    std::uint32_t half_rate = 0;  // of the instructions, those that half of the lanes execute
};

/// When a block's place on a multiprocessor is free for another block.
enum class BlockRelease : std::uint32_t {
    own,       // when the block is done
    in_order,  // when the block and all that were started before it are done
    together,  // when all blocks on the machine are done
};
[[nodiscard]] std::span<const std::string_view> block_release_names();
[[nodiscard]] std::string_view block_release_name(BlockRelease release);

/// A SIMT machine. Rates are per clock and multiprocessor.
struct MachineModel {
    std::string name;
    std::string origin;  // where the figures come from
    std::uint32_t multiprocessors = 1;
    double clock_ghz = 1.0;
    double lanes_per_clock = 32;          // lane instructions issued; a warp of 32 takes 32 of them
    double warp_issue_clocks = 1;         // least clocks between two instructions of one warp
    double read_clocks = 0;               // that a warp waits for a node, a triangle or a ray
    double stack_read_clocks = 0;         // and for the stack of a thread, in local memory
    std::uint32_t resident_lanes = 1024;  // in flight
    std::uint32_t block_lanes = 128;      // of one block
    // What may keep a kernel below resident_lanes: 32-bit registers, bytes that blocks share. 0: no
    // limit. A kernel takes what it has on sm_90.
    std::uint32_t registers = 0, shared_bytes = 0;
    BlockRelease block_release = BlockRelease::own;
    // The memory model (docs/simulator.md). A transaction is a request by a quarter of a warp for
    // words of 16 bytes, and for 128 bytes of lines.
    double l1_transactions_per_clock = 1;
    double l2_gb_per_s = 100, dram_gb_per_s = 100;
    std::uint32_t l1_bytes = 16384;     // of each multiprocessor; 0: no cache holds data
    std::uint32_t l1_line_bytes = 128;  // a multiple of 32, at most 4,096
    std::uint32_t l1_shared_bytes = 0;  // L1 and what blocks share, together; 0: they are apart
    bool replays = false;  // further lines of one request are asked for by issuing it again
    std::uint32_t l2_bytes = 1u << 20;
    std::uint32_t texture_bytes = 0;       // of a texture cache, in lines of 32; 0: there is none
    std::uint32_t texture_sharers = 1;     // multiprocessors of one texture cache
    double texture_fetches_per_clock = 0;  // of 16 bytes a lane, of one multiprocessor; above 0
                                           // where there is a texture cache
    bool nodes_by_texture = true;          // where there are textures; triangles always are
    // Until a value is there, by what holds it.
    double texture_clocks = 0, l1_clocks = 0, l2_clocks = 0, dram_clocks = 0;
    std::vector<OperationCost> costs;  // of every operation: one for all kernels, or one for each
};

/// A machine by its name: `gtx285`, `gtx285_enum_popc`, `gtx480`, `gtx680`, `h100` or `h200`.
/// Throws InputError that lists the known names.
[[nodiscard]] MachineModel machine_model(std::string_view name);
[[nodiscard]] std::span<const std::string_view> machine_model_names();
/// Reads a JSON file with the fields of MachineModel. What it leaves out comes from the machine
/// that its "base" names. Without "base" it must have the fields that docs/simulator.md does not
/// let out. Throws InputError that names the file and the field: one that is missing, unknown or
/// out of range.
[[nodiscard]] MachineModel load_machine_model(const std::filesystem::path& file);

struct SimulateOptions {
    WarpKernel kernel = WarpKernel::while_while;
    MachineModel machine;
    int width = 32;        // lanes of a warp: 1, 2, 4, 8, 16, 32, 64 or 128
    bool any_hit = false;  // rays end at their first hit
    bool memory = false;   // also run the memory model
    // Which part of a launch the rays are, above 0 and at most 1: so large a part of the persistent
    // warps traces them. For the bound alone: the times of a part say nothing.
    double part_of_launch = 1.0;
};

/// How often an operation was issued, for how many lanes in all, and at what cost.
struct OperationFigure {
    std::string_view operation;
    std::uint64_t issues = 0, lanes = 0;
    std::uint32_t instructions = 0;
};

/// Figures of one launch, or the sums of several.
struct Simulation {
    std::uint64_t rays = 0, launches = 0, hits = 0;
    std::vector<OperationFigure> operations;
    std::uint64_t instructions = 0;       // issued, once for all lanes of a warp
    std::uint64_t lane_instructions = 0;  // of which active lanes made use
    double scheduled_clocks = 0;          // launches one after the other, with their tails
    double single_warp_clocks = 0;        // the same if warps went out one by one, not by blocks
    double free_block_clocks = 0;         // the same if a place were free when its block is done
    double idle_issues = 0;               // issue slots lost after the last ray or block was taken
    double issue_slots = 0;               // of all clocks of all launches
    // Times of warps in instructions: of a batch or, where rays are replaced, of a warp's whole
    // life. Bin k counts those in [2^(k / 64), 2^((k + 1) / 64)): 1.1 % wide.
    static constexpr std::size_t bins_per_octave = 64;
    std::array<std::uint64_t, 32 * bins_per_octave> warp_times{};
    // Of the memory model.
    std::uint64_t texture_fetches = 0, l1_transactions = 0, l2_bytes = 0, dram_bytes = 0;
    std::uint64_t replays = 0;
    double memory_wait_clocks = 0;  // of all warps

    void add(const Simulation& other);
};

/// Rates in Mrays/s, all simulated.
struct SimulatedRates {
    double bound = 0;      // the issue limit alone (docs/contract.md 7)
    double scheduled = 0;  // with the distribution of work and the tails of launches
    // The steps from `bound` to `scheduled`; equal to it where warps are persistent.
    double single_warps = 0;  // latency and tail: warps go out one by one
    double free_blocks = 0;   // then by whole blocks, to places that are free when a block is done
    // The lowest of `bound` and the memory limits, and which that is; 0 without the memory model.
    double memory = 0;
    std::string_view memory_limit = {};
    struct Limit {
        std::string_view name;  // "half_rate", "replays", "texture", "l1", "l2", "dram", "latency"
        double mrays_per_s;
    };
    std::vector<Limit> memory_limits = {};  // those that the machine has
    double simd_efficiency = 0;
};
[[nodiscard]] SimulatedRates simulated_rates(const Simulation& simulation,
                                             const SimulateOptions& options);

/// Simulates one launch of all rays for each of `runs`. rays [n] -> figures [runs] and, if `hits`
/// is not null, hits [runs][n]: those that the kernel itself found. Invalid rays miss. The figures
/// do not depend on the number of threads. Throws InputError: 2^31 - 1 rays or more; a kernel
/// that reads_wide_nodes and a tree without them; one that has_short_stack and a tree deeper than
/// 63; a width, kernel or part_of_launch out of range; a machine with a figure that is not
/// positive, without a cost for an operation, with a cost above its own `most`, with resident_lanes
/// that are no multiple of the width or fewer than block_lanes, with more than 2^24 lanes in
/// flight; for the memory model lines out of range, more than 2^30 bytes of caches, or 4 GiB or
/// more of tree, rays and hits.
[[nodiscard]] std::vector<Simulation> simulate(const WarpTree& tree, std::span<const Ray> rays,
                                               std::span<const SimulateOptions> runs,
                                               std::vector<std::vector<TreeHit>>* hits = nullptr,
                                               int threads = 0);

}  // namespace raydix
