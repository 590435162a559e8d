"""resources_test.py CUOBJDUMP OBJECT: prints registers and stack of each kernel; none of them may use a stack."""
import re
import subprocess
import sys

KERNELS = ("encode_triangles_30", "encode_triangles_63", "encode_boxes_63", "encode_points_63", "find_range_30",
           "find_range_63", "emit_radix_node", "fit_boxes", "answer_ray")


def main(cuobjdump, kernels_object):
    text = subprocess.run([cuobjdump, "--dump-resource-usage", kernels_object], check=True, stdout=subprocess.PIPE,
                          text=True).stdout
    usage = re.findall(r"Function (\S+?):\s+REG:(\d+) STACK:(\d+)[^\n]* LOCAL:(\d+)", text)
    missing, faults = set(KERNELS), []
    print(f"{'kernel':<24}{'registers':>10}{'stack':>8}{'local':>8}")
    for name, registers, stack, local in usage:
        kernel = next((k for k in KERNELS if re.search(rf"\d{k}N|\d{k}P|^{k}$|\d{k}[A-Z]", name)), name)
        missing.discard(kernel)
        print(f"{kernel:<24}{registers:>10}{stack:>8}{local:>8}")
        if int(stack) or int(local):
            faults.append(f"{kernel} uses {stack} bytes of stack and {local} of local memory")
    faults += [f"{kernel} is not in the object" for kernel in sorted(missing)]
    print("\n".join(faults) or f"{len(usage)} kernels, none uses a stack")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
