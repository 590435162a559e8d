"""Points against brute force, SciPy and pykdtree."""

import numpy as np
import pytest
import support

import raydix

KINDS = [(dtype, dimension) for dtype in (np.float32, np.float64) for dimension in (2, 3)]


def distances(points, queries):
    """sqrt((dx*dx + dy*dy) + dz*dz) in the points' own type: (queries, points)."""
    d = queries[:, None] - points[None]
    d2 = d[..., 0] * d[..., 0] + d[..., 1] * d[..., 1]
    if points.shape[1] == 3:
        d2 = d2 + d[..., 2] * d[..., 2]
    return np.sqrt(d2)


@pytest.fixture(params=KINDS, ids=lambda kind: f"{np.dtype(kind[0])}-{kind[1]}D")
def cloud(request, rng):
    dtype, dimension = request.param
    points = rng.normal(size=(700, dimension)).astype(dtype)
    points[:40] = points[0]  # a heap of equal points
    queries = np.concatenate([rng.uniform(-2, 2, (60, dimension)), points[:10]]).astype(dtype)
    return points, queries


@pytest.mark.parametrize("k", [1, 3, 100, 701, 1000])
def test_nearest_equal_brute_force_bit_for_bit(cloud, k):
    points, queries = cloud
    found = raydix.Points(points).knn(queries, k)
    assert (
        found["indices"].shape == found["distances"].shape == (70, k)
        and found["distances"].dtype == points.dtype
    )
    wanted = distances(points, queries)
    order = np.argsort(wanted, axis=1, kind="stable")[:, :k]
    some = min(k, len(points))
    np.testing.assert_array_equal(found["indices"][:, :some], order)
    np.testing.assert_array_equal(
        found["distances"][:, :some], np.take_along_axis(wanted, order, axis=1)
    )
    assert (found["indices"][:, some:] == raydix.MISSING).all() and np.isinf(
        found["distances"][:, some:]
    ).all()


def test_nearest_within_a_distance(cloud):
    points, asked = cloud
    index = raydix.Points(points)
    wanted = index.knn(asked, 5)
    limit = float(np.median(wanted["distances"]))
    beyond = wanted["distances"] > limit
    for queries in (asked, asked[:1], asked[0]):
        near = index.knn(queries, 5, max_distance=limit)
        here = wanted["indices"][: len(np.atleast_2d(queries))].reshape(near["indices"].shape)
        far = beyond[: len(np.atleast_2d(queries))].reshape(near["indices"].shape)
        assert (near["indices"] == np.where(far, raydix.MISSING, here)).all()
        assert np.isinf(near["distances"][far]).all() and (near["distances"][~far] <= limit).all()
    assert beyond.any()
    for wrong in (-1, np.nan):
        with pytest.raises(raydix.InputError, match="max_distance is"):
            index.knn(asked, 5, max_distance=wrong)
    with pytest.raises(TypeError, match="max_distance: expected a number"):
        index.knn(asked, 5, max_distance="far")


def test_radius_count_and_box_equal_brute_force(cloud):
    points, queries = cloud
    index = raydix.Points(points)
    wanted = distances(points, queries)
    for r in (0, 0.3, np.inf):
        near = wanted <= r
        found = index.radius(queries, r)
        np.testing.assert_array_equal(np.diff(found["offsets"]), near.sum(axis=1))
        np.testing.assert_array_equal(found["indices"], np.nonzero(near)[1])
        np.testing.assert_array_equal(found["distances"], wanted[near])
        np.testing.assert_array_equal(index.count(queries, r), near.sum(axis=1))
    boxes = np.concatenate(
        [queries - points.dtype.type(0.25), queries + points.dtype.type(0.25)], axis=1
    )
    inside = (
        (points[None] >= boxes[:, None, : points.shape[1]])
        & (points[None] <= boxes[:, None, points.shape[1] :])
    ).all(axis=-1)
    np.testing.assert_array_equal(index.box(boxes)["indices"], np.nonzero(inside)[1])


