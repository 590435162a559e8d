"""Threads, forks, signals, memory: what a long-running program meets."""

import concurrent.futures
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import support

import raydix


def test_threads_ask_at_once(rng):
    """The first query of a fresh scene from many threads: one builds, all get the same bits."""
    vertices, faces = support.random_triangles(rng, 5000)
    rays, points = support.random_rays(rng, 4000), rng.uniform(-1, 1, (2000, 3))
    reference = raydix.Scene(vertices, faces)
    wanted = (
        reference.intersect(rays),
        reference.closest_point(points),
        raydix.Points(points).knn(points, 5),
    )
    scene, index = raydix.Scene(vertices, faces), raydix.Points(points)
    gate = threading.Barrier(8)

    def ask(_):
        gate.wait()
        return scene.intersect(rays), scene.closest_point(points), index.knn(points, 5)

    with concurrent.futures.ThreadPoolExecutor(8) as pool:
        for answers in pool.map(ask, range(8)):
            for answer, expected in zip(answers, wanted, strict=True):
                for name, values in answer.items():
                    np.testing.assert_array_equal(values, expected[name])


def test_refit_while_others_ask(rng):
    """Each answer is about one state of the mesh, whole: the one before or the one after."""
    vertices, faces = support.random_triangles(rng, 500)
    scene, rays = raydix.Scene(vertices, faces), support.random_rays(rng, 200)
    moved = (vertices * 0.5).astype(np.float32)
    states = [
        scene.intersect(rays)["t"].tobytes(),
        raydix.Scene(moved, faces).intersect(rays)["t"].tobytes(),
    ]
    assert states[0] != states[1]
    seen, done = set(), threading.Event()

    def ask():
        while not done.is_set():
            seen.add(scene.intersect(rays)["t"].tobytes())

    with concurrent.futures.ThreadPoolExecutor(3) as pool:
        jobs = [pool.submit(ask) for _ in range(3)]
        for i in range(40):
            scene.refit(moved if i % 2 == 0 else vertices)
        done.set()
        for job in jobs:
            job.result()
    assert seen <= set(states)


def run_python(code, *arguments, **options):
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        capture_output=True,
        text=True,
        timeout=300,
        **options,
    )


SETUP = """
import os, resource, signal, sys, threading, time
import numpy as np
import raydix
scene = raydix.Scene("builtin:figure?triangles=20000")
rays = scene.primary_rays(size=(400, 300))["rays"]
"""


def test_the_interpreter_is_free_meanwhile():
    """Another thread of Python counts while a batch runs."""
    result = run_python(SETUP + """
many = np.broadcast_to(rays, (20,) + rays.shape)
counted, done = 0, False
def ask():
    global done
    scene.intersect(many)
    done = True
thread = threading.Thread(target=ask)
thread.start()
while not done:
    counted += 1
thread.join()
print(counted)
""")
    assert result.returncode == 0, result.stderr
    assert int(result.stdout) > 1000


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_fork_can_go_on():
    """A child of a process that had started threads has none; it must not wait for them."""
    result = run_python(SETUP + """
wanted = scene.intersect(rays)["t"]
cloud = raydix.Points(scene.vertices)
near = cloud.knn(scene.vertices, 3)["indices"]
child = os.fork()
if child == 0:
    signal.alarm(60)
    same = (scene.intersect(rays)["t"] == wanted).all()
    same = same and (cloud.knn(scene.vertices, 3)["indices"] == near).all()
    fresh = raydix.Scene(scene.vertices, scene.faces)
    same = same and (fresh.intersect(rays)["t"] == wanted).all()
    same = same and len(fresh.overlaps()) == len(scene.overlaps())
    os._exit(0 if same else 3)
_, status = os.waitpid(child, 0)
assert (scene.intersect(rays)["t"] == wanted).all()
print(os.waitstatus_to_exitcode(status))
""")
    assert (result.returncode, result.stdout.strip()) == (0, "0"), result.stderr


