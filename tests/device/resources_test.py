"""resources_test.py NVCC SOURCE OUT FLAG...: compiles the kernels for sm_90 and prints what the assembler says of each:
registers, stack, spilled bytes. None of them may use a stack. Needs no device."""
import re
import subprocess
import sys

KERNELS = ("encode_triangles_30", "encode_triangles_63", "encode_boxes_63", "encode_points_63", "find_range_30",
           "find_range_63", "emit_radix_node", "fit_boxes", "answer_ray")
ENTRY = re.compile(r"Compiling entry function '(\w+)'.*?(\d+) bytes stack frame, (\d+) bytes spill stores, "
                   r"(\d+) bytes spill loads.*?Used (\d+) registers", re.DOTALL)


def main(nvcc, source, out, *flags):
    done = subprocess.run([nvcc, *flags, "-arch=sm_90", "--resource-usage", "-cubin", source, "-o", out],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    usage = ENTRY.findall(done.stdout)
    missing, faults = set(KERNELS), []
    print(f"{'kernel':<24}{'registers':>10}{'stack':>8}{'spilled':>9}")
    for name, stack, stores, loads, registers in usage:
        kernel = next((k for k in KERNELS if f"{len(k)}{k}" in name), name)
        missing.discard(kernel)
        print(f"{kernel:<24}{registers:>10}{stack:>8}{int(stores) + int(loads):>9}")
        if int(stack) or int(stores) or int(loads):
            faults.append(f"{kernel} uses {stack} bytes of stack")
    faults += [f"{kernel} was not compiled" for kernel in sorted(missing)]
    if done.returncode:
        faults.append(f"nvcc: exit code {done.returncode}\n{done.stdout}")
    print("\n".join(faults) or f"{len(usage)} kernels, none uses a stack")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
