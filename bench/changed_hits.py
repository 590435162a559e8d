"""Which hits two versions of the program raydix give otherwise: the same saved rays through both.

Per scene and kind of rays: hits found and lost, how many t changed and by how many units in the last place, and every
ray whose primitive changed, with both primitives and both t. Needs NumPy.
"""
import argparse
import json
import pathlib
import subprocess
import tempfile

import numpy

NONE = 0xFFFFFFFF


def trace(program, scene, folder, rays, *more):
    command = [program, "trace", scene, "--rays", rays, "--kernel", "simd", "--layout", "wide8", "--quality",
               "balanced", "--repeat", "1", "--quiet", *more]
    subprocess.run(list(map(str, command)), check=True, stdout=subprocess.DEVNULL)


def hits_of(program, scene, folder):
    trace(program, scene, folder, folder / "rays.npy", "--mode", "closest", "--hits", folder / "hits.npy")
    return numpy.load(folder / "hits.npy")


def compare(before, after):
    was, now = before["prim"] != NONE, after["prim"] != NONE
    moved = numpy.nonzero(before["prim"] != after["prim"])[0]
    same = was & (before["prim"] == after["prim"])
    steps = numpy.abs(before["t"].view(numpy.int32).astype(numpy.int64) -
                      after["t"].view(numpy.int32).astype(numpy.int64))[same]
    number = lambda t: float(t) if numpy.isfinite(t) else None
    name = lambda prim: None if prim == NONE else int(prim)
    return {
        "rays": len(before), "hits": int(now.sum()), "found": int((now & ~was).sum()),
        "lost": int((was & ~now).sum()), "t_changed": int((steps > 0).sum()),
        "t_ulps": {"median": float(numpy.median(steps)), "p99_99": float(numpy.percentile(steps, 99.99)),
                   "largest": int(steps.max())} if len(steps) else None,
        "prim_changed": len(moved),
        "prims": [[int(k), name(before["prim"][k]), name(after["prim"][k]), number(before["t"][k]),
                   number(after["t"][k])] for k in moved]}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=pathlib.Path)
    parser.add_argument("after", type=pathlib.Path)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--size", default="320x240")
    parser.add_argument("--samples", default="2")
    parser.add_argument("--json", type=pathlib.Path)
    args = parser.parse_args()
    results = []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for scene in args.scenes:
            for kind in "primary", "diffuse_shuffled":
                samples = () if kind == "primary" else ("--samples", args.samples)
                trace(args.before, scene, folder, kind, "--size", args.size, *samples, "--camera", "0", "--save-rays",
                      folder / "rays.npy")
                row = compare(hits_of(args.before, scene, folder), hits_of(args.after, scene, folder))
                title = {"scene": pathlib.Path(scene).name.split(".")[0], "kind": kind}
                results.append({**title, **row})
                print(json.dumps({**title, **{k: v for k, v in row.items() if k != "prims"}}), flush=True)
    if args.json:
        lines = ",\n".join(json.dumps(row) for row in results)
        args.json.write_text("[\n" + lines + "\n]\n")


if __name__ == "__main__":
    main()