ENDLESS = {
    "occluded": "scene.occluded(np.broadcast_to(rays[5000, :3], (1 << 33, 3)), rays[5000, 4:7])",
    "picture": "scene.render(view='ao', size=(4000, 4000), samples=4096)",
    "count": "r = np.random.default_rng(1); "
    "soup = raydix.Scene(r.random((5000, 3)), r.integers(0, 5000, (3000, 3))); "
    "soup.count(np.broadcast_to([0.5, 0.5, 0.5], (10**9, 3)), np.array([0.1, 0.2, 0.3]))",
    "commit": "r = np.random.default_rng(1); world = raydix.Scene(); "
    "n = 1_500_000; world.add(r.random((n, 3)), r.integers(0, n, (n, 3))); "
    "world.commit(quality='high', threads=1)",
    "slow queries": "r = np.random.default_rng(1); "  # the first 2^20 would take minutes
    "soup = raydix.Scene(r.random((5000, 3)), r.integers(0, 5000, (5000, 3)), threads=1); "
    "soup.winding_number(np.full((1 << 20, 3), 0.5), rule='winding')",
    "simulator": "[raydix.simulate(scene, rays) for _ in range(100)]",
}


@pytest.mark.parametrize("what", list(ENDLESS))
def test_ctrl_c_ends_a_long_call(what):
    code = (
        "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
        + SETUP  # a job in the background is born deaf to it
        + f"print('started', flush=True)\ntry:\n    {ENDLESS[what]}\n"
        + "except KeyboardInterrupt:\n    print('interrupted')\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == "started\n"
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=120)
    finally:
        process.kill()
    assert out == "interrupted\n" and process.returncode == 0


def test_memory_of_a_hundred_million_queries():
    """What a call takes is its result and a little: 10^8 rays that lie at one place in memory, a
    byte each to answer."""
    result = run_python(SETUP + """
scene.occluded(rays)
def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
before = peak()
n = 100_000_000
away = np.float32([0, 0, 1])
flags = scene.occluded(np.broadcast_to(np.float32([0, 50, 0]), (n, 3)), away)
assert flags.shape == (n,) and not flags.any()
print(peak() - before - n)
""")
    assert result.returncode == 0, result.stderr
    assert int(result.stdout) < 200_000_000  # a piece of rays, and what a trace of one needs


def test_rays_are_read_where_they_lie():
    """10^7 rays are 320 MB: the call takes its 160 MB of hits, and no copy of the rays."""
    result = run_python(SETUP + """
n = 10_000_000
many = np.zeros((n, 8), np.float32)
many[:, 1], many[:, 6], many[:, 7] = 50, 1, np.inf
scene.intersect(many[:2_000_000])
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
hits = scene.intersect(many)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 - peak - 16 * n)
""")
    assert result.returncode == 0, result.stderr
    assert int(result.stdout) < 100_000_000


