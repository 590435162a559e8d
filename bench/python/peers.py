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
import raydix.open3d
import raydix.scipy
from raydix.points import load_points


def optional(name):
    try:
        return __import__(name, fromlist=["_"])
    except (ImportError, OSError) as error:
        print(f"{name} is left out: {error}", file=sys.stderr)
        return None


SHORTEST_MS = 5.0
"""A call that takes less is made several times, and the time is divided."""


def in_turn(calls, repeat):
    """{name: call} -> {name: [(milliseconds, milliseconds of processors)]}, one for each round.

    Every round makes all calls, one after the other. Before that each is warmed up and tried."""
    often = {}
    for name, call in calls.items():
        call()
        start = time.perf_counter()
        call()
        often[name] = max(1, int(SHORTEST_MS / 1e3 / (time.perf_counter() - start)))
    times = {name: [] for name in calls}
    for _ in range(repeat):
        for name, call in calls.items():
            start, processors = time.perf_counter(), time.process_time()
            for _ in range(often[name]):
                call()
            wall = time.perf_counter() - start
            processors = time.process_time() - processors
            times[name].append((wall * 1e3 / often[name], processors * 1e3 / often[name]))
    return times


def row(what, ours, times, unit_count=None):
    """One line for each peer: medians in ms, spread, and how much faster we are: the median of the
    ratios of the rounds, since what else the machine does changes from round to round."""
    lines = []
    for name, values in times.items():
        wall = [value[0] for value in values]
        ratios = sorted(value[0] / base[0] for value, base in zip(values, times[ours], strict=True))
        line = {
            "what": what,
            "who": name,
            "ms": round(statistics.median(wall), 5),
            "min": round(min(wall), 5),
            "max": round(max(wall), 5),
            "processors_ms": round(statistics.median(value[1] for value in values), 5),
            "ratio": round(statistics.median(ratios), 3),
            "ratio_of_processors": round(
                statistics.median(v[1] / b[1] for v, b in zip(values, times[ours], strict=True)), 3
            ),
            "ratio_quartiles": [round(ratios[(len(ratios) - 1) * q // 4], 3) for q in (1, 3)],
        }
        if unit_count:
            line["million_per_s"] = round(unit_count / line["ms"] / 1e3, 3)
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


def stand_in(scene):
    """`raydix.open3d.RaycastingScene` on the same tree options."""
    peer = raydix.open3d.RaycastingScene()
    peer._scene = scene
    return peer


def bench_rays(scene, in_double, wanted, repeat):
    """Closest hits. embreex gives ids, with output=1 also t, u, v; ours always gives all four, and
    Open3D's class and its stand-in normals too. The scene in float64 gets the same rays as float64
    arrays. Fewer rays are every n-th of the most."""
    embree, (open3d, o3d) = embree_scene(scene), open3d_scene(scene)
    as_open3d = stand_in(scene)
    for kind, every in ray_kinds(scene, wanted).items():
        for count in sorted({len(every), *(n for n in (1_000, 10_000, 100_000) if n < wanted)})[
            ::-1
        ]:
            rays = np.ascontiguousarray(every[:: max(1, len(every) // count)][:count])
            origins, directions = rays[:, :3].copy(), rays[:, 4:7].copy()
            six = np.concatenate([origins, directions], axis=1)
            ours = scene.intersect(rays)["prim"]
            calls = {"raydix": lambda r=rays: scene.intersect(r)}
            calls["raydix, origins and directions"] = lambda o=origins, d=directions: (
                scene.intersect(o, d)
            )
            calls["raydix.open3d"] = lambda r=six: as_open3d.cast_rays(r)
            if open3d is not None:
                tensor = o3d.core.Tensor(six)
                theirs = open3d.cast_rays(tensor)
                agreement(ours, theirs["primitive_ids"].numpy())
                calls["open3d"] = lambda r=tensor: open3d.cast_rays(r)
            if embree is not None:
                agreement(ours, embree.run(origins, directions).astype(np.int64).astype(np.uint32))
                calls["embreex, ids"] = lambda o=origins, d=directions: embree.run(o, d)
                calls["embreex, ids t u v"] = lambda o=origins, d=directions: embree.run(
                    o, d, output=1
                )
            if count == len(every):
                wide = rays.astype(np.float64)
                agreement(ours, in_double.intersect(wide)["prim"])
                calls["raydix, float64"] = lambda w=wide: in_double.intersect(w)
            yield from row(f"{count:,} {kind} rays", "raydix", in_turn(calls, repeat), count)


def bench_one_ray(scene, repeat):
    """What a call with one ray costs, in microseconds."""
    embree = embree_scene(scene)
    ray = scene.primary_rays(size=(9, 9))["rays"][40:41].copy()
    origin, direction = ray[:, :3].copy(), ray[:, 4:7].copy()
    calls = {
        "raydix": lambda: scene.intersect(ray),
        "raydix, occluded": lambda: scene.occluded(ray),
        "raydix, origins and directions": lambda: scene.intersect(origin, direction),
    }

    def read():
        hits = scene.intersect(origin, direction)
        return hits["t"], hits["prim"], hits["u"], hits["v"]

    calls["raydix, and t prim u v read"] = read
    if embree is not None:
        calls["embreex, ids"] = lambda: embree.run(origin, direction)
        calls["embreex, ids t u v"] = lambda: embree.run(origin, direction, output=1)
    for line in row("one ray", "raydix, origins and directions", in_turn(calls, 5 * repeat)):
        line["us_per_call"] = round(line["ms"] * 1e3, 3)
        line["us_of_processor"] = round(line["processors_ms"] * 1e3, 3)
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


def bench_long_way(k, repeat):
    """The stand-in for cKDTree where the index names candidates only."""
    spatial = optional("scipy.spatial")
    if spatial is None:
        return
    for what, size, m, box, p in (
        ("periodic box", 200_000, 3, 1.0, 2),
        ("p = 1", 200_000, 3, None, 1),
        ("p = infinity", 200_000, 3, None, np.inf),
        ("4 dimensions", 200_000, 4, None, 2),
        ("5 dimensions", 50_000, 5, None, 2),
        ("8 dimensions", 10_000, 8, None, 2),
    ):
        data = np.random.default_rng(3).uniform(size=(size, m))
        ours = raydix.scipy.cKDTree(data, boxsize=box)
        theirs = spatial.cKDTree(data, boxsize=box)
        queries = data[: size // 4]
        found, wanted = (tree.query(queries, k, p=p, workers=-1)[0] for tree in (ours, theirs))
        np.testing.assert_allclose(found, wanted, rtol=1e-12)
        calls = {
            who: (lambda t=tree, q=queries, p=p: t.query(q, k, p=p, workers=-1))
            for who, tree in (("raydix.scipy", ours), ("cKDTree, workers=-1", theirs))
        }
        yield from row(f"{k} nearest, {what}", "raydix.scipy", in_turn(calls, repeat), len(queries))


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
    low, high = line["ratio_quartiles"]
    print(
        f"{line['what']:44} {line['who']:32} {line['ms']:10.3f} ms {spread:28} {rate}"
        f"  x{line['ratio']:.2f} ({low:.2f} to {high:.2f})"
        f" processors x{line['ratio_of_processors']:.2f}",
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
    parser.add_argument("--repeat", type=int, default=9, help="rounds")
    parser.add_argument("--only", nargs="*", help="rays, one, points, changing, dimensions")
    parser.add_argument("--json")
    options = parser.parse_args()

    name = os.path.basename(options.scene)
    result = {"machine": machine(), "scene": name, "quality": options.quality, "rows": []}
    scene = raydix.Scene(options.scene, quality=options.quality)
    in_double = raydix.Scene(
        scene.vertices.astype(np.float64), scene.faces, precision="float64", quality=options.quality
    )
    if options.points.isdigit():
        cloud = np.random.default_rng(1).uniform(size=(int(options.points), 3))
    else:
        cloud = load_points(options.points)
    parts = {
        "rays": lambda n: bench_rays(scene, in_double, options.rays, n),
        "one": lambda n: bench_one_ray(scene, n),
        "points": lambda n: bench_points(cloud, options.k, n),
        "changing": lambda n: bench_changing(cloud, options.k, n),
        "dimensions": lambda n: bench_long_way(options.k, n),
    }
    for part in options.only or parts:
        for line in parts[part](options.repeat):
            result["rows"].append(line)
            show(line)
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(result, file, indent=1)


if __name__ == "__main__":
    main()
