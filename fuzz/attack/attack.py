"""The standing attack on the Python package: seeded cases of its calls against NumPy brute force.

attack.py [--seconds S] [--seed N|fresh] [--kinds A,B,...] [--case I] [--json FILE]

Points are compared bit for bit: their distances are defined by a formula that NumPy can repeat. Rays, closest points and
inside tests are compared with float64 arithmetic wherever that is sure; where rounding could decide, a case says nothing.
Exit code 1 if anything was found.
"""
import argparse
import json
import secrets
import sys
import time
import traceback
import zlib

import numpy as np

import raydix

MISSING = 0xFFFFFFFF


class Tally:
    def __init__(self):
        self.cases, self.compared, self.findings, self.examples = {}, {}, {}, []

    def expect(self, right, kind, what, detail=""):
        """`right`: one bool or an array of them; each is one answer."""
        right = np.atleast_1d(right)
        self.compared[kind] = self.compared.get(kind, 0) + right.size
        if right.all():
            return
        name = f"{kind}: {what}"
        self.findings[name] = self.findings.get(name, 0) + int((~right).sum())
        if sum(example["what"] == name for example in self.examples) < 2:
            self.examples.append({"what": name, "where": self.where, "detail": f"{detail} at {np.flatnonzero(~right)[:5].tolist()}"})


# Meshes and rays.


def soup(rng, count):
    size = 10.0 ** rng.uniform(-2, 0, (count, 1, 1))
    corners = rng.uniform(-1, 1, (count, 1, 3)) + rng.uniform(-1, 1, (count, 3, 3)) * size
    return corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def needles(rng, count):
    start = rng.uniform(-1, 1, (count, 3))
    along = rng.uniform(-1, 1, (count, 3)) * 10.0 ** rng.uniform(1, 4)
    corners = np.stack([start, start + along, start + rng.uniform(-1, 1, (count, 3))], axis=1)
    return corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def whole_numbers(rng, count):
    return rng.integers(-3, 4, (3 * count, 3)).astype(float), np.arange(3 * count).reshape(-1, 3)


BOX_FACES = np.array([[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7], [0, 4, 2],
                      [2, 4, 6], [1, 3, 5], [3, 7, 5]])


