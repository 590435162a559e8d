"""One rank of mpi_test.py: every answer of raydix.mpi beside that of one process, bit for bit."""

import itertools
import threading

import numpy as np
from mpi4py import MPI
from support import box_mesh, random_rays, random_triangles

import raydix
import raydix.mpi

COMM = MPI.COMM_WORLD
RANK, RANKS = COMM.rank, COMM.size
PARTITIONS = ("as_given", "curve")


def bounds(count, division):
    """Where each rank's part begins and ends: equal ones, all on the last rank, or none on even ranks."""
    shares = {
        "equal": np.ones(RANKS),
        "last": np.arange(RANKS) == RANKS - 1,
        "odd": np.arange(RANKS) % 2 == (RANKS > 1),
    }[division]
    ends = np.round(count * np.cumsum(shares) / shares.sum()).astype(int)
    return int(ends[RANK - 1]) if RANK else 0, int(ends[RANK])


def part(array, division):
    begin, end = bounds(len(array), division)
    return array[begin:end]


def same(found, expected, what):
    found, expected = np.ascontiguousarray(found), np.ascontiguousarray(expected)
    assert found.dtype == expected.dtype, (what, found.dtype, expected.dtype)
    assert found.shape == expected.shape, (what, found.shape, expected.shape)
    assert found.tobytes() == expected.tobytes(), what


def wide(numbers):
    """32-bit numbers of one process as 64-bit ones: what stands for nothing stays nothing."""
    numbers = np.asarray(numbers)
    return np.where(numbers == raydix.MISSING, raydix.mpi.MISSING, numbers.astype(np.uint64))


def refused(kind, text, call):
    """What call() raises on every rank."""
    try:
        call()
    except kind as error:
        assert text in str(error), (text, str(error))
    else:
        raise AssertionError(f"nothing was raised; expected {kind.__name__}: {text}")


def check_points(dtype, partition, division):
    rng = np.random.default_rng(3)
    points = rng.integers(0, 12, (700, 3)).astype(dtype) / 4  # many at equal distances
    points[40:60] = points[40]
    points[::97] = np.nan
    whole = raydix.Points(points, threads=1)
    queries = part(
        np.concatenate([points[:50], rng.uniform(-1, 4, (60, 3)).astype(dtype)]), division
    )
    with raydix.mpi.DistributedPoints(
        COMM, part(points, division), partition=partition, threads=1
    ) as spread:
        assert spread.dtype == dtype and len(spread) == 700
        assert spread.holding["left_out"] == len(points[::97])
        assert COMM.allreduce(spread.holding["local"]) == len(whole)
        for k in (1, 5, 900):
            one, many = whole.knn(queries, k), spread.knn(queries, k)
            same(many["indices"], wide(one["indices"]), "knn indices")
            same(many["distances"], one["distances"], "knn distances")
        assert spread.report["answered"] >= 0 and COMM.allreduce(spread.report["answered"]) > 0
        for sort in (False, True):
            one, many = whole.radius(queries, 0.5, sort=sort), spread.radius(
                queries, 0.5, sort=sort
            )
            same(many["offsets"], one["offsets"], "radius offsets")
            same(many["indices"], wide(one["indices"]), "radius indices")
            same(many["distances"], one["distances"], "radius distances")
        boxes = np.concatenate([np.nan_to_num(queries), np.nan_to_num(queries) + 1], axis=-1)
        one, many = whole.box(boxes), spread.box(boxes)
        same(many["offsets"], one["offsets"], "box offsets")
        same(many["indices"], wide(one["indices"]), "box indices")
        shaped = spread.knn(np.zeros((2, 3, 3), dtype), 4)
        assert shaped["indices"].shape == shaped["distances"].shape == (2, 3, 4)
        assert "700 points" in repr(spread)
    assert "freed" in repr(spread)
    refused(ValueError, "was freed", lambda: spread.knn(queries, 1))


def compare_hits(found, expected, what):
    for name in ("t", "u", "v", "geometry", "instance"):
        same(found[name], expected[name], f"{what}, {name}")
    same(found["prim"], wide(expected["prim"]), f"{what}, prim")


def compare_closest(spread, whole, points):
    for reach in (np.inf, 0.3):
        one = whole.closest_point(points, max_distance=reach)
        many = spread.closest_points(points, max_distance=reach)
        for name in ("point", "distance", "u", "v", "geometry", "instance"):
            same(many[name], one[name], f"closest, {name}")
        same(many["prim"], wide(one["prim"]), "closest, prim")


