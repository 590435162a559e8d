#!/usr/bin/env python3
"""scripts/mutate.py [NUMBER...]: plants small faults in the core, one at a time, and lists those that no test notices.
scripts/mutate.py --commit-results: writes what the last run of each fault gave to bench/results/mutations.json.

Works on a copy of the tree in build/mutate. A fault is noticed if something no longer builds, or if a test program
fails, crashes or runs out of time: first those of `tests`, then all others; of each, tests that take long last. Exit
code 1 if a fault goes unnoticed or no longer applies (its old text must stand exactly once in the file). Faults of the
order of memory are seen by the thread sanitizer alone: the programs of their folders are built a second time, with it.
Faults of code for devices alone are seen by the tests of OpenCL devices, on the driver that scripts/setup --test fetches.
"""
import fcntl
import json
import os
import pathlib
import shutil
import subprocess
import sys
import time

from planted_faults import FAULTS

# Tests of a folder that take more than a second each, together minutes: only what the others let pass is put to them.
LONG = {
    "trace": ("Hits.BuiltinScenesLikeBruteForce", "Hits.SoupsLikeBruteForce", "Hits.LeafSizeAndCodeBitsChangeNoBit",
              "Hits.SoupAgainstEveryTriangle", "Hits.FaultResultsDifferByThreadCount", "Simd.SoupsLikeScalar",
              "Simd.BuiltinScenesLikeScalar", "Simd.EveryBuilderAndLeafSize", "Simd.LimitsBesideTheHit",
              "Simd.NoRayLeavesAClosedSurface", "KdRays.SoupsLikeBruteForce", "KdRays.BuiltinScenesLikeBruteForce",
              "KdRays.SharedBunnyLikeTheBvh", "KdNearest.LikeEveryPoint", "Watertight.*", "DoubleWatertight.*",
              "CwbvhTrace.SoupsLikeScalar", "CwbvhTrace.BuiltinScenesLikeScalar", "OracleHits.BuiltinScenes*",
              "DoubleTrace.EveryBuilderLikeEveryTriangle", "DoubleTrace.PartsOfTrianglesChangeNoBit",
              "DoubleTrace.ThreadsLeavesAndCodesChangeNoBit", "DoubleTrace.TIsThatOfExactArithmetic",
              "RayFaults.GpsCoordinatesCollapseCodes", "Simulate.FiguresDoNotDependOnThreads"),
    "engine": ("*WorldsAnswerAsTheirTrianglesDo", "DoubleMesh.AtAnyPlaceHasTheHitsOfAllTriangles",
               "DoubleMesh.OfAnyShapeHasTheHitsOfAllTriangles", "*ShearedInstancesLoseNoHits",
               "*MixedScenesAnswerAsEachShapeDoes", "*MovedVerticesRefitATreeWhileItIsGood",
               "*AnswersAreThoseOfEveryMeshOnEveryPath", "InstanceEdges.NearlyFlatMaps",
               "SceneProgress.ACommitThatEndsAtAnyCallLeavesTheSceneAsItWas"),
}

ROOT = pathlib.Path(__file__).resolve().parent.parent
WORK = ROOT / "build" / "mutate"
SOURCE, BUILD, BUILD_THREADS = WORK / "source", WORK / "build", WORK / "build-threads"
DEVICE_PROGRAMS = {name: BUILD / "bin" / f"device_{name}" for name in ("opencl", "opencl_exit")}
RESULTS, COMMITTED = WORK / "results.json", ROOT / "bench" / "results" / "mutations.json"
LEAST_TIME_LIMIT_S = 60
# Faults change answers, not speed: what compiles sooner will do. At -O1, GCC 12 warns of what is not so.
OPTIONS = {BUILD: ["-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_CXX_FLAGS_RELEASE=-O1 -w -DNDEBUG"],
           BUILD_THREADS: ["-DCMAKE_BUILD_TYPE=RelWithDebInfo", "-DCMAKE_CXX_FLAGS_RELWITHDEBINFO=-O1 -g1 -w -DNDEBUG",
                           "-DRAYDIX_SANITIZE=thread"]}
JOBS = os.environ.get("RAYDIX_JOBS", str(os.cpu_count() or 1))
MPIRUN = ["mpirun", "--oversubscribe", "--bind-to", "none", "--mca", "mpi_yield_when_idle", "1",
          *(["--allow-run-as-root"] if os.geteuid() == 0 else []), "-n", "4"]


