"""raydix.scipy.cKDTree against brute force and SciPy's class, and SciPy's own tests on it."""

import itertools
import pathlib
import re

import numpy as np
import pytest
import support

import raydix
from raydix.scipy import KDTree, cKDTree

BOXES = {"open": None, "periodic": (1.0, 1.0, 1.0, 1.0, 1.0), "one axis": (0, 1.0, 0, 0, 0)}
NORMS = (1, 1.5, 2, 7, np.inf)


@pytest.fixture(
    params=list(itertools.product(BOXES, (1, 2, 3, 5))), ids=lambda pair: f"{pair[0]}-{pair[1]}D"
)
def case(request, rng):
    """A tree over 300 points of which some are equal, 60 queries that the box may have to wrap, and
    how far apart they are along each axis, (60, 300, m)."""
    name, m = request.param
    boxsize = None if BOXES[name] is None else np.array(BOXES[name][:m])
    data = rng.uniform(size=(300, m))
    data[:20] = data[0]
    queries = np.concatenate([rng.uniform(-0.2, 1.2, (50, m)), data[15:25]])
    apart = np.abs(queries[:, None] - data)
    if boxsize is not None:
        wrapped = np.where(boxsize > 0, queries % 1.0, queries)
        apart = np.abs(wrapped[:, None] - data)
        apart = np.where(boxsize > 0, np.minimum(apart, 1 - apart), apart)
    return cKDTree(data, boxsize=boxsize), queries, apart


@pytest.mark.parametrize("p", NORMS)
def test_neighbours_equal_brute_force(case, p):
    tree, queries, apart = case
    wanted = np.linalg.norm(apart, p, axis=-1)
    for k in (1, 4, 25, 300, 310):
        distances, indices = tree.query(queries, k, p=p)
        distances, indices = distances.reshape(60, k), indices.reshape(60, k)
        some = min(k, 300)
        np.testing.assert_allclose(
            distances[:, :some], np.sort(wanted, axis=1)[:, :some], rtol=1e-12, atol=1e-15
        )
        assert all(len(set(row)) == some for row in indices[:, :some].tolist())
        np.testing.assert_allclose(
            distances[:, :some],
            np.take_along_axis(wanted, indices[:, :some], axis=1),
            rtol=1e-12,
            atol=1e-15,
        )
        assert (indices[:, some:] == 300).all() and np.isinf(distances[:, some:]).all()
    assert tree.query(queries[-8], 5, p=p)[1].tolist() == [0, 1, 2, 3, 4]  # equal: by index
    assert (tree.query(queries, 3, p=p, distance_upper_bound=0)[1] == 300).all()


@pytest.mark.parametrize("p", NORMS)
def test_bounds_of_distance_drop_what_is_not_nearer(case, p):
    tree, queries, _ = case
    far, who = tree.query(queries, 7, p=p)
    for bound in (0.02, 0.2, far[3, 2], np.nextafter(far[3, 2], 1), far.max(), np.inf, -1, np.nan):
        distances, indices = tree.query(queries, 7, p=p, distance_upper_bound=bound)
        nearer = far < bound
        np.testing.assert_array_equal(distances, np.where(nearer, far, np.inf))
        np.testing.assert_array_equal(indices, np.where(nearer, who, 300))


@pytest.mark.parametrize(
    ("p", "boxsize", "most"), [(1, None, 0.101), (np.inf, None, 0.174), (2, 1, 0.101)]
)
def test_bounds_of_distance_limit_the_search(monkeypatch, rng, p, boxsize, most):
    tree = cKDTree(rng.uniform(size=(300, 3)), boxsize=boxsize)
    reached = []
    knn, radius = raydix.Points.knn, raydix.Points.radius

    def seen_knn(self, *arguments, max_distance=np.inf, **options):
        reached.append(max_distance)
        return knn(self, *arguments, max_distance=max_distance, **options)

    def seen_radius(self, queries, r, **options):
        reached.append(np.max(r, initial=0))
        return radius(self, queries, r, **options)

    monkeypatch.setattr(raydix.Points, "knn", seen_knn)
    monkeypatch.setattr(raydix.Points, "radius", seen_radius)
    tree.query(rng.uniform(size=(50, 3)), 9, p=p, distance_upper_bound=0.1)
    assert len(reached) > 1 and max(reached) < most


