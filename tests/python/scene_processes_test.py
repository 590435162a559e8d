"""Scenes: threads that trace and commit, memory, signals."""

import concurrent.futures
import subprocess
import sys
import threading

import numpy as np
import pytest
import support
from worlds import ALL, transform, triangles

import raydix


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_threads_trace_while_others_commit(rng, precision):
    """Each answer is of one commit, whole; scenes that hold each other do not wait for ever."""
    leaf = raydix.Scene(*triangles(rng, 300, 0.2), precision=precision)
    world = raydix.Scene(usage="moving", precision=precision)
    top = raydix.Scene(precision=precision)
    id = world.add(leaf, np.eye(4))
    world.add(leaf, transform(rng))
    world.commit()
    top.add(world, np.eye(4))
    top.commit()
    rays = support.random_rays(rng, 100)
    places = np.eye(4), np.eye(4) + [[0, 0, 0, 0.3], [0] * 4, [0] * 4, [0] * 4]
    states = []
    for place in places:
        world.set_transform(id, place)
        world.commit()
        states.append(world.intersect(rays)["t"].tobytes())
    assert states[0] != states[1]
    seen, done = set(), threading.Event()

    def ask(scene):
        while not done.is_set():
            seen.add(scene.intersect(rays)["t"].tobytes())
            leaf.contains([[0, 0, 0]])

    def change_top():
        while not done.is_set():
            top.commit()
            raydix.Scene(precision=precision).add(top, np.eye(4))

    def change_leaf():
        while not done.is_set():
            leaf.set_mask(0, ALL)
            leaf.commit()

    with concurrent.futures.ThreadPoolExecutor(6) as pool:
        jobs = [pool.submit(ask, scene) for scene in (world, world, top)]
        jobs += [pool.submit(change_top), pool.submit(change_leaf)]
        for i in range(60):
            world.set_transform(id, places[i % 2])
            world.commit()
        done.set()
        for job in jobs:
            job.result(timeout=60)
    assert seen <= set(states)


def run_python(code):
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=300
    )
    assert result.returncode == 0, result.stderr
    return result.stdout.split()


MEMORY = """
import numpy as np
import raydix
def held():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096
warm = raydix.Scene("builtin:figure?triangles=5000")
warm.occluded(np.zeros((100, 8), np.float32))
shape = raydix.Scene("builtin:figure?triangles=1000000")
vertices, faces = shape.vertices.copy(), shape.faces.copy()
del shape
start = held()
scene = raydix.Scene(vertices, faces)
copied = held()
scene.occluded(np.zeros((100, 8), np.float32))
traced = held()
arrays, wide = vertices.nbytes + faces.nbytes, scene.commit()["bytes"]
binary = scene.stats()["bytes"]
print(copied - start, traced - copied, held() - traced, arrays, wide, binary)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_rays_need_no_binary_tree():
    """A scene of one mesh holds one copy of the arrays, and what rays read once they are traced."""
    copied, traced, asked, arrays, wide, binary = map(int, run_python(MEMORY))
    assert copied < arrays + 10_000_000
    assert traced < wide + 0.6 * binary  # scratch memory that was not given back counts too
    assert asked > 0.5 * binary


def test_a_signal_handler_may_not_commit():
    """A commit would wait for the batch that the handler interrupted: an error, not a hang."""
    out = run_python("""
import signal
import numpy as np
import raydix
scene = raydix.Scene("builtin:figure?triangles=20000")
refused = []
def handler(*_):
    try:
        scene.commit()
    except raydix.InputError as error:
        refused.append(str(error))
signal.signal(signal.SIGALRM, handler)
signal.setitimer(signal.ITIMER_REAL, 0.1, 0.1)
while not refused:
    scene.occluded(np.broadcast_to(np.float32([0, 50, 0]), (20_000_000, 3)), np.float32([0, 0, 1]))
signal.setitimer(signal.ITIMER_REAL, 0)
scene.commit()
print(refused[0])
""")
    assert out[0] == "commit:" and "handler" in out


def test_a_signal_handler_in_a_commit():
    """It may not ask the scene, which is locked: an error, not a hang. What it throws ends the
    commit, and the scene stays as it was."""
    out = run_python("""
import signal
import numpy as np
import raydix
random = np.random.default_rng(1)
scene = raydix.Scene("builtin:figure?triangles=20000")
wanted = scene.occluded([0, 0, 0, 0, 1, 0])
n = 400_000
scene.add(random.random((n, 3)), random.integers(0, n, (n, 3)))
refused = []
def handler(*_):
    for call in (scene.commit, lambda: scene.occluded([0, 0, 0, 0, 1, 0])):
        try:
            call()
        except raydix.InputError as error:
            refused.append(str(error))
    raise KeyError("enough")
signal.signal(signal.SIGALRM, handler)
signal.setitimer(signal.ITIMER_REAL, 0.2)
try:
    scene.commit(quality="high", threads=1)
    print("done")
except KeyError as error:
    signal.setitimer(signal.ITIMER_REAL, 0)
    print(error.args[0], len(refused), scene.committed, scene.occluded([0, 0, 0, 0, 1, 0]) == wanted)
    print(refused[0])
    scene.remove(1)
    print(scene.commit()["meshes"])
""")
    assert out[:4] == ["enough", "2", "False", "True"] and out[-1] == "1"
    assert "handler" in out
