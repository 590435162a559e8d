"""resources_test.py OBJECT SOURCE: what the assembler gave each sm_90 kernel of a compiled CUDA source: registers and
stack. None may use a stack other than that of a traversal, so none may spill, and those of the project have a limit on
registers. OBJECT must hold device code that is not compressed (nvcc -no-compress). Needs no device."""
import pathlib
import struct
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
    "MarkKeptNode": 32, "EmitKeptNode": 32, "MarkKeptSlot": 32, "EmitKeptSlots": 32, "ClimbWarps": 42, "CountSplits": 32, "EmitSplits": 32, "FindSplitLevels": 32,
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
EXPECTED = {"kernels.cu": dict.fromkeys(PLAIN, 255), "device_build_cuda.cu": BUILD, "device_trees_cuda.cu": CORE}
# Traversal: the simulated h200 keeps as many warps in flight as these registers leave room for (src/trace/warp/residency.cpp).
KERNELS = {"trace_rays": 40, "trace_packets": 48, "trace_queues": 72, "trace_wide": 64, "trace_short_stack": 48}
EXPECTED |= {"launch_warps_closest.cu": KERNELS, "launch_warps_any.cu": KERNELS,
             "device_trace_cuda.cu": {"StartPool": 32, "PrepareRay": 32, "RescaleHit": 32, "MissAll": 32, "EmitWoopTriangle": 48,
                                   "ClearUnusedValues": 32, "SaveLastValue": 32, "AddLastValue": 32, "SetWord": 32}}
# The traversal stack itself, of the larger size: an array that the kernel indexes. Exactly that, so that a spill shows.
STACK_BYTES = {"trace_rays": 4 * 128, "trace_wide": 4 * 128, "cwbvh_rays": 8 * 128, "persistent_cwbvh_rays": 8 * 128}
# Queries: stacks of 96 entries of 16, 8 and 4 bytes; exact tests of pairs hold sums of up to 48 doubles besides, three of them.
STACK_BYTES |= {"FindNearest": 96 * 16, "CountWithin": 96 * 16, "FillWithin": 96 * 16, "FindClosest": 96 * 8,
                "CountPartners": 96 * 4 + 1184, "FillPartners": 96 * 4 + 1184}
EXPECTED["device_queries_cuda.cu"] = {
    "FindNearest": 32, "CountWithin": 32, "FillWithin": 32, "FindClosest": 96, "CountPartners": 136,
    "FillPartners": 136, "NameHit": 32, "ClearOffset": 32,
    "ClearUnusedValues": 32, "SaveLastValue": 32, "AddLastValue": 32, "SetWord": 32}
# 64: half of an sm_90 multiprocessor's threads at once; 72: 28 of its 64 warps.
# The second half of the triangle test is in double.
EXPECTED["device_cwbvh_cuda.cu"] = {"cwbvh_rays": 104, "persistent_cwbvh_rays": 96, "fill_misses": 16}
# ELF: the machine number of CUDA, and attributes of `.nv.info`: (symbol, value) pairs of 32 bits each.
EM_CUDA, REGISTERS, FRAME = 190, b"\x04\x2f\x08\x00", b"\x04\x11\x08\x00"


def text_at(image, at):
    return image[at:image.index(b"\0", at)].decode()


def device_images(data):
    """The device's ELF images that stand in an object file."""
    at = data.find(b"\x7fELF", 4)
    while at >= 0:
        if struct.unpack_from("<H", data, at + 18)[0] == EM_CUDA:
            yield data[at:]
        at = data.find(b"\x7fELF", at + 4)


def kernels_in(image):
    """Mangled name -> [registers, bytes of stack frame]."""
    table, = struct.unpack_from("<Q", image, 0x28)
    size, count, names = struct.unpack_from("<HHH", image, 0x3a)
    sections = [struct.unpack_from("<IIQQQQII", image, table + k * size) for k in range(count)]
    by_name = {text_at(image, sections[names][4] + s[0]): (s[4], s[5]) for s in sections}
    symbols, strings = by_name[".symtab"][0], by_name[".strtab"][0]
    begin, length = by_name[".nv.info"]
    kernels = {}
    for at in range(begin, begin + length, 12):  # all attributes here are of 12 bytes
        kind, (symbol, value) = image[at:at + 4], struct.unpack_from("<II", image, at + 4)
        if kind in (REGISTERS, FRAME):
            name = text_at(image, strings + struct.unpack_from("<I", image, symbols + 24 * symbol)[0])
            if not name.startswith("$"):  # a subroutine of a kernel: its frame is the kernel's
                kernels.setdefault(name, [0, 0])[kind == FRAME] = value
    return kernels


def kernel_of(mangled, known):
    """The innermost name of `known` in a mangled one: a functor may be wrapped in others."""
    found = [(mangled.find(f"{len(k)}{k}"), k) for k in known if f"{len(k)}{k}" in mangled]
    return min(found)[1] if found else None


def main(built, source):
    known = EXPECTED[pathlib.Path(source).name]
    usage = {}
    for image in device_images(pathlib.Path(built).read_bytes()):
        usage |= kernels_in(image)
    most, faults = {}, []
    for name, (registers, stack) in usage.items():
        kernel = kernel_of(name, known)
        if kernel is None and "3cub" not in name:
            faults.append(f"{name} is not in the table of limits")
        label = kernel or "(CUB)"
        variants, *rest = most.get(label, (0, 0, 0))
        most[label] = (variants + 1, max(registers, rest[0]), max(stack, rest[1]))
    print(f"{'kernel':<24}{'variants':>9}{'registers':>10}{'limit':>7}{'stack':>7}{'limit':>7}   (the most of any variant)")
    for kernel, (variants, registers, stack) in sorted(most.items()):
        limit, stack_limit = known.get(kernel, 255), STACK_BYTES.get(kernel, 0)
        print(f"{kernel:<24}{variants:>9}{registers:>10}{limit:>7}{stack:>7}{stack_limit:>7}")
        if stack > stack_limit:
            faults.append(f"{kernel} uses {stack} bytes of stack; the limit is {stack_limit}")
        if registers > limit:
            faults.append(f"{kernel} uses {registers} registers; the limit is {limit}")
    faults += [f"{kernel} was not compiled" for kernel in sorted(known.keys() - most.keys())]
    print("\n".join(faults) or f"{len(usage)} kernels, none spills or uses a stack it was not given")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
