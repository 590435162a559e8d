"""check_hardening.py PROGRAM: a release build of the program carries what makes faults hard to exploit: addresses that
change from run to run, tables of the loader that are read-only, no stack that can be executed, guarded stack frames,
and checked calls of the C library. Read from the file itself: options that were passed prove nothing."""
import re
import subprocess
import sys


def readelf(program, *options):
    return subprocess.run(["readelf", "-W", *options, program], check=True, capture_output=True, text=True).stdout


def missing_properties(program):
    header, segments = readelf(program, "-h"), readelf(program, "-l")
    dynamic, symbols = readelf(program, "-d"), readelf(program, "--dyn-syms")
    stack = re.search(r"GNU_STACK\s+(?:0x\w+\s+){5}(\S+)", segments)
    properties = {
        "position-independent (PIE)": re.search(r"Type:\s+DYN", header) and re.search(r"FLAGS_1.*\bPIE\b", dynamic),
        "relocations read-only (RELRO)": "GNU_RELRO" in segments,
        "all symbols bound at start (BIND_NOW)": re.search(r"\(FLAGS\).*BIND_NOW|\(FLAGS_1\).*\bNOW\b", dynamic),
        "stack not executable": stack and "E" not in stack.group(1),
        "stack protector": re.search(r"\b__stack_chk_(fail|guard)\b", symbols),
        # A call that the compiler could not prove safe; __stack_chk_fail is not one of them.
        "checked calls (_FORTIFY_SOURCE)": re.search(r"\b__(?!stack)\w+_chk\b", symbols),
    }
    return [name for name, found in properties.items() if not found]


def main():
    program = sys.argv[1]
    missing = missing_properties(program)
    for name in missing:
        print(f"{program}: missing: {name}")
    print(f"{program}: {len(missing)} of 6 properties missing")
    return len(missing) > 0


if __name__ == "__main__":
    sys.exit(main())
