// Instantiates the kernels for simulated warps of one width and one instruction set.
// RAYDIX_SIMULATOR_ISA names the latter; all that is compiled here carries it in its name.
#pragma once

#include <array>
#include <cstddef>
#include <new>
#include <type_traits>

#include "trace/warp/kernel_list.h"
#include "trace/warp/simulated_kernels.h"

namespace raydix {

template <class Isa, int Width>
const SimulatedKernel* simulated_kernel_of_width(WarpKernel kernel, bool any_hit);
template <class Isa>
TraceOneByOne* one_by_one_of(bool any_hit);

namespace simulator_isa {
struct base;
struct v3;
}  // namespace simulator_isa

template <class Kernel, bool any_hit, int Width, class Isa>
struct SimulatedKernelOf {
    using OneLane = typename LaneOf<Kernel>::Type;
    using Warp = SimulatedWarp<OneLane, Width, Isa>;
    static constexpr std::size_t stacks = Kernel::rays_per_lane * std::size_t{Width};
    struct Spares {
        std::array<OneLane, Width> lanes;
        std::array<std::uint32_t, Width> slots;
    };
    static_assert(sizeof(Kernel) <= sizeof(KernelState) && alignof(Kernel) <= alignof(KernelState));
    static_assert(std::is_trivially_destructible_v<Warp> &&
                  std::is_trivially_destructible_v<Kernel>);

    static std::size_t rounded(std::size_t bytes) { return (bytes + 63) / 64 * 64; }
    static std::size_t shared_bytes(std::uint32_t stack_entries) {
        if (Kernel::one_stack) return rounded(stack_entries * sizeof(std::int32_t));
        return Kernel::rays_per_lane == 2 ? rounded(sizeof(Spares)) : 0;
    }
    static std::size_t warp_bytes(std::uint32_t stack_entries) {
        return rounded(sizeof(Warp)) + shared_bytes(stack_entries) +
               (Kernel::one_stack ? 0 : rounded(stacks * stack_entries * sizeof(std::int32_t)));
    }
    static void start_warp(std::byte* memory, const WarpSetup& setup) {
        Warp& warp = *new (memory) Warp{};
        warp.tally = setup.tally;
        warp.observer = setup.observer;
        std::byte* shared = memory + rounded(sizeof(Warp));
        if (Kernel::one_stack) {
            warp.memory.packet_stack = reinterpret_cast<std::int32_t*>(shared);
            return;
        }
        auto* stack = reinterpret_cast<std::int32_t*>(shared + shared_bytes(setup.stack_entries));
        for (OneLane& lane : warp.lanes) {
            lane.stack = stack;
            stack += setup.stack_entries;
        }
        if (Kernel::rays_per_lane == 1) return;
        warp.stacks_travel = true;
        Spares& spares = *new (shared) Spares{};
        warp.memory.spares = spares.lanes.data();
        warp.memory.slots = spares.slots.data();
        for (OneLane& lane : spares.lanes) {
            lane.stack = stack;
            stack += setup.stack_entries;
        }
    }
    static void start_kernel(KernelState& state) { new (&state) Kernel{}; }
    static bool turn(std::byte* memory, KernelState& state, const WarpJob& job,
                     std::uint32_t warp_index) {
        Warp& warp = *std::launder(reinterpret_cast<Warp*>(memory));
        Kernel& kernel = *std::launder(reinterpret_cast<Kernel*>(&state));
        return kernel.template turn<any_hit>(warp, job, warp_index);
    }
    static bool next_batch(std::byte* memory, KernelState& state, const WarpJob& job,
                           std::uint32_t& batch) {
        if constexpr (Kernel::persistent && !Kernel::keeps_rays) {
            Warp& warp = *std::launder(reinterpret_cast<Warp*>(memory));
            Kernel& kernel = *std::launder(reinterpret_cast<Kernel*>(&state));
            if (!kernel.fetch(warp, job.launch)) return false;
            batch = kernel.next / Warp::width();
            kernel.next += Warp::width();
            return true;
        }
        return false;
    }
    static constexpr SimulatedKernel table{
        Kernel::persistent,
        Kernel::keeps_rays,
        !Kernel::one_stack && !stack_in_registers<Kernel>,
        Kernel::rays_per_lane == 2,
        &warp_bytes,
        &start_warp,
        &start_kernel,
        &turn,
        Kernel::persistent && !Kernel::keeps_rays ? &next_batch : nullptr};
};

template <class Isa, int Width>
const SimulatedKernel* simulated_kernel_of_width(WarpKernel kernel, bool any_hit) {
    return with_kernel(kernel, [any_hit]<class Kernel>() -> const SimulatedKernel* {
        if (any_hit) return &SimulatedKernelOf<Kernel, true, Width, Isa>::table;
        return &SimulatedKernelOf<Kernel, false, Width, Isa>::table;
    });
}

/// A warp of one thread, under a name of its own for each instruction set.
template <class Isa>
struct OneThread : WarpHardware {};

template <bool any_hit, class Isa>
void trace_one_by_one(const WarpJob& job, std::size_t begin, std::size_t end, std::int32_t* stack) {
    for (std::size_t i = begin; i < end; ++i) {
        ThreadWarp<Lane, OneThread<Isa>> warp;
        warp.lane.stack = stack;
        OneBatch<WhileWhile> kernel;
        kernel.template turn<any_hit>(warp, job, static_cast<std::uint32_t>(i));
    }
}

template <class Isa>
TraceOneByOne* one_by_one_of(bool any_hit) {
    return any_hit ? &trace_one_by_one<true, Isa> : &trace_one_by_one<false, Isa>;
}

#if defined(RAYDIX_SIMULATOR_ISA)
#if RAYDIX_SIMULATOR_WIDTH == 1
template TraceOneByOne* one_by_one_of<simulator_isa::RAYDIX_SIMULATOR_ISA>(bool any_hit);
#endif
template const SimulatedKernel* simulated_kernel_of_width<simulator_isa::RAYDIX_SIMULATOR_ISA,
                                                          RAYDIX_SIMULATOR_WIDTH>(WarpKernel, bool);
#endif

}  // namespace raydix
