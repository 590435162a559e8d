"""How far a commit is, told to a function that may end it."""

import threading

import numpy as np
import pytest
from worlds import BOX, DOWN, triangles

import raydix

both_precisions = pytest.mark.parametrize("precision", ["float32", "float64"])


class TooLongError(Exception):
    pass


def large(rng, precision):
    scene = raydix.Scene(precision=precision)
    scene.add(*BOX)
    scene.commit()
    scene.add(*triangles(rng, 30_000, 0.01))
    return scene


@both_precisions
def test_parts_ascend_to_1(rng, precision):
    scene, told = large(rng, precision), []
    assert scene.commit(progress=told.append)["meshes"] == 2
    assert len(told) > 3 and told == sorted(told) and told[-1] == 1 and told[0] >= 0
    assert all(type(part) is float for part in told)
    before = len(told)
    scene.remove(1)
    scene.commit()  # the function was for one commit
    assert len(told) == before


@both_precisions
@pytest.mark.parametrize("at", [0.0, 0.5, 1.0])
def test_what_it_raises_ends_the_commit(rng, precision, at):
    scene, told = large(rng, precision), []

    def stop(part):
        told.append(part)
        if part >= at:
            raise TooLongError(part)

    with pytest.raises(TooLongError) as error:
        scene.commit(progress=stop)
    assert error.value.args == (told[-1],) and told[-1] >= at
    assert sum(part >= at for part in told) == 1  # it was not called again
    assert not scene.committed and scene.contains([0, 0, 0])
    assert scene.bounds.tolist() == [[-1, -2, -3], [1, 2, 3]]
    assert scene.intersect(DOWN)["t"] == 6
    assert scene.commit()["meshes"] == 2 and scene.committed


def test_what_it_may_not_do(rng):
    scene, other, refused = large(rng, None), raydix.Scene(*BOX), []

    def ask(part):
        for call in (lambda: scene.intersect(DOWN), scene.commit, other.commit):
            try:
                call()
            except raydix.InputError as error:
                refused.append(str(error))

    scene.commit(progress=ask)
    assert len(refused) >= 6 and all("progress function" in text for text in refused)
    assert scene.committed and other.commit()["meshes"] == 1
    for wrong in (3, "half"):
        with pytest.raises(TypeError, match="progress: expected a function"):
            scene.commit(progress=wrong)


def test_other_threads_run_meanwhile(rng):
    """The interpreter's lock is free while the commit works, and is taken for each call."""
    scene, calls, stop = large(rng, None), [], threading.Event()
    counted = np.zeros(1, np.int64)

    def count():
        while not stop.is_set():
            counted[0] += 1

    thread = threading.Thread(target=count)
    thread.start()
    try:
        scene.commit(progress=lambda part: calls.append(int(counted[0])))
    finally:
        stop.set()
        thread.join()
    assert len(calls) > 3 and calls == sorted(calls)