def test_radii_of_their_own_sorted_and_padded(cloud, rng):
    points, queries = cloud
    index = raydix.Points(points)
    radii = rng.uniform(0, 1, 70)
    wanted = distances(points, queries)
    near = wanted <= radii.astype(points.dtype)[:, None]
    table = index.radius(queries.reshape(7, 10, -1), radii.reshape(7, 10), sort=True, padded=True)
    assert table["counts"].shape == (7, 10) and table["indices"].shape == (
        7,
        10,
        near.sum(axis=1).max(),
    )
    np.testing.assert_array_equal(table["counts"].reshape(-1), near.sum(axis=1))
    for i, row in enumerate(table["indices"].reshape(70, -1)):
        ids = np.flatnonzero(near[i])
        np.testing.assert_array_equal(
            row[: len(ids)], ids[np.argsort(wanted[i][ids], kind="stable")]
        )
        assert (row[len(ids) :] == raydix.MISSING).all()
    assert (np.isinf(table["distances"]) == (table["indices"] == raydix.MISSING)).all()


def test_pairs_equal_brute_force(cloud):
    points, _ = cloud
    index = raydix.Points(points)
    wanted = distances(points, points)
    near = np.argwhere(np.triu(wanted <= 0.2, 1))
    found = index.pairs(0.2)
    np.testing.assert_array_equal(found["pairs"], near)
    np.testing.assert_array_equal(found["distances"], wanted[near[:, 0], near[:, 1]])
    lists = index.neighbours(0.2)
    assert len(lists["indices"]) == 2 * len(near) and len(lists["offsets"]) == len(points) + 1


def test_any_leading_shape_and_the_other_type(cloud):
    points, queries = cloud
    index = raydix.Points(points)
    flat = index.knn(queries, 4)
    shaped = index.knn(queries.reshape(2, 5, 7, -1), 4)
    assert shaped["indices"].shape == (2, 5, 7, 4)
    np.testing.assert_array_equal(shaped["indices"].reshape(-1, 4), flat["indices"])
    one = index.knn(queries[3], 4)
    assert one["indices"].shape == (4,) and one["indices"].tolist() == flat["indices"][3].tolist()
    other = queries.astype(np.float64 if points.dtype == np.float32 else np.float32)
    assert index.knn(other, 2)["distances"].dtype == points.dtype
    np.testing.assert_array_equal(
        index.knn(np.asfortranarray(queries), 4)["indices"], flat["indices"]
    )


def test_nothing_and_nonsense():
    empty = raydix.Points(np.zeros((0, 3)))
    assert len(empty) == 0 and empty.knn([[0, 0, 0]], 2)["indices"].tolist() == [
        [raydix.MISSING] * 2
    ]
    assert empty.pairs(1)["pairs"].shape == (0, 2)
    assert len(raydix.Points([])) == 0
    index = raydix.Points(np.array([[0, 0, 0], [np.nan, 0, 0], [1, 1, 1]]))
    assert len(index) == 2 and index.stats()["left_out"] == 1
    assert index.knn([0.9, 0.9, 0.9], 1)["indices"].tolist() == [
        2
    ]  # the caller's numbers, not ours
    assert index.knn(np.zeros((0, 3)), 5)["indices"].shape == (0, 5)
    assert index.radius(np.zeros((0, 3)), 1)["offsets"].tolist() == [0]
    assert index.radius(np.zeros((0, 3)), 1, padded=True)["indices"].shape == (0, 0)
    assert index.knn([np.nan, 0, 0], 1)["indices"].tolist() == [raydix.MISSING]
    with pytest.raises(raydix.InputError):
        raydix.Points([[np.inf, 0, 0]], strict=True)


