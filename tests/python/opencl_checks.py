"""Rays on an OpenCL device beside those of the processor, as a program: drivers are found by the environment
that a process starts with. opencl_test.py runs it. Exit code 77: there is no device, and why."""

import sys
import threading

import numpy as np
import support

import raydix


def same(found, wanted):
    for name, column in wanted.items():
        assert column.tobytes() == np.ascontiguousarray(found[name]).tobytes(), name


def mesh_has_the_hits_of_the_processor(device, rng):
    vertices, faces = support.random_triangles(rng, 3000)
    vertices[7] = np.nan
    here, there = (raydix.Scene(vertices, faces, device=d) for d in ("cpu", device))
    for rays in (
        support.random_rays(rng, 5000),
        support.random_rays(rng, 1),
        support.random_rays(rng, 33)[::2],
        np.zeros((0, 8), np.float32),
        np.full((3, 8), np.nan, np.float32),
        support.random_rays(rng, 60).astype(np.float64).reshape(3, 20, 8),
    ):
        same(there.intersect(rays), here.intersect(rays))
        np.testing.assert_array_equal(there.occluded(rays), here.occluded(rays))
    rays = support.random_rays(rng, 400)
    wanted = here.intersect(rays[:, :3], rays[:, 4:7], tmin=0.5, tmax=2.0)
    found = there.intersect(rays[:, :3], rays[:, 4:7], tmin=0.5, tmax=2.0, also="normal")
    same(found, wanted)
    np.testing.assert_array_equal(found.normal, here.normals(wanted))
    assert 100 < wanted.hit.sum() < 400
    # All else is asked of the processor, and changes are seen.
    points = rng.normal(size=(20, 3)).astype(np.float32)
    same(there.closest_point(points), here.closest_point(points))
    for scene in (here, there):
        scene.update(0, np.nan_to_num(vertices) * np.float32(0.5))
        scene.commit()
    same(there.intersect(rays), here.intersect(rays))


def meshes_are_named(device, rng):
    here, there = (raydix.Scene(device=d) for d in ("cpu", device))
    for scene in (here, there):
        for id, shift, mask in ((1, 0, 1), (2, 0, 2), (18, 3, 0xFFFFFFFF), (30, 6, 0)):
            box = support.box_mesh([shift, 0, 0], [shift + 1, 1, 1])
            scene.add(*box, mask=mask, id=id)
        scene.commit()
    rays = np.float32([[x, 0.4, 9, 0, 0, 0, -1, np.inf] for x in (0.5, 3.5, 6.5, 20)])
    same(there.intersect(rays), here.intersect(rays))
    assert there.intersect(rays).geometry.tolist() == [1, 18, raydix.MISSING, raydix.MISSING]
    np.testing.assert_array_equal(there.occluded(rays), [True, True, False, False])
    empty = raydix.Scene(device=device)
    empty.commit()
    assert not empty.intersect(rays).hit.any() and not empty.occluded(rays).any()


def within(scene, device):
    whole = raydix.Scene(device=device)
    whole.add(scene, np.eye(4))
    whole.commit()
    return whole


def what_is_not_there_is_named(device):
    scene = raydix.Scene(*support.box_mesh([0, 0, 0], [1, 1, 1]), device=device)
    ray = np.float32([[0.5, 0.4, 9, 0, 0, 0, -1, np.inf]])
    refused = {
        "mask: rays on a device": lambda: scene.intersect(ray, mask=1),
        "hits are not filtered": lambda: scene.intersect(ray, keep=np.ones(12, bool)),
        "float64 are not traced": lambda: raydix.Scene(precision="float64", device=device),
        "is an instance": lambda: within(scene, device).intersect(ray),
        "999": lambda: raydix.Scene(scene.vertices, scene.faces, device="opencl:999").occluded(ray),
    }

    for words, call in refused.items():
        try:
            call()
        except raydix.BackendUnavailable as error:
            assert words in str(error), error
        else:
            raise AssertionError(f"nothing was said of: {words}")
    assert scene.intersect(ray).hit.all()


def threads_share_a_scene(device, rng):
    """Each of them selects the device for itself."""
    scene = raydix.Scene(*support.random_triangles(rng, 500), device=device)
    here = raydix.Scene(scene.vertices, scene.faces)
    batches = [support.random_rays(rng, 300) for _ in range(4)]
    found = [None] * 4

    def ask(i):
        found[i] = scene.intersect(batches[i])

    threads = [threading.Thread(target=ask, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for rays, hits in zip(batches, found, strict=True):
        same(hits, here.intersect(rays))


def main():
    devices = [d for d in raydix.devices() if d.name.startswith("opencl")]
    usable = [d for d in devices if d.available]
    if not usable:
        print("; ".join(d.detail for d in devices))
        sys.exit(77)
    rng = np.random.default_rng(7)
    mesh_has_the_hits_of_the_processor(usable[0].name, rng)
    meshes_are_named(usable[0].name, rng)
    what_is_not_there_is_named(usable[0].name)
    threads_share_a_scene("opencl" if usable[0].name == "opencl:0" else usable[0].name, rng)
    print(usable[0].detail)


if __name__ == "__main__":
    main()
