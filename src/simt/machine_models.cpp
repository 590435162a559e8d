// Machines by name. Cores and clocks are the makers' figures; lanes in flight follow from what the
// kernels of Aila and Laine's release launch or may keep resident; latencies and cache rates are
// estimates, and say so.
#include <raydix/error.h>
#include <raydix/simulate.h>

#include <array>
#include <string>

#include "simt/cost_model.h"

namespace raydix {
namespace {

MachineModel gtx285() {
    MachineModel m;
    m.name = "gtx285";
    m.origin =
        "30 multiprocessors of 8 lanes at 1.476 GHz, 159 GB/s: Aila and Laine 2009; 720 persistent "
        "warps, blocks of 192: their release; 22 clocks between dependent instructions, 400 to 600 "
        "for a read, with texture caches no less, and for local memory, which has no cache: CUDA C "
        "Programming Guide 4.2 and Best Practices Guide; blocks that end in order: what the "
        "Fermi white paper says is new there; 6 to 8 KB of texture cache for each multiprocessor, "
        "shared by three: Programming Guide; 80 texture units at 0.648 GHz: the maker's figures; "
        "261 clocks for a hit there, 371 in the second cache of 256 KB: Wong et al. 2010; rate of "
        "the second cache: an estimate; 16 KB of shared memory: Programming Guide";
    m.multiprocessors = 30;
    m.clock_ghz = 1.476;
    m.lanes_per_clock = 8;
    m.warp_issue_clocks = 22;
    m.read_clocks = 500;
    m.stack_read_clocks = 500;
    m.block_release = BlockRelease::in_order;
    m.resident_lanes = 768;
    m.block_lanes = 192;
    m.shared_bytes = 16 * 1024;
    m.l1_bytes = 0;
    m.l2_gb_per_s = 300;
    m.l2_bytes = 256 * 1024;
    m.texture_bytes = 3 * 8 * 1024;
    m.texture_sharers = 3;
    m.texture_fetches_per_clock = 80 * 0.648 / (30 * 1.476);
    m.texture_clocks = 261;
    m.l2_clocks = 371;
    m.dram_clocks = 500;
    m.dram_gb_per_s = 159;
    m.costs = gt200_costs();
    return m;
}

MachineModel gtx285_enum_popc() {
    MachineModel m = gtx285();
    m.name = "gtx285_enum_popc";
    m.origin += "; with the ENUM and POPC instructions that the paper wishes for";
    m.costs = gt200_enum_popc_costs();
    return m;
}

MachineModel gtx480() {
    MachineModel m;
    m.name = "gtx480";
    m.origin =
        "15 multiprocessors of 32 lanes at 1.401 GHz, 177 GB/s: Karras 2012; blocks of 128: Aila "
        "and Laine's release; 8 blocks in flight: Fermi's limit; 22 clocks between dependent "
        "instructions: CUDA C Programming Guide 4.2; blocks that end out of order: Fermi white "
        "paper; 48 KB of L1 of 64 KB that it shares with blocks, a line of 128 bytes in two "
        "clocks, further lines of a request issued again: Programming Guide 4.2, F.4; nodes "
        "through it, triangles by texture: their release; "
        "12 KB of texture cache, four texture units at half the clock, 768 KB of L2: white paper; "
        "300 clocks for a read, clocks of each cache, rate of L2: estimates";
    m.multiprocessors = 15;
    m.clock_ghz = 1.401;
    m.lanes_per_clock = 32;
    m.warp_issue_clocks = 22;
    m.read_clocks = 300;
    m.resident_lanes = 1024;
    m.block_lanes = 128;
    m.shared_bytes = 48 * 1024;
    m.l1_shared_bytes = 64 * 1024;
    m.l1_transactions_per_clock = 0.5;
    m.l1_bytes = 48 * 1024;
    m.l2_gb_per_s = 230;
    m.l2_bytes = 768 * 1024;
    m.texture_bytes = 12 * 1024;
    m.texture_fetches_per_clock = 2;
    m.nodes_by_texture = false;
    m.replays = true;
    m.l1_clocks = 45;
    m.texture_clocks = 220;
    m.l2_clocks = 310;
    m.dram_clocks = 600;
    m.dram_gb_per_s = 177;
    m.costs = fermi_costs();
    return m;
}

MachineModel gtx680() {
    MachineModel m;
    m.name = "gtx680";
    m.origin =
        "8 multiprocessors of 192 lanes at 1.006 GHz: the maker's figures; all lanes busy, which "
        "takes dual issue on each clock; 192 GB/s; 2048 lanes in flight: Kepler's limit; 11 "
        "clocks between dependent instructions, 200 to 400 for a read from memory, up to 48 KB of "
        "texture cache: CUDA C Programming Guide 4.2; nodes and triangles by texture: Aila and "
        "Laine's release; 16 texture units, 512 bytes a clock of L2: the maker's figures; 105 "
        "clocks for a hit in a texture cache, those of L1 and L2: estimates";
    m.multiprocessors = 8;
    m.clock_ghz = 1.006;
    m.lanes_per_clock = 192;
    m.warp_issue_clocks = 11;
    m.read_clocks = 105;
    m.resident_lanes = 2048;
    m.block_lanes = 128;
    m.shared_bytes = 48 * 1024;
    m.l1_shared_bytes = 64 * 1024;
    m.l1_transactions_per_clock = 1;
    m.l1_bytes = 48 * 1024;
    m.l2_gb_per_s = 512;
    m.l2_bytes = 512 * 1024;
    m.texture_bytes = 48 * 1024;
    m.texture_fetches_per_clock = 16;
    m.replays = true;
    m.l1_clocks = 33;
    m.texture_clocks = 105;
    m.l2_clocks = 200;
    m.dram_clocks = 300;
    m.dram_gb_per_s = 192;
    m.costs = kepler_costs();
    return m;
}

MachineModel h200() {
    MachineModel m;
    m.name = "h200";
    m.origin =
        "132 multiprocessors of 128 lanes at 1.98 GHz, 4.8 TB/s, 50 MB of L2, 256 KB of L1 of "
        "which blocks take up to 228, 65,536 registers, 2048 lanes in flight: the maker's figures; "
        "integer instructions, comparisons and minima at half the rate: CUDA C++ Programming "
        "Guide; 128 bytes of L1 a clock in sectors of 32, of up to four lines: NVIDIA's developer "
        "forum, on Volta; 4 clocks between dependent instructions, 33 for a read, rate of L2 and "
        "clocks: "
        "estimates";
    m.multiprocessors = 132;
    m.clock_ghz = 1.98;
    m.lanes_per_clock = 128;
    m.warp_issue_clocks = 4;
    m.read_clocks = 33;
    m.resident_lanes = 2048;
    m.block_lanes = 128;
    m.registers = 65'536;
    m.shared_bytes = 228 * 1024;
    m.l1_shared_bytes = 256 * 1024;
    m.l1_transactions_per_clock = 1;
    m.l1_bytes = 256 * 1024;
    m.l1_line_bytes = 32;
    m.l1_clocks = 33;
    m.l2_clocks = 260;
    m.dram_clocks = 560;
    m.l2_gb_per_s = 5500;
    m.l2_bytes = 50u << 20;
    m.dram_gb_per_s = 4800;
    m.costs = sm90_costs();
    return m;
}

/// The same multiprocessors behind slower memory.
MachineModel h100() {
    MachineModel m = h200();
    m.name = "h100";
    m.origin = "h200 with memory of 3.35 TB/s: " + m.origin;
    m.dram_gb_per_s = 3350;
    return m;
}

struct Named {
    std::string_view name;
    MachineModel (*make)();
};
constexpr std::array models{Named{"gtx285", gtx285}, Named{"gtx285_enum_popc", gtx285_enum_popc},
                            Named{"gtx480", gtx480}, Named{"gtx680", gtx680},
                            Named{"h100", h100},     Named{"h200", h200}};

}  // namespace

std::span<const std::string_view> machine_model_names() {
    static const auto all = [] {
        std::array<std::string_view, models.size()> names_of;
        for (std::size_t k = 0; k < names_of.size(); ++k) names_of[k] = models[k].name;
        return names_of;
    }();
    return all;
}

MachineModel machine_model(std::string_view name) {
    std::string known;
    for (const Named& model : models) {
        if (model.name == name) return model.make();
        known += (known.empty() ? "" : ", ") + std::string(model.name);
    }
    throw InputError("machine '" + std::string(name) + "' is not known; there are " + known);
}

}  // namespace raydix