def test_results_larger_than_their_limit():
    points = raydix.Points(np.zeros((2000, 3)))  # all within any radius of all
    boxes = np.tile(np.array([-1.0, -1, -1, 1, 1, 1]), (3000, 1))
    for call in (
        lambda limit: points.radius(np.zeros((3000, 3)), 1, max_result_bytes=limit),
        lambda limit: points.radius(np.zeros((300, 3)), 1, padded=True, max_result_bytes=limit),
        lambda limit: points.box(boxes, max_result_bytes=limit),
        lambda limit: points.pairs(1, max_result_bytes=limit),
        lambda limit: points.neighbours(1, max_result_bytes=limit),
        lambda limit: points.knn(np.zeros((300, 3)), 2000, max_result_bytes=limit),
    ):
        with pytest.raises(raydix.InputError, match="bytes; max_result_bytes lets it have 1000000"):
            call(1_000_000)
        for array in call(10**9).values():
            assert array.size
    with pytest.raises(raydix.InputError, match="knn: the result needs"):
        points.knn(np.zeros((10**6, 3)), 2**31)


@pytest.mark.parametrize(
    "error, text, call",
    [
        (
            ValueError,
            r"points: expected shape \(..., 3\) or \(..., 2\) float32 .* given shape \(4, 5\)",
            lambda i: raydix.Points(np.zeros((4, 5))),
        ),
        (
            ValueError,
            r"points: expected shape \(N, 2\) or \(N, 3\)",
            lambda i: raydix.Points(np.zeros((4, 4, 3))),
        ),
        (
            ValueError,
            r"queries: expected shape \(..., 3\) .* given shape \(4, 2\) float64",
            lambda i: i.knn(np.zeros((4, 2)), 1),
        ),
        (
            TypeError,
            r"queries: expected .* complex128",
            lambda i: i.knn(np.zeros((4, 3), complex), 1),
        ),
        (
            ValueError,
            "k: expected a whole number, 1 to 2147483648, given 0",
            lambda i: i.knn([0, 0, 0], 0),
        ),
        (
            ValueError,
            r"r: expected a number or shape \(2,\), given shape \(3,\)",
            lambda i: i.radius(np.zeros((2, 3)), [1, 2, 3]),
        ),
        (ValueError, "radius is -1.*0 or more", lambda i: i.radius([0, 0, 0], -1)),
        (ValueError, "radius is nan.*0 or more", lambda i: i.radius([0, 0, 0], np.nan)),
        (ValueError, "radius is -1;", lambda i: i.radius(np.zeros((0, 3)), -1)),
        (ValueError, "radius is -1;", lambda i: i.count(np.zeros((0, 3)), -1)),
        (
            ValueError,
            "max_distance is -1;",
            lambda i: i.knn(np.zeros((0, 3)), 1, max_distance=-1),
        ),
        (
            ValueError,
            "radius 1048577 is -0.1; it must be 0 or more",
            lambda i: i.radius(
                np.zeros(((1 << 20) + 3, 3), "f4"), np.float32([0] * (1 << 20) + [1, -0.1, np.nan])
            ),
        ),
        (
            ValueError,
            "radius 3 is nan;",
            lambda i: i.radius(np.zeros((2, 2, 3)), [[0, 1], [2, np.nan]]),
        ),
        (ValueError, r"boxes: expected shape \(..., 6\)", lambda i: i.box(np.zeros((2, 4)))),
    ],
)
def test_errors(error, text, call):
    with pytest.raises(error, match=text):
        call(raydix.Points(np.zeros((2, 3))))


def test_pykdtree_agrees(rng):
    pykdtree = support.peer("pykdtree.kdtree")
    data, x = rng.normal(size=(3000, 3)), rng.normal(size=(500, 3))
    d, i = pykdtree.KDTree(data).query(x, k=6)
    found = raydix.Points(data).knn(x, 6)
    np.testing.assert_array_equal(found["indices"], i)
    np.testing.assert_allclose(found["distances"], d, rtol=1e-14)


def test_shared_cloud_as_scipy():
    spatial = support.peer("scipy.spatial")
    cloud = support.shared_cloud("kitti_frame")
    (d, i), found = (
        spatial.cKDTree(cloud).query(cloud, 9),
        raydix.Points(cloud.astype(np.float64)).knn(cloud, 9),
    )
    np.testing.assert_allclose(found["distances"], d, rtol=1e-13)
    assert (found["indices"] == i).mean() > 0.999  # equal distances: SciPy promises no order