def run(arguments, limit=None, **options):
    """Exit code of a command, None if it ran out of time. Its output is kept in build/mutate/last.log."""
    with open(WORK / "last.log", "wb") as log:
        process = subprocess.Popen(arguments, stdout=log, stderr=subprocess.STDOUT, start_new_session=True, **options)
        try:
            return process.wait(limit)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            process.wait()
            return None


def last_lines(count=15):
    return "\n".join((WORK / "last.log").read_text(errors="replace").splitlines()[-count:])


def copy_tree():
    """Brings the copy up to date; files that did not change keep their time, so that little is built again."""
    listed = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=ROOT, check=True,
                            stdout=subprocess.PIPE).stdout.decode().split("\0")
    names = {name for name in listed if name and (ROOT / name).is_file()}
    for old in [f for f in SOURCE.rglob("*") if f.is_file()]:
        if old.relative_to(SOURCE).as_posix() not in names:
            old.unlink()
    for name in names:
        source, target = ROOT / name, SOURCE / name
        if not target.exists() or target.read_bytes() != source.read_bytes():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)


def test_programs():
    """Folder of tests/ -> its program."""
    folders = [f.name for f in sorted((SOURCE / "tests").iterdir()) if list(f.glob("*_test.cpp"))]
    programs = {folder: BUILD / "bin" / f"{folder}_test" for folder in folders}
    if shutil.which(MPIRUN[0]):
        programs["mpi"] = BUILD / "bin" / "mpi_ranks"
    return programs


def thread_programs(faults):
    """The same for the thread sanitizer, of the folders that such faults name alone."""
    folders = {folder for fault in faults if fault.by_threads for folder in fault.tests.split()}
    return {folder: BUILD_THREADS / "bin" / f"{folder}_test" for folder in sorted(folders)}


def device_environment():
    """For tests of OpenCL devices: they fail where there is none."""
    driver = ROOT / "build" / "opencl-rt" / "lib"
    (WORK / "intel.icd").write_text(f"{driver / 'libintelocl.so'}\n", encoding="utf-8")
    return {**os.environ, "OCL_ICD_VENDORS": str(WORK), "LD_LIBRARY_PATH": str(driver), "RAYDIX_TEST_DEVICE": "opencl",
            "RAYDIX_DEVICE_REQUIRED": "opencl"}


def build(programs):
    """Of one build folder."""
    folder = programs[0].parent.parent
    return run(["cmake", "--build", str(folder), "--parallel", JOBS, "--target", *(p.name for p in programs)]) == 0


def configure(folder):
    return run(["cmake", "-G", "Ninja", "-S", str(SOURCE), "-B", str(folder), *OPTIONS[folder], "-DRAYDIX_INSTRUCTION_SETS=ENDS",
                "-DRAYDIX_BENCH=OFF", "-DRAYDIX_CLI=OFF", "-DRAYDIX_ATTACK=OFF", "-DRAYDIX_CUDA=OFF", "-DRAYDIX_HIP=OFF"]) == 0


def looks_of(folders):
    """The looks that test programs take at a fault, as (folder, filter of its tests): at first without those of LONG."""
    long = [(folder, ":".join(LONG[folder])) for folder in folders if folder in LONG]
    return [(folder, "-" + dict(long).get(folder, "")) for folder in folders], long


def run_program(program, tests, limit):
    launcher = MPIRUN if program.name == "mpi_ranks" else []
    environment = device_environment() if program in DEVICE_PROGRAMS.values() else None
    code = run([*launcher, str(program), "--gtest_brief=1", "--gtest_fail_fast=1", f"--gtest_filter={tests}"], limit, cwd=WORK,
               env=environment)
    return {0: None, None: "time"}.get(code, "test")