def test_lists_longer_than_a_piece_are_whole(rng):
    """More queries than are worked off at once: the pieces' lists are joined in order."""
    points = rng.uniform(size=(50, 3)).astype(np.float32)
    index = raydix.Points(points)
    n = (1 << 20) + 12345
    queries = np.zeros((n, 3), np.float32)
    queries[:] = points[np.arange(n) % 50]
    found = index.radius(queries, 0)
    np.testing.assert_array_equal(found["offsets"], np.arange(n + 1))
    np.testing.assert_array_equal(found["indices"], np.arange(n) % 50)
    scene = raydix.Scene([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    rays = np.tile(np.float32([0.2, 0.2, 1, 0, 0, 0, -1, np.inf]), (n, 1))
    rays[1::2, 0] = 5
    hits = scene.all_hits(rays)
    np.testing.assert_array_equal(hits["offsets"], (np.arange(n + 1) + 1) // 2)
    assert (hits["prim"] == 0).all() and len(hits["t"]) == (n + 1) // 2


def test_a_signal_handler_may_ask_but_not_refit():
    """A refit would wait for the batch that the handler interrupted: an error, not a hang."""
    result = run_python(
        SETUP + """
hits, refused = set(), []
def handler(*_):
    hits.add(int(scene.occluded(rays).sum()))
    try:
        scene.refit(scene.vertices)
    except raydix.InputError as error:
        refused.append(str(error))
wanted = int(scene.occluded(rays).sum())
signal.signal(signal.SIGALRM, handler)
signal.setitimer(signal.ITIMER_REAL, 0.1, 0.1)
away = np.float32([0, 0, 1])
while not refused:  # until one comes in the middle of a batch
    scene.occluded(np.broadcast_to(np.float32([0, 50, 0]), (20_000_000, 3)), away)
signal.setitimer(signal.ITIMER_REAL, 0)
assert hits == {wanted} and wanted > 0
scene.refit(scene.vertices)
print(refused[0])
""",
    )
    assert result.returncode == 0, result.stderr
    assert "signal handler" in result.stdout


def test_what_is_asked_with_hits_is_of_their_commit():
    """Hits, positions, normals and attributes of one call, while another thread commits."""
    quad = np.array([[-5, -5, 0], [5, -5, 0], [5, 5, 0], [-5, 5, 0.0]])
    scene = raydix.Scene(quad, [[0, 1, 2], [0, 2, 3]])
    done = threading.Event()

    def move():
        height = 0
        while not done.is_set():
            height ^= 10
            scene.update(0, quad + [0, 0, height])
            scene.commit()

    origins = np.zeros((500, 3))
    origins[:, 2] = 20
    mover = threading.Thread(target=move)
    mover.start()
    try:
        end = time.monotonic() + 3
        while time.monotonic() < end:
            hits = scene.intersect(origins, [0, 0, -1.0], also=("position", "normal"))
            np.testing.assert_allclose(hits.position[:, 2], 20 - hits.t)
            one = scene.intersect([0, 0, 20.0], np.array([0, 0, -1.0]), also="position")
            assert one.position[2] == 20 - one.t
    finally:
        done.set()
        mover.join()


FORKS = SETUP + """
points = raydix.Points(scene.vertices)
vertices = np.array(scene.vertices)
many = np.concatenate([rays] * 20)
scene.intersect(rays)
def in_child(*calls):
    child = os.fork()
    if child == 0:
        signal.alarm(60)
        try:
            for call in calls:
                call()
            os._exit(0)
        except raydix.InputError as error:
            print(error, flush=True)
            os._exit(1)
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_fork_while_others_ask_can_change():
    """The locks of threads that the child does not have must not keep it waiting."""
    result = run_python(FORKS + """
stop = False
def ask(call):
    while not stop:
        call()
threads = [
    threading.Thread(target=ask, args=(call,))
    for call in (lambda: scene.intersect(many), lambda: points.knn(vertices, 3))
]
for thread in threads:
    thread.start()
codes = []
for calls in (
    [lambda: scene.update(0, vertices + 0.1), lambda: scene.commit(), lambda: scene.intersect(rays)],
    [lambda: scene.refit(vertices + 0.1), lambda: scene.contains(vertices[:9])],
    [lambda: points.add(vertices[:50]), lambda: points.remove([3]), lambda: points.knn(vertices, 2)],
    [lambda: scene.remove(0), lambda: scene.add(vertices, scene.faces)],
):
    time.sleep(0.1)
    codes.append(in_child(*calls))
stop = True
for thread in threads:
    thread.join()
scene.refit(vertices)
print(codes)
""")
    assert (result.returncode, result.stdout) == (0, "[0, 0, 0, 0]\n"), result.stderr


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_fork_while_another_thread_changes():
    """What is half changed is an error in the child, all else is there."""
    result = run_python(FORKS + """
inside, go_on = threading.Event(), threading.Event()
def progress(part):
    inside.set()
    go_on.wait()
world = raydix.Scene()
world.add(vertices, scene.faces)
thread = threading.Thread(target=lambda: world.commit(progress=progress))
thread.start()
inside.wait()
codes = [in_child(lambda: scene.remove(0)), in_child(lambda: world.intersect(rays)),
         in_child(lambda: world.remove(0))]
go_on.set()
thread.join()
assert world.intersect(rays).hit.any()
print(codes)
""")
    told = "another thread was changing it when this process was forked off; make it again\n"
    assert result.returncode == 0, result.stderr
    assert result.stdout == f"scene: {told}remove: {told}[0, 1, 1]\n"
