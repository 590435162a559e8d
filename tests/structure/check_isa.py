"""check_isa.py OBJECT...: code for newer processors must not leak. A weak symbol of an object that was compiled for
AVX2 may be the copy that the linker keeps for the whole program, so each has to carry the mark of its version.
And the code has to make use of the processor."""
import subprocess
import sys

objects = sys.argv[1:]
if not objects:
    sys.exit("no objects: the build has no code for newer processors")
bad = seen = 0
for name in objects:
    code = subprocess.run(["objdump", "-d", "--no-show-raw-insn", name], check=True, capture_output=True, text=True).stdout
    if "vfmadd" not in code:
        print(f"{name}: no fused multiply-add: not compiled for a newer processor at all")
        bad += 1
    for line in subprocess.run(["nm", "-C", "--defined-only", name], check=True, capture_output=True,
                               text=True).stdout.splitlines():
        kind, symbol = line.split(maxsplit=2)[1:]
        seen += 1
        if kind in "WVu" and "simulator_isa::v3" not in symbol:
            print(f"{name}: {symbol}")
            bad += 1
print(f"{len(objects)} objects, {seen} symbols, {bad} leaks")
sys.exit(bad > 0 or seen == 0)
