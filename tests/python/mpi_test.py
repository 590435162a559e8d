"""raydix.mpi: mpi_ranks.py under mpirun with several numbers of ranks, and what is said where something is missing."""

import importlib.util
import os
import pathlib
import re
import shutil
import subprocess
import sys

import pytest

RANKS_PROGRAM = pathlib.Path(__file__).with_name("mpi_ranks.py")
ROOT = pathlib.Path(__file__).resolve().parents[2]


def run(*arguments, ranks=None, **environment):
    launcher = []
    if ranks is not None:
        launcher = ["mpirun", "-n", str(ranks)]
    return subprocess.run(
        [*launcher, sys.executable, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
        env={
            **os.environ,
            "OMPI_ALLOW_RUN_AS_ROOT": "1",
            "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
            "OMPI_MCA_rmaps_base_oversubscribe": "1",
            "OMPI_MCA_hwloc_base_binding_policy": "none",
            "OMPI_MCA_mpi_yield_when_idle": "1",
            "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
            **environment,
        },
    )


@pytest.fixture(scope="module")
def mpi():
    """A skip that names what is missing; an import of its own, since MPI may start once in a process."""
    if importlib.util.find_spec("raydix._mpi") is None:
        pytest.skip("raydix was built without MPI: there is no raydix._mpi")
    if shutil.which("mpirun") is None:
        pytest.skip("there is no mpirun")
    done = run("-c", "import raydix.mpi")
    if done.returncode != 0:
        pytest.skip(f"raydix.mpi cannot be imported: {done.stderr.strip().splitlines()[-1]}")


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_the_bits_of_one_process(mpi, ranks):
    done = run(RANKS_PROGRAM, ranks=ranks)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("all checks passed") == ranks


def test_the_example_of_the_guide(mpi, tmp_path):
    page = (ROOT / "docs/distributed.md").read_text("utf-8")
    blocks = page.split("```python\n")[1:]
    assert len(blocks) == 1
    script = tmp_path / "spread.py"
    script.write_text(blocks[0].split("```")[0], "utf-8")
    done = run(script, ranks=3)
    assert done.returncode == 0, done.stderr
    # Without buffers a line and its end are written apart, and ranks write between them.
    assert sorted(re.findall(r"rank \d+: point \d+, geometry \d+ at [\d.]+", done.stdout)) == [
        f"rank {r}: point {1000 * r + 500}, geometry {r} at 1.0" for r in range(3)
    ]


def blocked(module, *more):
    """What `import raydix.mpi` says where a module cannot be imported."""
    program = "\n".join([f"import sys; sys.modules[{module!r}] = None", *more, "import raydix.mpi"])
    done = run("-c", program)
    assert done.returncode != 0
    return done.stderr.strip().splitlines()[-1]


def test_without_mpi4py():
    said = blocked("mpi4py")
    assert "raydix.mpi needs mpi4py" in said and "pip install mpi4py" in said


def test_without_mpi():
    stand_in = "import types; sys.modules['mpi4py'] = types.SimpleNamespace(MPI=None)"
    said = blocked("raydix._mpi", stand_in)
    assert "raydix.mpi needs the module raydix._mpi" in said and "libopenmpi-dev" in said


def test_another_mpi_library(mpi):
    program = (
        "from mpi4py import MPI; MPI.Get_library_version = lambda: 'Another MPI 1.0'\n"
        "import raydix.mpi"
    )
    done = run("-c", program)
    said = done.stderr.strip().splitlines()[-1]
    assert "different MPI libraries" in said and "Another MPI 1.0" in said


def test_mpi_for_one_thread_is_refused_by_name(mpi):
    program = (
        "import mpi4py; mpi4py.rc.thread_level = 'single'\n"
        "from mpi4py import MPI; import raydix.mpi\n"
        "raydix.mpi.DistributedPoints(MPI.COMM_WORLD, [[0.0, 0.0, 0.0]])"
    )
    done = run("-c", program)
    assert "InputError" in done.stderr and "MPI_THREAD_FUNNELED" in done.stderr