def boxes(rng, count):
    """Closed boxes of whole numbers, and their corners (lo, hi)."""
    number = max(1, count // 12)
    lo = rng.integers(-3, 3, (number, 3)).astype(float)
    hi = lo + rng.integers(1, 4, (number, 3))
    vertices = np.array([[(lo, hi)[i >> axis & 1][k][axis] for axis in range(3)] for k in range(number) for i in range(8)])
    return vertices, np.concatenate([BOX_FACES + 8 * k for k in range(number)]), lo, hi


def any_mesh(rng, precision):
    vertices, faces = (soup, needles, whole_numbers, lambda r, n: boxes(r, n)[:2])[rng.integers(4)](rng, int(rng.integers(1, 40)))
    if rng.random() < 0.2:
        vertices = vertices * 10.0 ** rng.uniform(-4, 4)
    if precision == np.float64 and rng.random() < 0.5:
        vertices = vertices + rng.uniform(-1, 1, 3) * 1e6
    return vertices.astype(precision), faces.astype(np.uint32)


def any_rays(rng, vertices, faces, count):
    """Around the mesh, at its corners and surfaces, along axes; some with limits."""
    lo, hi = vertices.min(axis=0).astype(float), vertices.max(axis=0).astype(float)
    size = max(float((hi - lo).max()), 1e-6)
    origins = (lo + hi) / 2 + rng.uniform(-2, 2, (count, 3)) * size
    weights = rng.dirichlet(np.ones(3), count)
    targets = np.einsum("nk,nkd->nd", weights, vertices[faces[rng.integers(len(faces), size=count)]].astype(float))
    directions = targets - origins
    axis = rng.random(count) < 0.2
    directions[axis] = np.eye(3)[rng.integers(3, size=int(axis.sum()))]
    rays = np.empty((count, 8))
    rays[:, :3], rays[:, 3], rays[:, 4:7], rays[:, 7] = origins, 0, directions, np.inf
    limited = rng.random(count) < 0.2
    rays[limited, 7] = rng.uniform(0, 2, int(limited.sum()))
    return rays.astype(vertices.dtype)


def sure_hits(vertices, faces, rays, through_instances=False):
    """(t, sure to be hit, may be hit), each (rays, triangles), in float64; `sure` and `may` differ where rounding of the
    scene's type could decide."""
    eps = 64 * float(np.finfo(vertices.dtype).eps)
    v0, v1, v2 = (vertices[faces[:, i]].astype(float) for i in range(3))
    e1, e2 = v1 - v0, v2 - v0
    o, d = rays[:, None, :3].astype(float), rays[:, None, 4:7].astype(float)
    normal = np.cross(e1, e2)[None]
    s = o - v0[None]
    with np.errstate(all="ignore"):
        det = -(d * normal).sum(axis=2)
        q = np.cross(s, d)
        u = (e2[None] * q).sum(axis=2) / det
        v = -(e1[None] * q).sum(axis=2) / det
        t = (s * normal).sum(axis=2) / det
        length = np.linalg.norm(d, axis=2)
        longest = np.maximum(np.linalg.norm(e1, axis=1), np.linalg.norm(e2, axis=1))[None]
        # How far off the line may be for rounding, in weights of the triangle, seen along the ray.
        reach = np.linalg.norm(s, axis=2) + longest
        if through_instances:  # the ray is rounded once more, where the mesh is
            reach = reach + np.linalg.norm(o, axis=2) + np.abs(vertices).max(initial=0)
        slack = eps * reach * longest * length / np.abs(det) * (1 + longest ** 2 / np.linalg.norm(normal, axis=2))
        t_slack = eps * reach * longest * longest / np.abs(det) + eps * np.abs(t)
        known = np.isfinite(slack) & np.isfinite(t_slack)
        tmin, tmax = np.maximum(rays[:, 3:4].astype(float), 0), rays[:, 7:8].astype(float)
        sure = known & (u > slack) & (v > slack) & (u + v < 1 - slack) & (t > tmin + t_slack) & (t < tmax - t_slack)
        outside = (u < -slack) | (v < -slack) | (u + v > 1 + slack) | (t < tmin - t_slack) | (t > tmax + t_slack)
    return t, sure, ~(known & outside), t_slack


# Kinds. Each makes one case.


def attack_rays(rng, tally):
    precision = (np.float32, np.float64)[rng.integers(2)]
    vertices, faces = any_mesh(rng, precision)
    rays = any_rays(rng, vertices, faces, 120)
    t, sure, may, t_slack = sure_hits(vertices, faces, rays)
    scenes = []
    for i, builder in enumerate(raydix.builders()):
        # Rays in float32 go through a tree that the quality decides, in float64 through that of the builder.
        wide = {"quality": ("fast", "balanced", "high")[i % 3], "compact": i % 2 == 1} if precision is np.float32 else {}
        scenes.append(raydix.Scene(vertices, faces, precision=precision, builder=builder, max_leaf=int(rng.integers(1, 9)), threads=1, **wide))
    first = scenes[0].intersect(rays)
    for scene, builder in zip(scenes, raydix.builders()):
        hits = scene.intersect(rays)
        for field in ("t", "prim", "u", "v"):
            tally.expect(hits[field] == first[field], "rays", f"{field} depends on the builder", builder)
        occluded, counts, all_hits = scene.occluded(rays), scene.count(rays), scene.all_hits(rays)
        tally.expect(occluded == (hits["prim"] != MISSING), "rays", "occluded differs from intersect", builder)
        tally.expect(np.diff(all_hits["offsets"].astype(np.int64)) == counts, "rays", "count differs from all_hits", builder)
        tally.expect((counts >= sure.sum(axis=1)) & (counts <= may.sum(axis=1)), "rays", "count against brute force", builder)
    found = np.flatnonzero(first["prim"] != MISSING)
    tally.expect((first["prim"] != MISSING) | ~sure.any(axis=1), "rays", "a sure hit is lost")
    prim = first["prim"][found]
    tally.expect(may[found, prim], "rays", "a hit that cannot be")
    sure_ones = sure[found, prim]
    tally.expect(~sure_ones | (np.abs(first["t"][found].astype(float) - t[found, prim]) <= t_slack[found, prim]), "rays", "t of a sure hit")
    with np.errstate(invalid="ignore"):
        nearer = sure[found] & (t[found] + t_slack[found] < first["t"][found, None].astype(float))
    tally.expect(~nearer.any(axis=1), "rays", "a nearer sure hit is lost")


def attack_points(rng, tally):
    dtype, dimension = (np.float32, np.float64)[rng.integers(2)], int(rng.integers(2, 4))
    count = int(rng.integers(1, 300))
    points = rng.uniform(-1, 1, (count, dimension)) * 10.0 ** rng.uniform(-6, 6)
    if rng.random() < 0.4:
        points = np.round(points * 3 / np.abs(points).max())
    points = points.astype(dtype)
    points[rng.random(count) < 0.1] = points[0]
    points[rng.random(count) < 0.02] = np.nan
    queries = np.where(rng.random((40, 1)) < 0.5, points[rng.integers(count, size=40)],
                       (rng.uniform(-2, 2, (40, dimension)) * max(1e-6, np.nanmax(np.abs(points), initial=1e-6))).astype(dtype))
    index = raydix.Points(points, tree=("automatic", "kdtree", "bvh")[rng.integers(3)], threads=1)
    with np.errstate(all="ignore"):
        steps = queries[:, None, :] - points[None]
        d2 = steps[..., 0] * steps[..., 0] + steps[..., 1] * steps[..., 1]
        if dimension == 3:
            d2 = d2 + steps[..., 2] * steps[..., 2]
    d2[np.isnan(d2)] = np.inf
    valid = np.isfinite(points).all(axis=1)[None] & np.isfinite(queries).all(axis=1)[:, None]
    k = int(rng.integers(1, 12))
    rows = index.knn(queries, k)
    for q in range(len(queries)):
        ids = np.flatnonzero(valid[q])
        ids = ids[np.lexsort((ids, d2[q, ids]))][:k]
        got = rows["indices"][q]
        right = (got[:len(ids)] == ids).all() and (got[len(ids):] == MISSING).all()
        tally.expect(right and (rows["distances"][q, :len(ids)] == np.sqrt(d2[q, ids])).all(), "points", "knn", f"{dtype} {dimension}")
    radius = dtype(np.sqrt(d2[tuple(rng.integers(n) for n in d2.shape)]) if rng.random() < 0.5 else 10.0 ** rng.uniform(-6, 6))
    if not np.isfinite(radius):
        radius = dtype(1)
    with np.errstate(over="ignore"):
        within = valid & (d2 <= radius * radius)
    lists, counts = index.radius(queries, radius), index.count(queries, radius)
    tally.expect(counts == within.sum(axis=1), "points", "count")
    for q in range(len(queries)):
        row = slice(int(lists["offsets"][q]), int(lists["offsets"][q + 1]))
        ids = np.flatnonzero(within[q])
        tally.expect(np.array_equal(lists["indices"][row], ids) and np.array_equal(lists["distances"][row], np.sqrt(d2[q, ids])),
                     "points", "radius")
    lo, hi = np.minimum(queries[::2], queries[1::2]), np.maximum(queries[::2], queries[1::2])
    found = index.box(np.concatenate([lo, hi], axis=1))
    inside = ((points[None] >= lo[:, None]) & (points[None] <= hi[:, None])).all(axis=2)
    inside &= np.isfinite(points).all(axis=1)[None] & (np.isfinite(lo) & np.isfinite(hi)).all(axis=1)[:, None]
    for q in range(len(lo)):
        row = found["indices"][int(found["offsets"][q]):int(found["offsets"][q + 1])]
        tally.expect(np.array_equal(row, np.flatnonzero(inside[q])), "points", "box")


def distances_to(vertices, faces, queries):
    """(queries, triangles) in float64, by the seven regions of a triangle."""
    a, b, c = (vertices[faces[:, i]].astype(float)[None] for i in range(3))
    p = queries[:, None].astype(float)

    def to_segment(x, y):
        d = y - x
        with np.errstate(all="ignore"):
            s = np.nan_to_num(((p - x) * d).sum(axis=2) / (d * d).sum(axis=2))
        return np.linalg.norm(p - x - np.clip(s, 0, 1)[..., None] * d, axis=2)

    n = np.cross(b - a, c - a)
    sides = np.stack([(np.cross(n, y - x) * (p - x)).sum(axis=2) for x, y in ((a, b), (b, c), (c, a))])
    with np.errstate(all="ignore"):
        height = np.abs((n * (p - a)).sum(axis=2)) / np.linalg.norm(n, axis=2)
    height = np.where((sides > 0).all(axis=0) & np.isfinite(height), height, np.inf)
    return np.minimum(np.minimum(to_segment(a, b), to_segment(b, c)), np.minimum(to_segment(c, a), height))


def attack_closest(rng, tally):
    precision = (np.float32, np.float64)[rng.integers(2)]
    vertices, faces = any_mesh(rng, precision)
    scene = raydix.Scene(vertices, faces, precision=precision, builder=str(rng.choice(raydix.builders())), threads=1)
    size = float(np.abs(vertices).max()) + 1e-6
    queries = (vertices.mean(axis=0) + rng.uniform(-1, 1, (50, 3)) * size).astype(precision)
    nearest = distances_to(vertices, faces, queries)
    found = scene.closest_point(queries)
    edges = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, 1, axis=1)], axis=2).max(axis=1).astype(float)
    areas = np.linalg.norm(np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]), axis=1)
    stretch = (edges ** 2 / np.maximum(areas, 1e-30))[areas > 0].max(initial=1)
    slack = 64 * float(np.finfo(precision).eps) * (size + np.abs(queries).max()) * stretch
    tally.expect(np.abs(found["distance"] - nearest.min(axis=1)) <= slack, "closest", "distance of the closest point")
    tally.expect(nearest[np.arange(len(queries)), found["prim"]] <= nearest.min(axis=1) + slack, "closest", "prim of the closest point")
    balls = np.concatenate([queries, rng.uniform(0, size, (len(queries), 1))], axis=1).astype(precision)
    touched = scene.touched_by(spheres=balls)
    for q in range(len(balls)):
        row = touched["prim"][int(touched["offsets"][q]):int(touched["offsets"][q + 1])]
        flags = np.zeros(len(faces), bool)
        flags[row] = True
        clear = np.abs(nearest[q] - balls[q, 3]) > slack
        tally.expect(~clear | (flags == (nearest[q] < balls[q, 3])), "closest", "touched_by spheres")


