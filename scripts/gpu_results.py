"""gpu_results.py JUNIT: the test run of scripts/gpu -> bench/results/GPU-NAME.json. Exit code 1 unless every test ran and passed."""
import json
import pathlib
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

ROOT = pathlib.Path(__file__).resolve().parent.parent


def first_line_of(*command):
    return subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()[0].strip()


def status_of(case):
    if case.find("skipped") is not None or case.get("status") in ("notrun", "disabled"):
        return "skipped"
    return "passed" if case.get("status") == "run" and case.find("failure") is None else "failed"


def tests_of(junit):
    return [{"name": case.get("name"), "status": status_of(case), "seconds": float(case.get("time")),
             "output": (case.findtext("system-out") or "").splitlines()}
            for case in ElementTree.parse(junit).getroot().iter("testcase")]


def main(junit):
    name, driver = first_line_of("nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader").split(", ")
    tests = tests_of(junit)
    document = {"gpu": name, "driver": driver, "commit": first_line_of("git", "rev-parse", "HEAD"), "tests": tests}
    out = ROOT / "bench" / "results" / (re.sub(r"[^A-Za-z0-9.]+", "-", name) + ".json")
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    passed = sum(test["status"] == "passed" for test in tests)
    print(f"{passed} of {len(tests)} GPU tests passed on {name}; written: {out.relative_to(ROOT)}")
    return 0 if tests and passed == len(tests) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
