// A build as launches on a stream of any machine: its scratch, its launches, its times. `with`
// calls its argument with the build, whose run(launcher, arena, mark) is the pipeline. A Machine
// has:
//
//   Sizer                               goes through the launches, for the memory they work in
//   reserved_bytes                      what its launcher keeps of that memory for itself
//   launcher(stream, memory, bytes)     a launcher on the stream
//   StageTimes(machine, stream)         marks(stage) behind each stage, and read() at the end
#pragma once

#include <raydix/device.h>
#include <raydix/error.h>

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "gpu/device_sorted.h"

namespace raydix {

/// Bytes of the arrays, and in all.
struct ScratchSize {
    std::size_t front = 0, all = 0;
};

template <class Machine, class With>
ScratchSize scratch_size(const With& with) {
    ScratchSize size;
    with([&](const auto& build) {
        Arena arena = sizing_arena();
        typename Machine::Sizer sizer;
        build.run(sizer, arena);
        size.front = arena.bytes();
        size.all = size.front + Machine::reserved_bytes + sizer.bytes();
    });
    return size;
}

template <class Machine, class With, class Mark = NoMarks>
void run_on_stream(const Machine& machine, const With& with, std::span<std::byte> scratch,
                   Stream stream, const Mark& mark = {}) {
    const ScratchSize size = scratch_size<Machine>(with);
    if (scratch.size() < size.all)
        throw InputError("the build wants " + std::to_string(size.all) +
                         " bytes of scratch on the device; it was given " +
                         std::to_string(scratch.size()));
    if (reinterpret_cast<std::uintptr_t>(scratch.data()) % Arena::alignment != 0)
        throw InputError("the scratch on the device is not aligned to 256 bytes");
    with([&](const auto& build) {
        Arena arena(scratch.data(), size.front);
        auto launcher =
            machine.launcher(stream, scratch.data() + size.front, scratch.size() - size.front);
        build.run(launcher, arena, mark);
    });
}

/// Waits for the end.
template <class Machine, class With>
BuildMs time_on_stream(const Machine& machine, const With& with, std::span<std::byte> scratch,
                       Stream stream) {
    typename Machine::StageTimes times(machine, stream);
    run_on_stream(machine, with, scratch, stream, [&](const char* stage) { times(stage); });
    return times.read();
}

/// The field of a stage.
inline double& stage_ms(BuildMs& ms, std::string_view stage) {
    if (stage == "bounds") return ms.bounds;
    if (stage == "codes") return ms.codes;
    if (stage == "sort") return ms.sort;
    if (stage == "hierarchy") return ms.hierarchy;
    if (stage == "fit") return ms.fit;
    return ms.layout;
}

}  // namespace raydix
