"""raydix's LBVH builders against Embree's Morton builder, each in processes of its own, in turn (A B C A B C ...).

Per scene and thread count: first build against first commit, rebuild in place against re-commit; medians over the
rounds, with the least and the greatest; then the fastest builder's stages beside the plain loops of build_floor, and
how the time for a primitive grows from the smallest scene named to each larger one.
"""
import argparse
import json
import pathlib
import statistics
import subprocess

ROWS = {"fresh": lambda r: r["first_ms"], "kept": lambda r: statistics.median(r["rebuild_ms"])}


def run(program, *arguments):
    return json.loads(subprocess.run([str(program), *map(str, arguments)], check=True, capture_output=True).stdout)


def spread(values):
    return f"{statistics.median(values):8.1f} ({min(values):.1f} to {max(values):.1f})"


def compare(folder, scene, threads, rounds, builders):
    results = {peer: [] for peer in [*builders, "embree"]}
    for _ in range(rounds):
        for peer, runs in results.items():
            which = ["--peer", "embree"] if peer == "embree" else ["--peer", "raydix", "--builder", peer]
            runs.append(run(folder / "bench_build", *which, "--scene", scene, "--threads", threads))
    assert len({r["triangles"] for runs in results.values() for r in runs}) == 1
    assert len({r["tree_hash"] for peer in builders for r in results[peer]}) == 1, "builders disagree"
    lines = {}
    for row, pick in ROWS.items():
        times = {peer: [pick(r) for r in runs] for peer, runs in results.items()}
        median = {peer: statistics.median(values) for peer, values in times.items()}
        best = min(builders, key=median.get)
        lines[row] = {"ms": times, "fastest": best, "ratio": median[best] / median["embree"]}
        print(f"{results[best][0]['scene']:<36} {threads} threads {row:>6}: " +
              ", ".join(f"{peer} {spread(values)}" for peer, values in times.items()) +
              f" ms; {best} / Embree LOW = {lines[row]['ratio']:.2f}", flush=True)
    best = results[lines["kept"]["fastest"]]
    tree = best[0]
    print(f"    tree {tree['bytes'] / 1e6:.1f} MB, peak {tree['peak_bytes'] / 1e6:.1f} MB "
          f"({tree['peak_bytes'] / tree['bytes']:.2f} x)")
    stages = {s: statistics.median(x[s] for r in best for x in r["stages"]) for s in tree["stages"][0]}
    floor = run(folder / "build_floor", "--scene", scene, "--threads", threads)
    print("    kept stages, ms: " + ", ".join(f"{s} {ms:.1f}" for s, ms in stages.items()))
    print("    plain loops, ms: " + ", ".join(f"{s} {ms:.1f}" for s, ms in floor["ms"].items()) +
          f"; triad {floor['triad_gb_per_s']:.1f} GB/s, compulsory {floor['compulsory_mb']:.0f} MB = "
          f"{floor['compulsory_ms']:.1f} ms; kept / compulsory = {stages['total'] / floor['compulsory_ms']:.1f}",
          flush=True)
    return {"scene": tree["scene"], "triangles": tree["triangles"], "threads": threads, "cpu": tree["cpu"],
            "rows": lines, "stages_ms": stages, "floor": floor, "bytes": tree["bytes"],
            "peak_bytes": tree["peak_bytes"]}


def print_growth(results):
    """Time for a primitive of each larger scene over that of the smallest, beside Embree's own."""
    for threads in sorted({r["threads"] for r in results}):
        rows = sorted((r for r in results if r["threads"] == threads), key=lambda r: r["triangles"])
        for row in ROWS:
            for larger in rows[1:]:
                growth = {}
                for peer in rows[0]["rows"][row]["ms"]:
                    each = [statistics.median(r["rows"][row]["ms"][peer]) / r["triangles"] for r in (rows[0], larger)]
                    growth[peer] = each[1] / each[0]
                print(f"time a triangle, {larger['scene']} over {rows[0]['scene']}, {threads} threads, {row}: " +
                      ", ".join(f"{peer} {g:.2f}" for peer, g in growth.items()))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=["builtin:figure?triangles=1000000"])
    parser.add_argument("--threads", type=int, nargs="*", default=[1, 2])
    parser.add_argument("--builders", nargs="*", default=["karras", "apetrei"])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--bin", type=pathlib.Path, default=pathlib.Path("build/release/bin"))
    parser.add_argument("--json", type=pathlib.Path, help="also append one JSON line per comparison to this file")
    options = parser.parse_args()
    results = []
    for scene in options.scenes:
        for threads in options.threads:
            result = compare(options.bin, scene, threads, options.rounds, options.builders)
            results.append(result)
            if options.json:
                with options.json.open("a") as file:
                    file.write(json.dumps(result) + "\n")
    print_growth(results)


if __name__ == "__main__":
    main()
