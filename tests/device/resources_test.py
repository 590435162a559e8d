"""resources_test.py NVCC SOURCE OUT FLAG...: compiles the kernels of SOURCE for sm_90 and prints what the assembler says
of each: registers, stack, spilled bytes. None may spill, or use a stack other than that of
a traversal, and those of the project have a limit on registers.
Needs no device."""
import pathlib
import re
import subprocess
import sys

# Per element functions on their own (kernels.cu): any number of registers.
PLAIN = ("encode_triangles_30", "encode_triangles_63", "encode_boxes_63", "encode_points_63", "find_range_30",
         "find_range_63", "emit_radix_node", "fit_boxes", "answer_ray")
# Functors of a build that must have been compiled -> the most registers. 32 lets an sm_90 multiprocessor hold all of
# its 2048 threads: what waits for memory (the climbs, the searches) must not exceed it.
EVERY = {
    "BoundPrimitives": 40, "MergeParts": 40, "PublishCounts": 40, "EncodeInScene": 32, "CopyToLeafOrder": 32,
    "FillUnusedKeys": 32, "ClearUnusedValues": 32, "SaveLastValue": 32, "AddLastValue": 32, "SetWord": 32}
BUILD = EVERY | {
    "MarkKeptNode": 32, "EmitKeptNode": 32, "CountSplits": 32, "EmitSplits": 32, "FindSplitLevels": 32,
    "KeepTwoChildren": 32, "NoteLevelNodes": 32, "LinkLevel": 32, "StartQueue": 32, "SplitTask": 32,
    "StartSplitLists": 32, "EmitOnlyLeaf": 32,
    "MarkKeptSplit": 32, "ClimbFromLeaf": 32, "LinkFewKeys": 32, "FitIfOnlyLeaf": 40, "FitBoxes": 32, "FitLevel": 40,
    "StartLevels": 32, "ExpandLevel": 32, "ClearMeeting": 32, "EmitNodePair": 40, "CountPairs": 32, "SetKeyCounts": 32,
    "ClearBehind": 32, "BoxInOrder": 32, "StartHploc": 32, "MergeClusters": 40, "StartPlacing": 40, "LinkPlaced": 32,
    "JumpPlaced": 32, "EmitPlaced": 40}
# Octree and k-d tree.
CORE = EVERY | dict.fromkeys((
    "StartOctree", "MarkUniqueCodes", "CompactCodes", "LinkRadixNode", "CountChain", "WriteChain", "FillNode",
    "LinkToParent", "LinkToChildren", "MarkLevels", "CenterInOrder", "MakeGrid", "FindKdRange", "EmitKdRootLeaf",
    "EmitKdNode", "FitKdIntervals"), 32)
EXPECTED = {"kernels.cu": dict.fromkeys(PLAIN, 255), "device_build_cuda.cu": BUILD, "device_core_cuda.cu": CORE}
# Traversal: 40 registers leave room for 1536 threads, which the h200 of src/simt/machine_models.cpp has in flight.
KERNELS = {"trace_rays": 40, "trace_packets": 48, "trace_queues": 72}
EXPECTED |= {"launch_warps_closest.cu": KERNELS, "launch_warps_any.cu": KERNELS,
             "device_trace_cuda.cu": {"PrepareRay": 32, "RescaleHit": 32, "MissAll": 32, "EmitWoopTriangle": 48, "ClearUnusedValues": 32,
                                   "SaveLastValue": 32, "AddLastValue": 32, "SetWord": 32}}
# The traversal stack itself, of the larger size: an array that the kernel indexes.
STACK_BYTES = {"trace_rays": 4 * 128, "cwbvh_rays": 8 * 128, "persistent_cwbvh_rays": 8 * 128}
# Queries: stacks of 96 entries of 16, 8 and 4 bytes; exact tests of pairs hold sums of up to 48 doubles besides, three of them.
STACK_BYTES |= {"FindNearest": 96 * 16, "CountWithin": 96 * 16, "FillWithin": 96 * 16, "FindClosest": 96 * 8,
                "CountPartners": 96 * 4 + 1184, "FillPartners": 96 * 4 + 1184}
EXPECTED["device_queries_cuda.cu"] = {
    "FindNearest": 32, "CountWithin": 32, "FillWithin": 32, "FindClosest": 96, "CountPartners": 136,
    "FillPartners": 136, "ClearOffset": 32, "ClearUnusedValues": 32, "SaveLastValue": 32, "AddLastValue": 32, "SetWord": 32}
EXPECTED["device_scene_cuda.cu"] = dict.fromkeys(("NameHit", "ClearUnusedValues", "SaveLastValue", "AddLastValue", "SetWord"), 32)
# 64: half of an sm_90 multiprocessor's threads at once; 72: 28 of its 64 warps.
# The second half of the triangle test is in double.
EXPECTED["device_cwbvh_cuda.cu"] = {"cwbvh_rays": 104, "persistent_cwbvh_rays": 96, "fill_misses": 16}
ENTRY = re.compile(r"Compiling entry function '(\w+)'.*?(\d+) bytes stack frame, (\d+) bytes spill stores, "
                   r"(\d+) bytes spill loads.*?Used (\d+) registers", re.DOTALL)


def kernel_of(mangled, known):
    """The innermost name of `known` in a mangled one: a functor may be wrapped in others."""
    found = [(mangled.find(f"{len(k)}{k}"), k) for k in known if f"{len(k)}{k}" in mangled]
    return min(found)[1] if found else None


def main(nvcc, source, out, *flags):
    known = EXPECTED[pathlib.Path(source).name]
    done = subprocess.run([nvcc, *flags, "-arch=sm_90", "--resource-usage", "-cubin", source, "-o", out],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    usage = ENTRY.findall(done.stdout)
    most, faults = {}, []
    for name, stack, stores, loads, registers in usage:
        kernel = kernel_of(name, known)
        if kernel is None and "3cub" not in name:
            faults.append(f"{name} is not in the table of limits")
        label = kernel or "(CUB)"
        rows = (1, int(registers), int(stack), int(stores) + int(loads))
        most[label] = tuple(max(a, b) if i else a + b for i, (a, b) in enumerate(zip(most.get(label, (0, 0, 0, 0)), rows)))
    print(f"{'kernel':<24}{'variants':>9}{'registers':>10}{'limit':>7}{'stack':>7}{'spilled':>9}   (the most of any variant)")
    for kernel, (variants, registers, stack, spilled) in sorted(most.items()):
        limit = known.get(kernel, 255)
        print(f"{kernel:<24}{variants:>9}{registers:>10}{limit:>7}{stack:>7}{spilled:>9}")
        if stack > STACK_BYTES.get(kernel, 0) or spilled:
            faults.append(f"{kernel} uses {stack} bytes of stack and spills {spilled}")
        if registers > limit:
            faults.append(f"{kernel} uses {registers} registers; the limit is {limit}")
    faults += [f"{kernel} was not compiled" for kernel in sorted(known.keys() - most.keys())]
    if done.returncode:
        faults.append(f"nvcc: exit code {done.returncode}\n{done.stdout}")
    print("\n".join(faults) or f"{len(usage)} kernels, none spills or uses a stack it was not given")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
