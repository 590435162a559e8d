#!/usr/bin/env python3
"""The Python package beside embreex, Open3D, SciPy and pykdtree, in one process and in turn (A B A
B).

    python bench/python/peers.py [SCENE] [--points FILE|N] [--rays N] [--repeat N] [--json FILE]

Answers are compared before anything is timed. Prints one table and writes JSON: medians, spread,
ratios, the machine.
"""

from __future__ import annotations

import argparse
import datetime
import importlib.metadata
import json
import os
import statistics
import sys
import time

import numpy as np

import raydix
from raydix.points import load_points


def optional(name):
    try:
        return __import__(name, fromlist=["_"])
    except (ImportError, OSError) as error:
        print(f"{name} is left out: {error}", file=sys.stderr)
        return None


def in_turn(calls, repeat):
    """{name: call} -> {name: [milliseconds]}, after a warm-up of each."""
    times = {name: [] for name in calls}
    for round_number in range(repeat + 1):
        for name, call in calls.items():
            start = time.perf_counter()
            call()
            if round_number:
                times[name].append((time.perf_counter() - start) * 1e3)
    return times


def row(what, ours, times, unit_count=None):
    """One line for each peer: medians in ms, spread, and how much faster we are."""
    base = statistics.median(times[ours])
    lines = []
    for name, values in times.items():
        median = statistics.median(values)
        line = {
            "what": what,
            "who": name,
            "ms": round(median, 5),
            "min": round(min(values), 5),
            "max": round(max(values), 5),
            "ratio": round(median / base, 3),
        }
        if unit_count:
            line["million_per_s"] = round(unit_count / median / 1e3, 3)
        lines.append(line)
    return lines