@pytest.mark.parametrize("p", NORMS)
def test_everything_within_a_distance_equals_brute_force(case, p, rng):
    tree, queries, apart = case
    wanted = np.linalg.norm(apart, p, axis=-1)
    for r in (0.0, 0.13, 0.45, np.inf, rng.uniform(0, 0.6, 60)):
        near = wanted <= (r if np.ndim(r) == 0 else r[:, None])
        found = tree.query_ball_point(queries, r, p=p, workers=-1)
        assert found.tolist() == [np.flatnonzero(row).tolist() for row in near]
        counts = tree.query_ball_point(queries, r, p=p, return_length=True)
        np.testing.assert_array_equal(counts, near.sum(axis=1))
    assert (
        tree.query_ball_point(queries[-1], 0.2, p=p) == np.flatnonzero(wanted[-1] <= 0.2).tolist()
    )


@pytest.mark.parametrize("p", NORMS)
def test_pairs_of_two_trees_equal_brute_force(case, p, rng):
    tree, queries, apart = case
    if tree.boxsize is not None:
        queries = np.where(tree.boxsize > 0, queries % 1.0, queries)
    other = cKDTree(queries, boxsize=tree.boxsize)
    wanted = np.linalg.norm(apart, p, axis=-1)
    near = wanted <= 0.3
    assert other.query_ball_tree(tree, 0.3, p=p) == [np.flatnonzero(row).tolist() for row in near]
    table = other.sparse_distance_matrix(tree, 0.3, p=p, output_type="ndarray")
    assert set(zip(table["i"].tolist(), table["j"].tolist(), strict=True)) == set(
        map(tuple, np.argwhere(near).tolist())
    )
    np.testing.assert_allclose(table["v"], wanted[table["i"], table["j"]], rtol=1e-12)
    as_dict = other.sparse_distance_matrix(tree, 0.3, p=p, output_type="dict")
    assert as_dict == {(i, j): v for i, j, v in table.tolist()}

    radii = np.array([0.4, 0.0, 0.1, 0.1, 2.0, -1.0])
    w, v = rng.uniform(size=60), rng.uniform(size=300)
    counts = [(wanted <= r).sum() if r >= 0 else 0 for r in radii]
    assert other.count_neighbors(tree, radii, p=p).tolist() == counts
    assert other.count_neighbors(tree, 0.4, p=p) == counts[0]
    for pair in ((w, v), (w, None), (None, v)):
        first, second = (
            x if x is not None else np.ones(n) for x, n in zip(pair, (60, 300), strict=True)
        )
        sums = [((wanted <= r) * first[:, None] * second).sum() if r >= 0 else 0 for r in radii]
        found = other.count_neighbors(tree, radii, p=p, weights=pair)
        np.testing.assert_allclose(found, sums, rtol=1e-12)
    bins = np.array([0.0, 0.1, 0.2, 0.9])
    cumulative = other.count_neighbors(tree, bins, p=p)
    steps = other.count_neighbors(tree, bins, p=p, cumulative=False)
    assert steps.cumsum().tolist() == cumulative.tolist() and steps.dtype == cumulative.dtype


@pytest.mark.parametrize("p", NORMS)
def test_pairs_within_a_tree(case, p):
    tree, _, _ = case
    pairs = tree.query_pairs(0.2, p=p, output_type="ndarray")
    lists = tree.query_ball_tree(tree, 0.2, p=p)
    assert pairs.tolist() == [[i, j] for i, row in enumerate(lists) for j in row if i < j] != []
    assert tree.query_pairs(0.2, p=p) == set(map(tuple, pairs.tolist()))