def geometries_of(rank, dtype):
    """Ranks differ in how many they give: meshes that overlap, an instance, and on some nothing."""
    if rank % 4 == 3:
        return []
    rng = np.random.default_rng(rank)
    soup = random_triangles(rng, 60)
    box = box_mesh((-0.4 - rank, -0.5, -0.5), (0.5, 0.6 + rank, 0.7))
    inner = raydix.Scene(*random_triangles(rng, 30), precision=dtype)
    inner.add_spheres(rng.uniform(-1, 1, (5, 3)), 0.1)
    inner.commit()
    place = np.array([[0.5, 0, 0, rank / 4], [0, 0.5, 0.1, 0], [0, 0, 0.5, 0.2]])
    centers = rng.uniform(-1, 1, (8, 3))
    return [
        soup,
        {"spheres": (centers, rng.uniform(0, 0.3, 8))},
        {"geometry": box, "mask": 0x3},
        {"capsules": (centers, centers[::-1], 0.05), "mask": 0x6},
        {"geometry": (inner, place), "mask": 0x5},
        {"points": (centers + 0.1, 0.1)},
    ]


def one_scene(dtype):
    scene = raydix.Scene(precision=dtype, threads=1)
    for rank in range(RANKS):
        for one in geometries_of(rank, dtype):
            one = dict(one) if isinstance(one, dict) else {"geometry": one}
            mask = one.pop("mask", 0xFFFFFFFF)
            ((kind, arguments),) = one.items()
            add = scene.add if kind == "geometry" else getattr(scene, f"add_{kind}")
            add(*arguments, mask=mask)
    scene.commit()
    return scene


def check_scene(dtype, partition):
    whole = one_scene(dtype)
    rng = np.random.default_rng(9)
    rays = random_rays(rng, 300)[RANK::RANKS].astype(dtype)
    rays[::13, 4:7] = 0
    masks = rng.integers(0, 8, len(rays), dtype=np.uint32)
    spread = raydix.mpi.DistributedScene(
        COMM, geometries_of(RANK, dtype), precision=dtype, partition=partition, threads=1
    )
    forms = {
        "rows": ((rays,), {}),
        "float64 columns": (
            (rays[:, :3].astype(np.float64), rays[:, 4:7]),
            {"tmax": 2.5, "tmin": rays[:, 3]},
        ),
        "masks": ((rays,), {"masks": masks}),
        "mask": ((rays,), {"mask": 4}),
    }
    for name, (given, options) in forms.items():
        compare_hits(spread.trace(*given, **options), whole.intersect(*given, **options), name)
        same(spread.trace_any(*given, **options), whole.occluded(*given, **options), name)
        one, many = whole.all_hits(*given, **options), spread.trace_all(*given, **options)
        same(many["offsets"], one["offsets"], name)
        compare_hits(many, one, f"all, {name}")
    first, paths = spread.holding["first_path"], spread.holding["paths"]
    assert first == COMM.scan(paths) - paths
    shaped = spread.trace(np.zeros((2, 0, 6), dtype))
    assert shaped["t"].shape == shaped["prim"].shape == (2, 0)
    compare_closest(spread, whole, rng.uniform(-1.5, 1.5, (40, 3)).astype(dtype)[RANK::RANKS])
    spread.free()
    spread.free()