def attack_solids(rng, tally):
    """Boxes of whole numbers: inside by comparison, no rounding anywhere."""
    vertices, faces, lo, hi = boxes(rng, int(rng.integers(1, 60)))
    precision = (np.float32, np.float64)[rng.integers(2)]
    scene = raydix.Scene(vertices.astype(precision), faces, precision=precision, builder=str(rng.choice(raydix.builders())), threads=1)
    queries = (rng.integers(-16, 17, (80, 3)) / 4).astype(precision)
    strictly = ((queries[:, None] > lo[None]) & (queries[:, None] < hi[None])).all(axis=2)
    closed = ((queries[:, None] >= lo[None]) & (queries[:, None] <= hi[None])).all(axis=2)
    on_surface = (closed & ~strictly).any(axis=1)
    inside = scene.contains(queries, rule="crossings")
    tally.expect(inside == closed.any(axis=1), "solids", "contains by crossings")
    tally.expect(scene.contains(queries, rule="parity") == (on_surface | (strictly.sum(axis=1) % 2 == 1)), "solids", "contains by parity")
    winding = np.abs(scene.winding_number(queries, rule="crossings"))
    tally.expect(on_surface | (winding == strictly.sum(axis=1)), "solids", "winding_number")
    signed, nearest = scene.signed_distance(queries, rule="crossings"), scene.closest_point(queries)["distance"]
    tally.expect(signed == np.where(inside, -nearest, nearest), "solids", "signed_distance")
    pairs = {tuple(pair) for pair in scene.overlaps().tolist()}
    corners = vertices[faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    meet = ((low[:, None] <= high[None]) & (low[None] <= high[:, None])).all(axis=2)
    shared = (corners[:, None, :, None] == corners[None, :, None, :]).all(axis=4).any(axis=(2, 3))
    wanted = {(int(i), int(j)) for i, j in np.argwhere(meet & ~shared) if i < j}
    tally.expect(pairs == wanted and scene.count_overlaps() == len(wanted), "solids", "overlaps")


def attack_instances(rng, tally):
    """Turned and moved copies against one mesh of all of them, wherever float64 is sure."""
    vertices, faces = soup(rng, int(rng.integers(1, 15)))
    places = int(rng.integers(1, 6))
    transforms = np.zeros((places, 3, 4))
    for place in transforms:
        place[:, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0] * rng.uniform(0.5, 2)
        place[:, 3] = rng.uniform(-2, 2, 3)
    vertices, transforms = vertices.astype(np.float32), transforms.astype(np.float32)
    many = raydix.Scene(threads=1)
    many.add(raydix.Scene(vertices, faces, threads=1), transforms)
    many.commit()
    world = np.concatenate([vertices.astype(float) @ place[:, :3].T + place[:, 3] for place in transforms.astype(float)])
    world = world.astype(np.float32)
    all_faces = np.concatenate([faces + len(vertices) * k for k in range(places)])
    rays = any_rays(rng, world, all_faces, 100)
    t, sure, may, t_slack = sure_hits(world, all_faces, rays, through_instances=True)
    hits = many.intersect(rays)
    hit = hits["prim"] != MISSING
    tally.expect(many.occluded(rays) == hit, "instances", "occluded differs from intersect")
    tally.expect(hit | ~sure.any(axis=1), "instances", "a sure hit is lost")
    tally.expect(np.diff(many.all_hits(rays)["offsets"].astype(np.int64)) == many.count(rays), "instances", "count differs from all_hits")
    tally.expect(all(many.path(number) == [number - 1] for number in np.unique(hits["instance"][hit]).tolist()), "instances", "path")
    rows = np.flatnonzero(hit)
    which = (hits["instance"][rows].astype(int) - 1) * len(faces) + hits["prim"][rows]
    tally.expect(may[rows, which], "instances", "a hit that cannot be")
    with np.errstate(invalid="ignore"):
        nearer = sure[rows] & (t[rows] + 16 * t_slack[rows] < hits["t"][rows, None])
    tally.expect(~nearer.any(axis=1), "instances", "a nearer sure hit is lost")


def attack_trees(rng, tally):
    vertices, faces = any_mesh(rng, np.float32)
    octree = raydix.octree(vertices, faces) if rng.random() < 0.5 else raydix.octree(vertices)
    for tree in (raydix.bvh(vertices, faces, builder=str(rng.choice(raydix.builders()))), raydix.kdtree(vertices, faces), octree):
        try:
            tree.check()
            tally.expect(True, "trees", "check")
        except Exception as error:  # noqa: BLE001: whatever it says is the finding
            tally.expect(False, "trees", f"check of {type(tree).__name__}", str(error))
    corners = rng.uniform(vertices.min(axis=0), vertices.max(axis=0), (2, 20, 3)).astype(np.float32)
    boxes_asked = np.concatenate([corners.min(axis=0), corners.max(axis=0)], axis=1)
    found = octree.points_in_boxes(boxes_asked)
    points, order = octree.points, octree.order
    for q, box in enumerate(boxes_asked):
        wanted = np.sort(order[((points >= box[:3]) & (points <= box[3:])).all(axis=1)])
        keys = [key for key in found if key != "offsets"]
        row = found[keys[0]][int(found["offsets"][q]):int(found["offsets"][q + 1])]
        tally.expect(np.array_equal(row, wanted), "trees", "points_in_boxes")


def attack_refit(rng, tally):
    vertices, faces = any_mesh(rng, np.float32)
    builder = str(rng.choice(["karras", "ploc", "binned", "sweep"]))
    scene = raydix.Scene(vertices, faces, builder=builder, threads=1)
    moved = (vertices @ np.linalg.qr(rng.normal(size=(3, 3)))[0] * rng.uniform(0.5, 2)).astype(np.float32)
    try:
        scene.refit(moved)
    except raydix.InputError:
        return
    rays = any_rays(rng, moved, faces, 80)
    fresh = raydix.Scene(moved, faces, builder=builder, threads=1).intersect(rays)
    for field, wanted in fresh.items():
        tally.expect(scene.intersect(rays)[field] == wanted, "refit", f"{field} after a refit", builder)


KINDS = {name.removeprefix("attack_"): function for name, function in sorted(globals().items()) if name.startswith("attack_")}


def run_case(kind, seed, index, tally):
    tally.where = f"--kinds {kind} --seed {seed} --case {index}"
    tally.cases[kind] = tally.cases.get(kind, 0) + 1
    try:
        KINDS[kind](np.random.default_rng([seed, zlib.crc32(kind.encode()), index]), tally)
    except Exception:  # noqa: BLE001: no call may fail on these inputs
        tally.expect(False, kind, "unexpected exception", traceback.format_exc(limit=-2))


def attack(seconds, seed, kinds=tuple(KINDS)):
    """Cases of all kinds in turn for some seconds -> Tally."""
    tally = Tally()
    spent = dict.fromkeys(kinds, 0.0)
    cases = dict.fromkeys(kinds, 0)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        kind = min(spent, key=spent.get)
        begin = time.monotonic()
        run_case(kind, seed, cases[kind], tally)
        cases[kind] += 1
        spent[kind] += time.monotonic() - begin
    return tally


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--seed", default="1")
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--case", type=int)
    parser.add_argument("--json")
    arguments = parser.parse_args()
    seed = secrets.randbits(48) if arguments.seed == "fresh" else int(arguments.seed)
    kinds = arguments.kinds.split(",")
    if not set(kinds) <= set(KINDS):
        parser.error("kinds: " + ", ".join(KINDS))
    print(f"seed {seed}", flush=True)
    if arguments.case is None:
        tally = attack(arguments.seconds, seed, kinds)
    else:
        tally = Tally()
        for kind in kinds:
            run_case(kind, seed, arguments.case, tally)
    for kind, count in sorted(tally.compared.items()):
        print(f"{kind:12s} {tally.cases.get(kind, 0):8,} cases {count:12,} answers compared")
    for example in tally.examples:
        print(f"FOUND {example['what']} ({example['where']})\n    {example['detail']}")
    print(f"{sum(tally.findings.values())} findings")
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as out:
            json.dump({"seed": seed, "cases": tally.cases, "compared": tally.compared, "findings": tally.findings,
                       "examples": tally.examples}, out, indent=1)
    return int(bool(tally.findings))


if __name__ == "__main__":
    sys.exit(main())
