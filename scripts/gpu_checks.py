"""gpu_checks.py RESULT.json: what a run of scripts/gpu must reach, line by line. Exit code 1 if anything is missed or was
not measured. tests/structure/gpu_checks_test.py puts a made-up result to every check, so that each can fail in CI."""
import json
import pathlib
import sys

COPY_SHARE = 0.35            # hierarchy and boxes, 63 bits, 10 M primitives: of the measured copy bandwidth
KARRAS_GPRIMS_PER_S = 4.0    # whole build, 63 bits, 10 M primitives
HPLOC_GPRIMS_PER_S = 2.0
TRAVERSAL_PERCENT = 85.0     # of the lower bound, primary and ao rays, the best kernel of each scene
LARGE_SCENE, LARGE_LAUNCH = 9_900_000, 1 << 24


def large_builds(document, builder):
    return [line for line in document["bench"]
            if line.get("tree") == "bvh" and line.get("builder") == builder and line["bits"] == 63
            and line["triangles"] >= LARGE_SCENE]


def at_least(name, rows, value_of, target, unit):
    """One line: the best row must reach the target."""
    if not rows:
        return False, f"{name}: not measured"
    best = max(value_of(row) for row in rows)
    return best >= target, f"{name}: {best:.3g} {unit}, wanted {target:g}"


def build_checks(document):
    karras, hploc = large_builds(document, "karras"), large_builds(document, "hploc")
    yield at_least("hierarchy and boxes, 10 M, 63 bits, share of copy bandwidth", karras, lambda row: row["of_copy_rate"],
                   COPY_SHARE, "of it")
    yield at_least("whole karras build, 10 M, 63 bits", karras, lambda row: row["gprims_per_s"], KARRAS_GPRIMS_PER_S, "Gprims/s")
    yield at_least("whole hploc build, 10 M, 63 bits", hploc, lambda row: row["gprims_per_s"], HPLOC_GPRIMS_PER_S, "Gprims/s")


def traversal_checks(document):
    rows = document["traversal"]
    judged = [row for row in rows if row["percent_of_simulated"] is not None]
    for scene in sorted({row["scene"] for row in rows}) or ["any scene"]:
        for rays in ("primary", "ao"):
            large = [row for row in judged if row["scene"] == scene and row["rays"] == rays
                     and row["largest_launch"] >= LARGE_LAUNCH]
            yield at_least(f"{scene}, {rays} rays, launches of 2^24, percent of the lower bound", large,
                           lambda row: row["percent_of_simulated"], TRAVERSAL_PERCENT, "%")
    if not judged:
        yield False, "rates below their bounds: no measured row has a bound"
    for row in judged:
        rate = row["mrays_per_s"]["max"]
        yield rate <= row["mrays_per_s_bound"], (f"{row['scene']}, {row['rays']}, {row['kernel']}: {rate:.1f} Mrays/s, bound "
                                                 f"{row['mrays_per_s_bound']:.1f}")


def checks(document):
    """(holds, what) of each."""
    return [*build_checks(document), *traversal_checks(document)]


def main(file):
    results = checks(json.loads(pathlib.Path(file).read_text(encoding="utf-8")))
    for holds, text in results:
        print("met   " if holds else "missed", text)
    return 0 if all(holds for holds, _ in results) else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
