"""code_object_test.py READELF SPIRV_FOLDER CODE_OBJECT...: what clang gave each kernel of a code object for AMD: registers, stack,
memory that a group shares. The kernels must be those of the SPIR-V modules. None may spill vector registers, none may use a
stack other than that of a traversal, and each must leave a SIMD room for as many waves as the table says. Needs no device.
"""
import os
import pathlib
import re
import struct
import subprocess
import sys

# Architecture -> lanes of a wave, vector registers of a SIMD for each lane, how many are given out at once, waves that it
# holds at most (LLVM: "User Guide for AMDGPU Backend"; 512 on gfx90a and gfx942 are ordinary and accumulating ones together).
MACHINES = {"gfx90a": (64, 512, 8, 8), "gfx942": (64, 512, 8, 8), "gfx1100": (32, 1536, 24, 16), "gfx1200": (32, 1536, 24, 16)}
GROUP_THREADS = 128
# The first pattern that a kernel's name begins with -> the least waves of (64, 32) lanes, bytes of stack, bytes that a group shares.
# Stacks are arrays of a walk: 128 entries of 4 and 8 bytes, 96 of 16, 8 and 4; up to 16 more keep registers of the compiler
# out of the way or align the array. Exact tests of pairs hold sums of up to 48 doubles besides.
LIMITS = (
    (r"warps_merge_clusters", (5, 16), 0, 0),
    (r"trace_(persistent_)?packet", (7, 16), 0, 2048),
    (r"trace_work_queue", (3, 16), 0, 15104),
    (r"trace_wide", (5, 16), 128 * 4 + 16, 0),
    (r"trace_persistent_wide", (4, 16), 128 * 4 + 16, 0),
    (r"trace_short_stack", (6, 16), 0, 0),
    (r"trace_persistent_short_stack", (5, 16), 0, 0),
    (r"trace_cwbvh|cwbvh", (4, 12), 128 * 8 + 16, 0),
    (r"trace", (6, 16), 128 * 4 + 16, 0),
    (r"each_(find_nearest|count_within|fill_within)", (8, 16), 96 * 16 + 48, 8192),
    (r"each_find_closest", (4, 12), 96 * 8 + 16, 0),
    (r"each_(count|fill)_partners_(within|between)_narrow", (3, 10), 96 * 4 + 1232, 0),
    (r"each_(count|fill)_partners", (8, 16), 96 * 4 + 16, 0),
    (r"", (8, 16), 0, 0),
)


def kernels_of(readelf, code_object):
    """Kernel -> the numbers that the code object's note says of it."""
    notes = subprocess.run([readelf, "--notes", code_object], check=True, capture_output=True, text=True).stdout
    kernels = {}
    for text in re.split(r"\n  - ", notes.split("amdhsa.kernels:", 1)[1].split("\namdhsa.", 1)[0])[1:]:
        fields = dict(re.findall(r"^(?:    )?\.(\w+): +(\S+)$", text, re.M))
        kernels[fields["name"]] = {key: int(value) for key, value in fields.items() if value.isdigit()}
    return kernels


def entry_points(module):
    """The names of a SPIR-V module's kernels."""
    data = module.read_bytes()
    at = 20
    while at < len(data):
        word, = struct.unpack_from("<I", data, at)
        if word & 0xFFFF == 15:  # OpEntryPoint: model, id, name
            yield data[at + 12:data.index(b"\0", at + 12)].decode()
        at += 4 * (word >> 16)


def waves(registers, machine):
    """How many waves with so many registers a SIMD holds."""
    _, all_registers, step, most = machine
    return min(most, all_registers // (-(-max(registers, 1) // step) * step))


def faults_of(kernels, machine):
    lanes = machine[0]
    for name, given in kernels.items():
        least_waves, stack, shared = next(limits for pattern, *limits in LIMITS if re.match(pattern, name))
        least = least_waves[0 if lanes == 64 else 1]
        held = waves(given["vgpr_count"], machine)
        if held < least:
            yield f"{name}: {given['vgpr_count']} vector registers leave room for {held} waves, not {least}"
        for what, found, limit in (("vector registers spilled", given["vgpr_spill_count"], 0),
                                   ("bytes of stack", given["private_segment_fixed_size"], stack),
                                   ("bytes shared by a group", given["group_segment_fixed_size"], shared)):
            if found > limit:
                yield f"{name}: {found} {what}; the limit is {limit}"
        for what, wanted in (("max_flat_workgroup_size", GROUP_THREADS), ("wavefront_size", lanes)):
            if given[what] != wanted:
                yield f"{name}: {what} is {given[what]}, not {wanted}"


def faults_of_version(readelf, code_object):
    """Every ROCm since 5.0 loads code objects of version 4; in ELF's header that is a 2. Their kernels find the size of their
    groups without hidden arguments, which are others in each version."""
    version = pathlib.Path(code_object).read_bytes()[8]
    if version != 2:
        yield f"the code object's EI_ABIVERSION is {version}, not 2 (version 4)"
    notes = subprocess.run([readelf, "--notes", code_object], check=True, capture_output=True, text=True).stdout
    hidden = sorted(set(re.findall(r"hidden_\w+", notes)))
    if hidden:
        yield f"kernels have hidden arguments: {', '.join(hidden)}"


def check(readelf, code_object, expected):
    architecture = pathlib.Path(code_object).stem
    machine = MACHINES[architecture]
    kernels = kernels_of(readelf, code_object)
    faults = [f"{name} was not compiled" for name in sorted(expected - kernels.keys())]
    faults += [f"{name} is no kernel of the SPIR-V modules" for name in sorted(kernels.keys() - expected)]
    faults += [*faults_of(kernels, machine), *faults_of_version(readelf, code_object)]
    print(f"{architecture}: {len(kernels)} kernels\n{'not the common figures':<48}{'vector':>7}{'scalar':>7}{'spilled':>8}{'waves':>6}"
          f"{'stack':>6}{'shared':>7}")
    for name, given in sorted(kernels.items()):
        held = waves(given["vgpr_count"], machine)
        row = (given["sgpr_spill_count"], given["private_segment_fixed_size"], given["group_segment_fixed_size"])
        if held < machine[3] or any(row):
            print(f"{name:<48}{given['vgpr_count']:>7}{given['sgpr_count']:>7}{row[0]:>8}{held:>6}{row[1]:>6}{row[2]:>7}")
    print("\n".join(faults) or f"no vector register spilled; without a row here: {machine[3]} waves, no stack, nothing shared")
    return faults


def main(readelf, spirv_folder, *code_objects):
    if not code_objects:  # skipped, unless kernels of devices must be looked at
        print("no code object was compiled: that needs lld of clang's version (Debian: lld-22)")
        return 1 if os.environ.get("RAYDIX_DEVICE_REQUIRED") else 77
    expected = {name for module in pathlib.Path(spirv_folder).glob("*.spv") for name in entry_points(module)}
    return 1 if any([check(readelf, code_object, expected) for code_object in code_objects]) else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
