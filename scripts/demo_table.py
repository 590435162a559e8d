"""Prints the one table of scripts/demo from the JSON documents that the raydix program left in a folder."""
import json
import pathlib
import sys


def row(name, value, unit=""):
    print(f"  {name:<22}{value:>14}  {unit}".rstrip())


def main(folder):
    build = json.loads((folder / "build.json").read_text())
    tree, scene, machine = build["build"], build["scene"], build["machine"]
    print(f"pictures: {', '.join(sorted(str(p) for p in folder.glob('*.png')))}\n")
    print(f"{scene['name']} on {machine['cpu']}, {tree['threads']} threads")
    row("triangles", f"{scene['triangles']:,}")
    row("load", f"{build['load_ms']:.1f}", "ms")
    for stage, ms in tree["ms"].items():
        row(f"build: {stage}", f"{ms:.2f}", "ms")
    row("nodes", f"{tree['nodes']:,}")
    bound = tree["depth_bound"]  # of LBVH builders alone
    row("depth", f"{tree['max_depth']}", "" if bound is None else f"proven bound {bound}")
    row("SAH", "none" if tree["sah"] is None else f"{tree['sah']:.2f}")
    row("memory", f"{tree['bytes'] / 1e6:.1f}", f"MB, peak {tree['peak_bytes'] / 1e6:.1f} MB")
    for kind in ("primary", "ao", "diffuse"):
        trace = json.loads((folder / f"{kind}.json").read_text())["trace"][0]
        rate = trace["mrays_per_s"]
        if rate is None:
            row(f"{kind} rays", "none", "(nothing was hit)")
        else:
            row(f"{kind} rays", f"{rate['median']:.2f}", f"Mrays/s ({rate['min']:.2f} to {rate['max']:.2f})")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
