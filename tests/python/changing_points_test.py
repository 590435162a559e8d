"""Points that are added and removed, against a fresh index over what is there."""

import pickle
import threading

import numpy as np
import pytest

import raydix


def assert_as_fresh(points, array, there, queries):
    ids = np.flatnonzero(there).astype(np.uint32)
    fresh = raydix.Points(array[ids])
    names = np.append(ids, raydix.MISSING)  # the last: of none
    assert len(points) == len(fresh)
    near, wanted = points.knn(queries, 7), fresh.knn(queries, 7)
    np.testing.assert_array_equal(near["distances"], wanted["distances"])
    places = np.minimum(wanted["indices"], len(ids))
    np.testing.assert_array_equal(near["indices"], names[places])
    within, wanted = points.radius(queries, 0.7), fresh.radius(queries, 0.7)
    np.testing.assert_array_equal(within["offsets"], wanted["offsets"])
    np.testing.assert_array_equal(within["indices"], names[wanted["indices"]])
    pairs = names[fresh.pairs(0.3)["pairs"]]
    np.testing.assert_array_equal(points.pairs(0.3)["pairs"], pairs)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_batches_in_and_out(dimension, dtype, rng):
    array = rng.normal(size=(3000, dimension)).astype(dtype)
    there = np.zeros(len(array), bool)
    there[:500] = True
    points = raydix.Points(array[:500])
    queries, at = array[:60], 500
    while at < len(array):
        count = int(rng.integers(1, 400))
        batch = array[at : at + count]
        np.testing.assert_array_equal(points.add(batch), np.arange(at, at + len(batch)))
        there[at : at + len(batch)] = True
        at += len(batch)
        gone = rng.integers(0, at, int(rng.integers(1, 300)))
        assert points.remove(gone) == len(np.unique(gone[there[gone]]))
        there[gone] = False
        assert_as_fresh(points, array, there, queries)
    other = pickle.loads(pickle.dumps(points))
    assert_as_fresh(other, array, there, queries)
    assert other.add(queries[0]).tolist() == points.add(queries[:1]).tolist() == [3000]


def test_strict_copies_keep_numbers():
    points = raydix.Points(np.eye(3), strict=True)
    assert points.remove(1) == 1 and points.remove([1]) == 0
    other = pickle.loads(pickle.dumps(points))
    assert len(other) == 2 and other.knn([0, 1, 0], 3)["indices"].tolist() == [0, 2, raydix.MISSING]
    assert other.add([[5, 5, 5]]).tolist() == [3]


def test_what_is_wrong():
    points = raydix.Points(np.zeros((3, 3)), strict=True)
    for call, text in (
        (lambda: points.add([[0, 0]]), "points: expected"),
        (lambda: points.add([[0, 0, 0], [np.nan, 0, 0]]), "point 1: not finite"),
        (lambda: points.remove([0, 3]), "there is no point 3; 3 were given"),
        (lambda: points.remove([[0]]), r"indices: expected shape \(M,\)"),
        (lambda: points.remove([-1]), "indices"),
        (lambda: points.remove([0.5]), "indices"),
    ):
        with pytest.raises((TypeError, ValueError), match=text):
            call()
    assert len(points) == 3
    assert points.add(np.zeros((0, 3))).shape == (0,) and points.remove([]) == 0


def test_threads_ask_while_points_come(rng):
    """Each answer is that of some moment: the nearest of those that stay is never farther."""
    array = rng.normal(size=(4000, 3))
    points = raydix.Points(array[:2000])
    queries = rng.normal(size=(500, 3))
    limit = points.knn(queries, 1)["distances"]
    stop, failures = threading.Event(), []

    def ask():
        while not stop.is_set():
            if (points.knn(queries, 1)["distances"] > limit).any():
                failures.append("a point was missing")

    threads = [threading.Thread(target=ask) for _ in range(3)]
    for thread in threads:
        thread.start()
    for begin in range(2000, 4000, 100):
        points.remove(points.add(array[begin : begin + 100])[::2])
    stop.set()
    for thread in threads:
        thread.join()
    assert not failures and len(points) == 3000