def test_many_candidates_go_in_batches(rng, monkeypatch):
    import raydix._distances

    data = np.concatenate([rng.uniform(size=(500, 3)), rng.normal(0.5, 1e-4, (2000, 3))])
    tree = cKDTree(data, boxsize=1)
    counts = tree.query_ball_point(data, 0.05, p=1, return_length=True)
    nearest = tree.query(data, 6, p=1)
    monkeypatch.setattr(raydix._distances, "CANDIDATES", 1000)
    monkeypatch.setattr(raydix._distances, "BATCH_BYTES", 100_000)
    np.testing.assert_array_equal(
        tree.query_ball_point(data, 0.05, p=1, return_length=True), counts
    )
    for a, b in zip(tree.query(data, 6, p=1), nearest, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("scale", [1e-100, 1e-5, 1e100])
def test_large_and_small_numbers_with_any_p(scale):
    if scale < 1:
        tree = cKDTree(np.array([[0, 0, 0], [3, 4, 12], [100, 0, 0]]) * scale)
        assert tree.query([0, 0, 0], [2], p=50)[0][0] == pytest.approx(12 * scale)
    else:
        with pytest.raises(ValueError):
            cKDTree(np.eye(3) * scale)


@pytest.fixture(params=[1, 2, 3, 4])
def both(request, rng):
    spatial = support.peer("scipy.spatial")
    data = rng.normal(size=(2000, request.param))
    return spatial.cKDTree(data), cKDTree(data), rng.normal(size=(30, 40, request.param)), data


@pytest.mark.parametrize("k", [1, 2, 150, [1], [2, 5], 2001])
def test_query_as_scipy(both, k):
    theirs, ours, x, _ = both
    for queries in (x, x[0], x[0, 0]):
        (d, i), (d2, i2) = theirs.query(queries, k), ours.query(queries, k, workers=-1)
        assert np.shape(d) == np.shape(d2) and np.shape(i) == np.shape(i2)
        assert type(i) is type(i2) and type(d) is type(d2)
        np.testing.assert_allclose(d2, d, rtol=1e-14)
        np.testing.assert_array_equal(i2, i)
    (d, i), (d2, i2) = (tree.query(x, 5, distance_upper_bound=0.1) for tree in (theirs, ours))
    np.testing.assert_array_equal(i2, i)
    np.testing.assert_allclose(d2, d, rtol=1e-14)


def test_query_ball_point_as_scipy(both, rng):
    theirs, ours, x, _ = both
    for r in (0.2, rng.uniform(0, 0.4, (30, 40))):
        a, b = theirs.query_ball_point(x, r, return_sorted=True), ours.query_ball_point(x, r)
        assert a.shape == b.shape and a.dtype == b.dtype
        assert all(m == n for m, n in zip(a.flat, b.flat, strict=True))
        np.testing.assert_array_equal(
            ours.query_ball_point(x, r, return_length=True),
            theirs.query_ball_point(x, r, return_length=True),
        )
    one = theirs.query_ball_point(x[0, 0], 0.5)
    assert ours.query_ball_point(x[0, 0], 0.5) == sorted(one)
    assert ours.query_ball_point(x[0, 0], 0.5, return_length=True) == len(one)


def test_pairs_and_matrices_as_scipy(both):
    theirs, ours, x, data = both
    assert ours.query_pairs(0.1) == theirs.query_pairs(0.1) != set()
    a = theirs.query_pairs(0.1, output_type="ndarray")
    np.testing.assert_array_equal(
        ours.query_pairs(0.1, output_type="ndarray"), a[np.lexsort(a.T[::-1])]
    )
    matrix = ours.sparse_distance_matrix(ours, 0.1)
    wanted = theirs.sparse_distance_matrix(theirs, 0.1)
    assert type(matrix) is type(wanted) and abs(matrix - wanted).max() < 1e-12
    kind = ours.sparse_distance_matrix(ours, 0.1, output_type="coo_matrix")
    assert kind.format == "coo" and kind.nnz == wanted.tocoo().nnz
    weights = np.arange(len(data), dtype=np.float64)
    for options in ({}, {"cumulative": False}, {"weights": weights}):
        np.testing.assert_allclose(
            ours.count_neighbors(ours, [0.1, 0.2, 1.0], **options),
            theirs.count_neighbors(theirs, [0.1, 0.2, 1.0], **options),
        )
    assert type(ours.count_neighbors(ours, 0.1)) is type(theirs.count_neighbors(theirs, 0.1))
    assert ours.n == theirs.n and ours.m == theirs.m and (ours.maxes == theirs.maxes).all()
    assert (ours.data == data).all() and (np.sort(ours.indices) == np.sort(theirs.indices)).all()
    assert isinstance(KDTree(data).query(x[0, 0])[1], np.intp)


def test_what_is_refused():
    tree = cKDTree(np.eye(3))
    plane, box = cKDTree(np.zeros((4, 2))), cKDTree(np.zeros((4, 3)), boxsize=1)
    for call, text in (
        (lambda: cKDTree([[np.nan, 0, 0]]), "data: must be finite"),
        (lambda: cKDTree(np.zeros((2, 3, 3))), "data: expected shape"),
        (lambda: cKDTree([[0, 0.5], [0, 1]], boxsize=[0, 1]), "data: point 1 is at 1.0 on axis 1"),
        (lambda: cKDTree([[-1, 0]], boxsize=1), "data: point 0 is at -1.0 on axis 0"),
        (lambda: cKDTree([[0, 0]], boxsize=np.nan), "boxsize: must be finite"),
        (lambda: tree.query([0, 0, np.inf]), "x: must be finite"),
        (lambda: tree.query([0, 0, 0], k=0), "k: neighbours are counted from 1"),
        (lambda: tree.query([0, 0, 0], k=None), "k must be an integer or a sequence"),
        (lambda: tree.query([0, 0, 0], p=0.5), "p: expected a number from 1"),
        (lambda: tree.query([0, 0, 0], p=np.nan), "p: expected a number from 1"),
        (lambda: tree.query_pairs(1, output_type="list"), "output_type: expected 'set'"),
        (lambda: tree.sparse_distance_matrix(tree, 1, output_type="csr"), "output_type: expected"),
        (lambda: tree.query_ball_tree(plane, 1), "other: has another number of dimensions"),
        (lambda: tree.count_neighbors(box, 1), "other: .* another boxsize"),
        (lambda: tree.count_neighbors(tree, [[1]]), "r: expected a number or shape"),
        (lambda: tree.count_neighbors(tree, [2, 1], cumulative=False), "r: must not descend"),
        (lambda: tree.count_neighbors(cKDTree(np.eye(3)), 1, weights=np.ones(3)), "weights: one"),
        (lambda: tree.count_neighbors(tree, 1, weights=np.ones(4)), "weights: expected shape"),
    ):
        with pytest.raises(ValueError, match=text):
            call()
    with pytest.raises(TypeError, match="other: expected"):
        tree.query_ball_tree(np.eye(3), 1)
    for call in (cKDTree, tree.query, lambda x: tree.query_ball_point(x, 1)):
        with pytest.raises(TypeError, match="complex data"):
            call(np.eye(3) * 1j)


NODES = "asks for the nodes of SciPy's tree"
NOT_PASSED = {
    "test_query_pairs_eps": "wants `eps` to add pairs that are a little too far apart; exact here",
    "test_kdtree_comparisons": NODES,
    "test_ckdtree_view": NODES,
    "test_kdtree_tree_access": NODES,
    "test_kdtree_duplicated_inputs": NODES,
    "test_kdtree_weights": "calls `_build_weights`, which is private",
    "test_ckdtree_parallel": "its last lines replace a function that SciPy counts processors with",
}


def test_scipys_own_tests(tmp_path, capsys):
    """SciPy's file of tests with our classes under its names: all pass but those that are named
    here, each with the reason."""
    tests = support.peer("scipy.spatial.tests").__path__[0]
    text = (pathlib.Path(tests) / "test_kdtree.py").read_text("utf-8")
    text, replaced = re.subn(
        "^from scipy.spatial import KDTree, Rectangle, distance_matrix, cKDTree$",
        "from scipy.spatial import Rectangle, distance_matrix\n"
        "from raydix.scipy import KDTree, cKDTree",
        text,
        flags=re.MULTILINE,
    )
    if not replaced:
        pytest.skip("this SciPy imports its trees in another way")
    (tmp_path / "test_kdtree.py").write_text(text, "utf-8")
    results = support.run_tests(tmp_path / "test_kdtree.py")
    by_result = {}
    for name, result in results.items():
        by_result.setdefault(result, set()).add(name.split("::")[1].split("[")[0])
    with capsys.disabled():
        passed = sum(result == "passed" for result in results.values())
        print(f"\nSciPy's tests of its trees: {passed} of {len(results)} pass; the others:")
        for name, why in NOT_PASSED.items():
            print(f"  {name}: {why}")
    assert passed > 200
    assert {n for r, names in by_result.items() if r != "passed" for n in names} <= set(NOT_PASSED)


@pytest.mark.parametrize("kind", [cKDTree, KDTree])
def test_radii_that_hold_nothing(kind, rng):
    data = rng.random((40, 3))
    for p in (2, 1):
        tree, plane = kind(data), kind(data[:, :2])
        for r in (-1, np.nan, -np.inf):
            assert tree.query_ball_point(data[0], r, p) == []
            assert tree.query_ball_point(data[:3], r, p).tolist() == [[], [], []]
            assert tree.query_ball_point(data[:3], r, p, return_length=True).tolist() == [0, 0, 0]
            assert tree.query_pairs(r, p) == set() and plane.query_pairs(r, p) == set()
            assert tree.query_pairs(r, p, output_type="ndarray").shape == (0, 2)
            assert tree.query_ball_tree(tree, r, p) == [[]] * 40
            assert tree.sparse_distance_matrix(tree, r, p, output_type="dict") == {}
        mixed = tree.query_ball_point(data[:4], [0, -1, np.nan, np.inf], p)
        assert [len(row) for row in mixed] == [1, 0, 0, 40]
        for weights in (None, np.ones(40)):
            alone = tree.count_neighbors(tree, 0.3, p, weights)
            counts = tree.count_neighbors(tree, [0.3, np.nan, -1, np.inf], p, weights)
            assert counts.tolist() == [alone, 0, 0, 1600] and alone > 40


def test_numbers_of_neighbours_as_scipy_takes_them(rng):
    theirs = support.peer("scipy.spatial")
    data = rng.random((40, 3))
    for mine, other in ((cKDTree, theirs.cKDTree), (KDTree, theirs.KDTree)):
        for k in (1, 1.0, 0.5, 2.5, 3.0, np.float32(3.9), True, [1.0, 3.0]):
            found, wanted = mine(data).query(data[:5], k=k), other(data).query(data[:5], k=k)
            for a, b in zip(found, wanted, strict=True):
                assert a.shape == b.shape
                np.testing.assert_allclose(a, b)
        for k in ("2", b"2", np.array(["2"])):
            with pytest.raises(TypeError, match="k: expected a number"):
                mine(data).query(data[0], k=k)
        length = mine(data).query_ball_point(data[0], 0.5, return_length=True)
        assert type(length) is type(other(data).query_ball_point(data[0], 0.5, return_length=True))
