"""gpu_results.py JUNIT [BENCH_LINES [TRAVERSAL.json...]]: what scripts/gpu ran -> bench/results/GPU-NAME.json: the tests,
the lines that bench_gpu printed, and the measured rows of `raydix bench traversal --device cuda`. Exit code 1 unless every
test ran and passed and, where there are benchmarks, every check of gpu_checks.py is met."""
import json
import os
import pathlib
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import gpu_checks

ROOT = pathlib.Path(__file__).resolve().parent.parent


def first_line_of(*command):
    return subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()[0].strip()


def commit():
    return os.environ.get("RAYDIX_COMMIT") or first_line_of("git", "rev-parse", "HEAD")


def status_of(case):
    if case.find("skipped") is not None or case.get("status") in ("notrun", "disabled"):
        return "skipped"
    return "passed" if case.get("status") == "run" and case.find("failure") is None else "failed"


def tests_of(junit):
    return [{"name": case.get("name"), "status": status_of(case), "seconds": float(case.get("time")),
             "output": (case.findtext("system-out") or "").splitlines()}
            for case in ElementTree.parse(junit).getroot().iter("testcase")]


def bench_of(file):
    return [json.loads(line) for line in pathlib.Path(file).read_text(encoding="utf-8").splitlines() if line.strip()]


def traversal_of(files):
    return [row for file in files for row in json.loads(pathlib.Path(file).read_text(encoding="utf-8"))["measured"]]


def text_of(line):
    """A line of a benchmark, for reading."""
    if line["bench"] == "gpu_cwbvh":
        rates = [f"{rays} {kernel} {line[rays][kernel]['mrays_per_s']['median']:.0f}"
                 for rays in ("primary", "diffuse") for kernel in ("cwbvh", "persistent_cwbvh")]
        return f"{line['scene']:<40}Mrays/s: {', '.join(rates)}"
    if line["bench"] == "gpu_trace" and "refused" in line:
        return f"{line['scene']:<40}{line['rays']:<18}{line['kernel']:<36}refused: {line['refused']}"
    if line["bench"] == "gpu_trace":
        return f"{line['scene']:<40}{line['rays']:<18}{line['kernel']:<36}{line['mrays_per_s']['median']:8.1f} Mrays/s"
    share = f", hierarchy and boxes at {100 * line['of_copy_rate']:5.1f} % of the copy rate" if "of_copy_rate" in line else ""
    return (f"{line['scene']:<40}{line.get('builder', line['tree']):<12}{line['bits']:>3} bits, leaves of {line['max_leaf']}: "
            f"{line['ms']['total']['median']:8.3f} ms, {line['gprims_per_s']:6.2f} Gprims/s{share}")


def main(junit, bench=None, *traversal):
    name, driver = first_line_of("nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader").split(", ")
    tests = tests_of(junit)
    document = {"gpu": name, "driver": driver, "commit": commit(), "tests": tests,
                "bench": bench_of(bench) if bench else [], "traversal": traversal_of(traversal)}
    out = ROOT / "bench" / "results" / (re.sub(r"[^A-Za-z0-9.]+", "-", name) + ".json")
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    passed = sum(test["status"] == "passed" for test in tests)
    for line in document["bench"]:
        print(text_of(line))
    print(f"{passed} of {len(tests)} GPU tests passed on {name}; written: {out.relative_to(ROOT)}")
    targets = gpu_checks.main(out) if bench else 0
    return 0 if tests and passed == len(tests) and targets == 0 else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