def check_one_mesh(dtype, partition, division):
    """Parts of one mesh: numbers of triangles count through, and the body is closed as a whole."""
    outer, inner = box_mesh((-1, -1, -1), (1, 1, 1)), box_mesh((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    vertices = np.concatenate([outer[0], inner[0]])
    faces = np.concatenate([outer[1], inner[1] + 8])
    whole = raydix.Scene(vertices, faces, precision=dtype, threads=1)
    points = np.random.default_rng(5).uniform(-1.5, 1.5, (200, 3)).astype(dtype)
    points[:2] = [[1, 0.25, 0.5], [0.5, 0.5, 0.5]]
    asked = part(points, division)
    given = [(vertices, part(faces, division))] if len(part(faces, division)) else []
    with raydix.mpi.DistributedScene(
        COMM, given, one_geometry=True, precision=dtype, partition=partition, threads=1
    ) as spread:
        assert spread.holding["size"] == 24 and "24 elements" in repr(spread)
        compare_closest(spread, whole, asked)
        same(spread.contains(asked), whole.contains(asked, rule="parity"), "contains")
        found = spread.trace(asked, np.ones_like(asked))
        compare_hits(found, whole.intersect(asked, np.ones_like(asked)), "one mesh")


def check_changes(dtype):
    """What a scene shows that was changed after it was placed, or is changed meanwhile: what it showed then."""
    rng = np.random.default_rng(2)
    corners = rng.random((30000, 3)).astype(dtype)  # so many that memory goes back to the system
    faces = np.arange(30000).reshape(-1, 3)
    asked = rng.random((50, 3)).astype(dtype)
    inner = raydix.Scene(corners, faces, precision=dtype, threads=1)
    outer = raydix.Scene(precision=dtype, threads=1)
    outer.add(inner, np.eye(4))
    outer.commit()
    place = np.eye(3, 4) + [0, 0, 0, RANK / 4]

    def flat(height):
        return np.tile([[0, 0, height], [1, 0, height], [0, 1, height]], (10000, 1)).astype(dtype)

    def spread(scene):
        return raydix.mpi.DistributedScene(COMM, [(scene, place)], precision=dtype, threads=1)

    def answers(many):
        closest = many.closest_points(asked)
        return [*closest.values(), many.contains(asked), *many.trace(asked, asked).values()]

    untouched = [answers(spread(scene)) for scene in (inner, outer)]
    changed = [spread(scene) for scene in (inner, outer)]
    inner.update(0, flat(0))
    inner.commit()
    outer.commit()
    for many, expected in zip(changed, untouched, strict=True):
        for found, value in zip(answers(many), expected, strict=True):
            same(found, value, "after a change of what was placed")
        many.free()

    ended = threading.Event()

    def change():
        for height in itertools.cycle((1, 2)):
            inner.update(0, flat(height))
            inner.commit()
            if ended.is_set():
                return

    changing = threading.Thread(target=change)
    changing.start()
    for _ in range(20):
        with spread(inner) as many:
            found = many.closest_points(place[:, 3] + [0.25, 0.25, 1])["point"]
            assert (found * 4 % 1 == 0).all(), found
    ended.set()
    changing.join()


def check_errors():
    """Bad arguments on one rank are raised on all, and nothing waits for ever."""
    bad = RANKS - 1
    at = lambda wrong, right: wrong if RANK == bad else right  # noqa: E731
    zeros, where = np.zeros((4, 3), np.float32), f"rank {bad}: "
    Points, Scene = raydix.mpi.DistributedPoints, raydix.mpi.DistributedScene
    refused(TypeError, "mpi4py", lambda: Points("world", zeros))
    refused(ValueError, "COMM_NULL", lambda: Points(MPI.COMM_NULL, zeros))
    refused(ValueError, where + "points: ", lambda: Points(COMM, at(zeros[:, :2], zeros)))
    refused(TypeError, where + "points: ", lambda: Points(COMM, at("points", zeros)))
    refused(ValueError, where + "partition: ", lambda: Points(COMM, zeros, partition=at("x", "curve")))
    refused(ValueError, where + "threads: ", lambda: Points(COMM, zeros, threads=at(-1, 1)))
    refused(ValueError, where + "boxes_per_rank: ", lambda: Points(COMM, zeros, boxes_per_rank=at(0, 1)))
    strict = at(np.full((1, 3), np.nan, np.float32), zeros)
    refused(raydix.InputError, where + "point 0", lambda: Points(COMM, strict, strict=True))
    refused(TypeError, where + "geometries: ", lambda: Scene(COMM, at(zeros, [])))
    mesh = (zeros, [[0, 1, 2]])
    for wrong, kind, text in [
        ([(zeros, [[0, 1, 4]])], ValueError, "geometries[0], faces: face 0"),
        ([mesh, (zeros,)], TypeError, "geometries[1]: "),
        ([{"geometry": mesh, "masks": 1}], TypeError, "geometries[0]: "),
        ([{"spheres": (zeros, [1, 2])}], ValueError, "geometries[0], spheres: radii: "),
        ([{"spheres": (zeros,)}], TypeError, "geometries[0], spheres: "),
        ([{"points": (zeros, -1)}], ValueError, "geometries[0], points: radius: "),
        ([{"spheres": (zeros, 1), "points": (zeros, 1)}], TypeError, "geometries[0]: "),
        ([{"geometry": mesh, "mask": -1}], ValueError, "geometries[0], mask: "),
        ([(raydix.Scene(precision="float64"), np.eye(4))], TypeError, "geometries[0]: "),
        ([(raydix.Scene(), np.eye(4))], raydix.InputError, ""),
        ([(raydix.Scene(*mesh), np.zeros((3, 4)))], raydix.InputError, ""),
        ([(raydix.Scene(*mesh), np.zeros((2, 3, 4)))], ValueError, "geometries[0]: expected one"),
    ]:
        refused(kind, where + text, lambda wrong=wrong: Scene(COMM, at(wrong, [mesh])))
    with Points(COMM, zeros) as points:
        refused(ValueError, where + "k: ", lambda: points.knn(zeros, at(0, 1)))
        refused(ValueError, where + "queries: ", lambda: points.knn(at(zeros[:, :2], zeros), 1))
        refused(TypeError, where + "r: ", lambda: points.radius(zeros, at("1", 1)))
        refused(raydix.InputError, "radius", lambda: points.radius(zeros, -1.0))
        refused(ValueError, where + "boxes: ", lambda: points.box(at(zeros, np.zeros((1, 6)))))
        refused(raydix.InputError, where + "knn", lambda: points.knn(zeros, 4, max_result_bytes=at(1, 0)))
        if RANKS > 1:
            refused(raydix.InputError, "the ranks differ", lambda: points.knn(zeros, at(2, 1)))
            refused(
                raydix.InputError,
                "the ranks differ",
                lambda: points.box(np.zeros((1, 6))) if RANK == bad else points.knn(zeros, 1),
            )
        assert (points.knn(zeros, 1)["indices"] == 0).all()  # it still answers
        refused(TypeError, "pickled", lambda: points.__reduce__())
    with Scene(COMM, [mesh]) as scene:
        refused(ValueError, where + "rays: ", lambda: scene.trace(at(zeros, np.zeros((1, 6)))))
        refused(ValueError, where + "masks: ", lambda: scene.trace_any(np.zeros((1, 8)), masks=at([1, 2], [1])))
        refused(raydix.InputError, "max_distance", lambda: scene.closest_points(zeros, max_distance=-1))
        refused(ValueError, where + "points: ", lambda: scene.contains(at(zeros[0, :2], zeros)))
    if RANKS > 1:
        doubles = zeros.astype(at(np.float64, np.float32))
        refused(raydix.InputError, "the ranks differ", lambda: Points(COMM, doubles))
        precision = at("float64", "float32")
        refused(raydix.InputError, "the ranks differ", lambda: Scene(COMM, [mesh], precision=precision))
        half = COMM.Split(RANK % 2)
        between = half.Create_intercomm(0, COMM, 1 - RANK % 2)
        refused(ValueError, "between two", lambda: Points(between, zeros))
        with Points(half, zeros) as points:  # a communicator of some of the ranks
            assert len(points) == 4 * half.size
        between.Free()
        half.Free()


def check_empty():
    for empty in ([], np.zeros((0, 3), np.float64)):
        with raydix.mpi.DistributedPoints(COMM, empty) as points:
            assert points.dtype == (np.float32) and len(points) == 0
            found = points.knn(np.zeros((2, 3)), 1)
            assert (found["indices"] == raydix.mpi.MISSING).all() and np.isinf(found["distances"]).all()
    with raydix.mpi.DistributedScene(COMM, []) as scene:
        assert not scene.trace_any(np.ones((2, 6))).any()
        assert (scene.trace(np.ones((2, 6)))["prim"] == raydix.mpi.MISSING).all()
        assert not scene.contains(np.zeros((3, 3))).any()
    kept = [raydix.mpi.DistributedPoints(COMM, np.zeros((2, 3))) for _ in range(3)]
    kept.pop()  # without free(): the last reference does it
    return kept  # and so does the end of the program


for dtype in (np.dtype(np.float32), np.dtype(np.float64)):
    for partition, division in zip(PARTITIONS * 2, ("equal", "last", "odd", "equal"), strict=True):
        check_points(dtype, partition, division)
        check_one_mesh(dtype, partition, division)
    for partition in PARTITIONS:
        check_scene(dtype, partition)
    check_changes(dtype)
check_errors()
KEPT = check_empty()
COMM.Barrier()
print("all checks passed")
