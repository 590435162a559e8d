"""Arrays of other libraries: DLPack in and out."""

import array

import numpy as np
import pytest
import support

import raydix

SCENE = support.box_mesh([0, 0, 0], [1, 1, 1])
RAYS = np.float32([[0.5, 0.4, 9, 0, 0, 0, -1, np.inf], [5, 5, 9, 0, 0, 0, -1, np.inf]])


class Foreign:
    """An array of some other library, that NumPy knows by DLPack alone."""

    def __init__(self, values, device=(1, 0)):
        self.values, self.device, self.asked = values, device, 0

    def __dlpack_device__(self):
        return self.device

    def __dlpack__(self, **options):
        self.asked += 1
        return self.values.__dlpack__(**options)


def test_dlpack_comes_in_without_a_copy():
    rays = Foreign(RAYS)
    seen = raydix._arrays.to_numpy(rays, "rays")
    assert rays.asked == 1 and seen.ctypes.data == RAYS.ctypes.data
    scene = raydix.Scene(Foreign(SCENE[0]), Foreign(SCENE[1]))
    assert scene.intersect(rays)["t"].tolist() == [8, np.inf]
    assert scene.intersect(Foreign(RAYS[:, :3].astype(np.float64)), Foreign(RAYS[:, 4:7]))[
        "t"
    ].tolist() == [8, np.inf]
    assert raydix.Points(Foreign(SCENE[0])).knn(Foreign(np.zeros((1, 3))), 1)[
        "distances"
    ].tolist() == [[0]]


def test_results_go_out_by_dlpack():
    hits = raydix.Scene(*SCENE).intersect(RAYS)
    for values in hits.values():
        out = np.from_dlpack(Foreign(values))
        assert out.ctypes.data == values.ctypes.data and out.strides == values.strides
        np.testing.assert_array_equal(out, values)


def test_other_devices_are_named():
    for device in ((2, 0), (10, 1)):
        for call in (
            raydix.Scene(*SCENE).intersect,
            raydix.Scene(*SCENE).contains,
            lambda a: raydix.Points(a),
        ):
            with pytest.raises(
                TypeError, match=rf"Foreign on another device \(DLPack {device[0]}\)"
            ):
                call(Foreign(RAYS, device))


def test_anything_that_numpy_understands():
    scene = raydix.Scene([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [(0, 1, 2)])
    ray = (0.25, 0.25, 1, 0, 0, -1)
    for form in (
        ray,
        list(ray),
        array.array("d", ray),
        memoryview(array.array("f", ray)),
        np.float16(ray),
        np.longdouble(ray),
    ):
        assert scene.intersect(form)["t"] == 1
    assert scene.intersect(np.array([1, 0, 3, 0, 0, -1]))["prim"] == 0  # whole numbers
    for dtype in (np.int16, np.uint8, np.int64, ">i4"):
        assert raydix.Scene(np.eye(3), np.array([[0, 1, 2]], dtype)).faces.tolist() == [[0, 1, 2]]
    for wrong in (
        object(),
        "rays",
        [[1, 2], [3]],
        {1: 2},
        np.array(["a"] * 8),
        np.zeros(8, "M8[s]"),
    ):
        with pytest.raises(TypeError, match="rays: expected"):
            scene.intersect(wrong)


def test_torch():
    torch = support.peer("torch")
    scene = raydix.Scene(torch.from_numpy(SCENE[0]), torch.from_numpy(SCENE[1]))
    hits = scene.intersect(torch.from_numpy(RAYS))
    assert torch.from_dlpack(hits["t"]).tolist() == [8, np.inf]
    assert scene.intersect(torch.from_numpy(RAYS).requires_grad_().detach())["prim"].shape == (2,)
    with pytest.raises(TypeError, match="rays: expected"):
        scene.intersect(torch.from_numpy(RAYS).requires_grad_())


def test_jax():
    jax = support.peer("jax")
    hits = raydix.Scene(*SCENE).intersect(jax.numpy.asarray(RAYS))
    assert jax.numpy.asarray(hits["t"]).tolist() == [8, np.inf]


def test_cupy_rays_stay_on_the_gpu():
    cupy = support.peer("cupy")
    if not raydix.devices()[1].available:
        pytest.skip(raydix.devices()[1].detail)
    scene = raydix.Scene(*SCENE, device="cuda")
    stream = cupy.cuda.Stream()
    with stream:
        hits = scene.intersect(cupy.asarray(RAYS), stream=stream.ptr)
        assert isinstance(hits["t"], cupy.ndarray) and hits["t"].tolist() == [8, np.inf]