def prepare(faults):
    """Builds, without a fault, the programs that look at the faults first."""
    WORK.mkdir(parents=True, exist_ok=True)
    lock = open(WORK / "lock", "w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        sys.exit("another run is at work in build/mutate")
    SOURCE.mkdir(exist_ok=True)
    copy_tree()
    programs, with_threads = test_programs(), thread_programs(faults)
    first = {folder for fault in faults if not fault.by_threads for folder in fault.tests.split()}
    of_devices = [program for name, program in DEVICE_PROGRAMS.items() if name in first]
    for folder, wanted in ((BUILD, [program for name, program in programs.items() if name in first] + of_devices),
                           (BUILD_THREADS, list(with_threads.values()))):
        if wanted and not (configure(folder) and build(wanted)):
            sys.exit(f"without any fault, the tests do not build:\n{last_lines()}")
    return programs, with_threads, lock


def set_limits(looks, programs, limits):
    """Without a fault every look must pass, and its time sets its limit. Each is taken once, when it is first needed."""
    for folder, tests in looks:
        if (programs[folder], tests) in limits:
            continue
        start = time.monotonic()
        if not build([programs[folder]]) or run_program(programs[folder], tests, None) is not None:
            sys.exit(f"without any fault, {programs[folder].name} fails:\n{last_lines()}")
        limits[programs[folder], tests] = LEAST_TIME_LIMIT_S + 5 * (time.monotonic() - start)


def noticed_in(looks, programs, limits):
    """Which of these looks notices what is planted, or None."""
    if looks and not build([programs[folder] for folder, _ in looks]):
        if "interrupted" in last_lines(1):  # by a signal: the compiler said nothing of the fault
            sys.exit("the build was interrupted")
        return "the compiler"
    for folder, tests in looks:
        reason = run_program(programs[folder], tests, limits[programs[folder], tests])
        if reason:
            with_threads = programs[folder].is_relative_to(BUILD_THREADS)
            return f"{folder}_test" + (" (time)" if reason == "time" else " (thread sanitizer)" if with_threads else "")
    return None


def noticed_by(fault, programs, limits):
    """Plants the fault; what noticed it, or None."""
    first = [folder for folder in fault.tests.split() if folder in programs]
    file = SOURCE / fault.file
    text = file.read_text()
    for looks in (*looks_of(first), *looks_of([f for f in programs if f not in first])):
        set_limits(looks, programs, limits)
        file.write_text(text.replace(fault.old, fault.new))
        try:
            who = noticed_in(looks, programs, limits)
        finally:
            file.write_text(text)
        if who:
            return who
    return None


def known_results():
    """What earlier runs gave: those that are committed, and later ones here."""
    known = {}
    if COMMITTED.is_file():
        for row in json.loads(COMMITTED.read_text(encoding="utf-8"))["rows"]:
            if "fault" in row:
                known[row["fault"]] = {"noticed_by": row["noticed_by"], "commit": row["commit"]}
    if RESULTS.is_file():
        known |= json.loads(RESULTS.read_text(encoding="utf-8"))
    return known


def name_of(fault):
    """By the fault's own text, so that a fault that changed is not taken for the one that ran."""
    return f"{fault.file}: {fault.old} -> {fault.new}"


def keep_result(fault, noticed):
    results = known_results()
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True).stdout
    results[name_of(fault)] = {"noticed_by": noticed, "commit": commit.strip()}
    RESULTS.write_text(json.dumps(results, indent=1), encoding="utf-8")


def commit_results():
    results = known_results()
    rows = [{"file": fault.file, "breaks": fault.breaks, "fault": name_of(fault), **results[name_of(fault)]}
            for fault in FAULTS if name_of(fault) in results]
    missing = [fault.breaks for fault in FAULTS if name_of(fault) not in results]
    summary = {"faults": len(FAULTS), "run": len(rows), "noticed": sum(row["noticed_by"] is not None for row in rows),
               "never_run": missing, "rows": rows}
    COMMITTED.write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
    print(f"wrote {COMMITTED.relative_to(ROOT)}: {summary['noticed']} noticed of {len(rows)} that ran, of {len(FAULTS)} faults")


def main(arguments):
    if arguments == ["--commit-results"]:
        return commit_results()
    chosen = [int(a) for a in arguments] or list(range(1, len(FAULTS) + 1))
    programs, with_threads, _lock = prepare([FAULTS[number - 1] for number in chosen])  # the lock lasts as long as the run
    limits = {}
    bad = []
    for number in chosen:
        fault = FAULTS[number - 1]
        file = SOURCE / fault.file
        times = (file.read_text() if file.is_file() else "").count(fault.old)
        start = time.monotonic()
        if times != 1:
            outcome = f"DOES NOT APPLY: the old text stands {times} times in the file"
            bad.append(number)
        else:
            looked_at = DEVICE_PROGRAMS if fault.by_device else with_threads if fault.by_threads else programs
            who = noticed_by(fault, looked_at, limits)
            keep_result(fault, who)
            outcome = f"noticed by {who}" if who else "NOT NOTICED"
            bad += [] if who else [number]
        print(f"{number:3}  {fault.file}: {fault.breaks}\n     {outcome} ({time.monotonic() - start:.0f} s)", flush=True)
    print(f"{len(chosen) - len(bad)} of {len(chosen)} faults noticed" + (f"; not: {bad}" if bad else ""))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