def ray_kinds(scene, wanted):
    """Primary, ambient and diffuse rays, about `wanted` of each."""
    side = int((wanted * 3 / 4) ** 0.5)
    primary = scene.primary_rays(size=(side * 4 // 3, side))["rays"]
    hits = max(1, int(scene.occluded(primary).sum()))
    samples = max(1, min(32, wanted // hits))
    diffuse = scene.secondary_rays(primary, "diffuse", samples=samples)[:wanted]
    shuffled = scene.secondary_rays(primary, "diffuse_shuffled", samples=samples)[:wanted]
    return {"primary": primary, "diffuse": diffuse, "diffuse_shuffled": shuffled}


def embree_scene(scene):
    module = optional("embreex.rtcore_scene")
    if module is None:
        return None
    from embreex.mesh_construction import TriangleMesh

    peer = module.EmbreeScene()
    TriangleMesh(peer, scene.vertices.astype(np.float32), scene.faces.astype(np.int32))
    return peer


def open3d_scene(scene):
    module = optional("open3d")
    if module is None:
        return None, None
    peer = module.t.geometry.RaycastingScene()
    peer.add_triangles(np.ascontiguousarray(scene.vertices), np.ascontiguousarray(scene.faces))
    return peer, module


def agreement(ours, theirs):
    same = float((ours == theirs).mean())
    if same < 0.99:
        raise SystemExit(f"only {same:.4f} of the answers agree: nothing to time")
    return same


def bench_rays(scene, in_double, wanted, repeat):
    """Closest hits. embreex gives ids, with output=1 also t, u, v; ours always gives all four. The
    scene in float64 gets the same rays as float64 arrays."""
    embree, (open3d, o3d) = embree_scene(scene), open3d_scene(scene)
    for kind, rays in ray_kinds(scene, wanted).items():
        origins, directions = rays[:, :3].copy(), rays[:, 4:7].copy()
        ours = scene.intersect(rays)["prim"]
        calls = {"raydix": lambda rays=rays: scene.intersect(rays)}
        calls["raydix, origins and directions"] = lambda o=origins, d=directions: scene.intersect(
            o, d
        )
        wide = rays.astype(np.float64)
        agreement(ours, in_double.intersect(wide)["prim"])
        calls["raydix, float64"] = lambda wide=wide: in_double.intersect(wide)
        if embree is not None:
            agreement(ours, embree.run(origins, directions).astype(np.int64).astype(np.uint32))
            calls["embreex, ids"] = lambda o=origins, d=directions: embree.run(o, d)
            calls["embreex, ids t u v"] = lambda o=origins, d=directions: embree.run(o, d, output=1)
        if open3d is not None:
            six = o3d.core.Tensor(np.concatenate([origins, directions], axis=1))
            agreement(ours, open3d.cast_rays(six)["primitive_ids"].numpy())
            calls["open3d"] = lambda six=six: open3d.cast_rays(six)
        yield from row(f"{len(rays):,} {kind} rays", "raydix", in_turn(calls, repeat), len(rays))


def bench_one_ray(scene, repeat):
    """What a call with one ray costs, in microseconds (the ms column holds ms of 10,000 calls,
    divided)."""
    embree = embree_scene(scene)
    ray = scene.primary_rays(size=(9, 9))["rays"][40:41].copy()
    origin, direction = ray[:, :3].copy(), ray[:, 4:7].copy()

    def often(call):
        def run():
            for _ in range(10_000):
                call()

        return run

    calls = {
        "raydix": often(lambda: scene.intersect(ray)),
        "raydix, occluded": often(lambda: scene.occluded(ray)),
    }
    calls["raydix, origins and directions"] = often(lambda: scene.intersect(origin, direction))

    def read():
        hits = scene.intersect(origin, direction)
        return hits["t"], hits["prim"], hits["u"], hits["v"]

    calls["raydix, and t prim u v read"] = often(read)
    if embree is not None:
        calls["embreex, ids"] = often(lambda: embree.run(origin, direction))
        calls["embreex, ids t u v"] = often(lambda: embree.run(origin, direction, output=1))
    lines = row("10,000 calls with one ray", "raydix", in_turn(calls, repeat))
    for line in lines:
        line["us_per_call"] = round(line["ms"] / 10, 3)
        yield line


def bench_points(cloud, k, repeat):
    """Builds and k nearest of every point, float64 as SciPy has it; queries as they come and
    shuffled."""
    spatial, pykdtree = optional("scipy.spatial"), optional("pykdtree.kdtree")
    cloud = np.ascontiguousarray(cloud, np.float64)
    shuffled = np.random.default_rng(1).permutation(cloud)
    builds = {"raydix": lambda: raydix.Points(cloud)}
    index, asks = raydix.Points(cloud), {}
    asks["raydix"] = lambda q: index.knn(q, k)
    found = index.knn(shuffled, k)["distances"]
    if spatial is not None:
        theirs = spatial.cKDTree(cloud)
        np.testing.assert_allclose(theirs.query(shuffled, k, workers=-1)[0], found, rtol=1e-12)
        builds["cKDTree"] = lambda: spatial.cKDTree(cloud)
        asks["cKDTree, workers=-1"] = lambda q: theirs.query(q, k, workers=-1)
    if pykdtree is not None:
        other = pykdtree.KDTree(cloud)
        np.testing.assert_allclose(other.query(shuffled, k=k)[0], found, rtol=1e-12)
        builds["pykdtree"] = lambda: pykdtree.KDTree(cloud)
        asks["pykdtree"] = lambda q: other.query(q, k=k)
    size = len(cloud)
    yield from row(f"index of {size:,} points", "raydix", in_turn(builds, repeat), size)
    for name, queries in (("in the cloud's order", cloud), ("shuffled", shuffled)):
        calls = {who: (lambda ask=ask, q=queries: ask(q)) for who, ask in asks.items()}
        yield from row(f"{size:,} x {k} nearest, {name}", "raydix", in_turn(calls, repeat), size)


def bench_changing(cloud, k, repeat):
    """Queries of an index that was built from half of the points, the others put in in batches,
    beside a fresh index over the points that are in it at the end."""
    cloud = np.ascontiguousarray(cloud, np.float32)
    half, radius = len(cloud) // 2, 1.5 / len(cloud) ** (1 / 3)
    for batch, gone in ((10_000, 0.0), (1_000, 0.0), (10_000, 0.18)):
        index = raydix.Points(cloud[:half])
        start = time.perf_counter()
        for begin in range(half, len(cloud), batch):
            index.add(cloud[begin : begin + batch])
        added_us = (time.perf_counter() - start) * 1e6 / (len(cloud) - half)
        stays = np.random.default_rng(2).uniform(size=len(cloud)) >= gone
        index.remove(np.flatnonzero(~stays))
        fresh = raydix.Points(cloud[stays])
        numbers = np.flatnonzero(stays)
        queries = cloud[::7]
        assert (numbers[fresh.knn(queries, k)["indices"]] == index.knn(queries, k)["indices"]).all()
        what = f"half in by {batch:,}, {gone:.0%} removed"
        print(f"{what}: {added_us:.2f} us a point put in", flush=True)
        for name, ask in (
            (f"{k} nearest", lambda of: of.knn(queries, k)),
            ("radius", lambda of: of.radius(queries, radius)),
        ):
            calls = {"raydix, fresh": lambda a=ask, f=fresh: a(f), what: lambda a=ask: a(index)}
            yield from row(
                f"{len(queries):,} x {name}", "raydix, fresh", in_turn(calls, repeat), len(queries)
            )


def machine():
    versions = {}
    for name in ("numpy", "scipy", "embreex", "open3d", "pykdtree"):
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            versions[name] = None
    load = os.getloadavg()[0]
    when = datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds")
    return raydix.machine() | {
        "versions": versions,
        "load_before": load,
        "when": when,
        "raydix": raydix.__version__,
    }


def show(line):
    rate = (
        f"{line['us_per_call']:9.3f} us/call"
        if "us_per_call" in line
        else f"{line['million_per_s']:9.2f} M/s"
    )
    spread = f"({line['min']:.3f} to {line['max']:.3f})"
    print(
        f"{line['what']:44} {line['who']:32} {line['ms']:10.3f} ms {spread:28} {rate}"
        f"  x{line['ratio']:.2f}",
        flush=True,
    )


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene", nargs="?", default="builtin:figure?triangles=1000000")
    parser.add_argument("--quality", default="high")
    parser.add_argument("--rays", type=int, default=1_000_000)
    parser.add_argument("--points", default="1000000", help="a file, or how many uniform ones")
    parser.add_argument("-k", type=int, default=8)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--json")
    options = parser.parse_args()

    result = {"machine": machine(), "scene": options.scene, "quality": options.quality, "rows": []}
    scene = raydix.Scene(options.scene, quality=options.quality)
    in_double = raydix.Scene(
        scene.vertices.astype(np.float64), scene.faces, precision="float64", quality=options.quality
    )
    if options.points.isdigit():
        cloud = np.random.default_rng(1).uniform(size=(int(options.points), 3))
    else:
        cloud = load_points(options.points)
    for lines in (
        bench_rays(scene, in_double, options.rays, options.repeat),
        bench_one_ray(scene, options.repeat),
        bench_points(cloud, options.k, options.repeat),
        bench_changing(cloud, options.k, options.repeat),
    ):
        for line in lines:
            result["rows"].append(line)
            show(line)
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(result, file, indent=1)


if __name__ == "__main__":
    main()
