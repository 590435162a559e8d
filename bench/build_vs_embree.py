"""raydix's karras builder against Embree's Morton builder, each in processes of its own, in turn (A B A B ...).

Per scene and thread count: first build against first commit, rebuild in place against re-commit; medians over the
rounds, with the least and the greatest; then raydix's stages beside the plain loops of build_floor.
"""
import argparse
import json
import pathlib
import statistics
import subprocess


def run(program, *arguments):
    return json.loads(subprocess.run([str(program), *map(str, arguments)], check=True, capture_output=True).stdout)


def spread(values):
    return f"{statistics.median(values):8.1f} ({min(values):.1f} to {max(values):.1f})"


def compare(folder, scene, threads, rounds):
    results = {"raydix": [], "embree": []}
    for _ in range(rounds):
        for peer in results:
            results[peer].append(run(folder / "bench_build", "--peer", peer, "--scene", scene, "--threads", threads))
    assert results["raydix"][0]["triangles"] == results["embree"][0]["triangles"] > 0
    assert len({r["tree_hash"] for r in results["raydix"]}) == 1
    lines = {}
    for row, pick in (("fresh", lambda r: r["first_ms"]), ("kept", lambda r: statistics.median(r["rebuild_ms"]))):
        ours, theirs = ([pick(r) for r in results[peer]] for peer in ("raydix", "embree"))
        ratio = statistics.median(ours) / statistics.median(theirs)
        lines[row] = {"raydix_ms": ours, "embree_ms": theirs, "ratio": ratio}
        print(f"{results['raydix'][0]['scene']:<40} {threads} threads {row:>6}: raydix {spread(ours)} ms, "
              f"Embree LOW {spread(theirs)} ms, ratio {ratio:.2f}", flush=True)
    tree = results["raydix"][0]
    print(f"    tree {tree['bytes'] / 1e6:.1f} MB, peak {tree['peak_bytes'] / 1e6:.1f} MB "
          f"({tree['peak_bytes'] / tree['bytes']:.2f} x)")
    stages = {s: statistics.median(x[s] for r in results["raydix"] for x in r["stages"]) for s in tree["stages"][0]}
    floor = run(folder / "build_floor", "--scene", scene, "--threads", threads)
    print("    kept stages, ms: " + ", ".join(f"{s} {ms:.1f}" for s, ms in stages.items()))
    print("    plain loops, ms: " + ", ".join(f"{s} {ms:.1f}" for s, ms in floor["ms"].items()) +
          f"; triad {floor['triad_gb_per_s']:.1f} GB/s, compulsory {floor['compulsory_mb']:.0f} MB = "
          f"{floor['compulsory_ms']:.1f} ms", flush=True)
    return {"scene": tree["scene"], "triangles": tree["triangles"], "threads": threads, "cpu": tree["cpu"],
            "rows": lines, "stages_ms": stages, "floor": floor, "bytes": tree["bytes"],
            "peak_bytes": tree["peak_bytes"]}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=["builtin:figure?triangles=1000000"])
    parser.add_argument("--threads", type=int, nargs="*", default=[1, 2])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--bin", type=pathlib.Path, default=pathlib.Path("build/release/bin"))
    parser.add_argument("--json", type=pathlib.Path, help="also append one JSON line per comparison to this file")
    options = parser.parse_args()
    for scene in options.scenes:
        for threads in options.threads:
            result = compare(options.bin, scene, threads, options.rounds)
            if options.json:
                with options.json.open("a") as file:
                    file.write(json.dumps(result) + "\n")


if __name__ == "__main__":
    main()
