"""trimesh's own tests of rays, from its archive of sources on PyPI, with our classes in place of
embreex and of trimesh's ray object."""

import importlib.metadata
import os
import pathlib
import subprocess
import sys
import tarfile

import pytest
import support

HERE = pathlib.Path(__file__).resolve().parent
ARCHIVES = HERE.parents[1] / "build" / "peer-sources"

FILES = ("test_ray.py", "test_ray_upstream.py", "test_thickness.py", "test_proximity.py")
"""All tests in these, and one in test_camera.py whose rays a camera makes."""
ONE_MORE = "test_camera.py::CameraTests::test_ray_index"
NOT_RUN = {
    "test_proximity.py::NearestTest::test_nearest_naive": "asks no ray: trimesh beside shapely",
}
NOT_PASSED = {
    "test_contains_cavity": "needs manifold3d, which cuts one box out of another",
}
"""What may not pass, and when."""


@pytest.fixture(scope="module")
def sources():
    """The folder of trimesh's tests, of the version that is installed."""
    support.peer("trimesh")
    version = importlib.metadata.version("trimesh")
    archive = ARCHIVES / f"trimesh-{version}.tar.gz"
    if not archive.is_file():
        pip = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--no-binary", ":all:"]
        try:
            done = subprocess.run(
                [*pip, "-d", str(ARCHIVES), f"trimesh=={version}"],
                capture_output=True,
                text=True,
                timeout=120,
            )
        except subprocess.TimeoutExpired:
            pytest.skip(f"trimesh {version}: no archive of sources after two minutes")
        if not archive.is_file():
            last = (done.stderr or done.stdout).strip().splitlines()[-1:]
            pytest.skip(f"trimesh {version}: no archive of sources: {' '.join(last)}")
    with tarfile.open(archive) as file:
        return {
            pathlib.PurePath(member.name).name: file.extractfile(member).read()
            for member in file.getmembers()
            if pathlib.PurePath(member.name).match("trimesh-*/tests/test_*.py")
        }


@pytest.mark.parametrize("stand_in", ["embree", "trimesh"])
def test_trimeshs_own_tests(sources, stand_in, tmp_path, capsys):
    support.peer("rtree")
    (tmp_path / "generic.py").write_bytes((HERE / "trimesh_generic.py").read_bytes())
    wanted = [*FILES, ONE_MORE]
    for name in wanted:
        file = name.split("::")[0]
        if file not in sources:
            pytest.skip(f"this trimesh has no {file}")
        (tmp_path / file).write_bytes(sources[file])
    left_out = [f"--deselect={name}" for name in NOT_RUN]
    results = support.run_tests(
        *wanted,
        f"--rootdir={tmp_path}",
        *left_out,
        cwd=tmp_path,
        env={**os.environ, "RAYDIX_STAND_IN": stand_in},
    )
    passed = sum(result == "passed" for result in results.values())
    others = {
        name.split("::")[-1]: result for name, result in results.items() if result != "passed"
    }
    with capsys.disabled():
        print(f"\ntrimesh's tests of rays on raydix.{stand_in}: {passed} of {len(results)} pass")
        for name, why in NOT_RUN.items():
            print(f"  not run: {name}: {why}")
        for name, result in others.items():
            print(f"  {result}: {name}: {NOT_PASSED.get(name, 'not explained')}")
    assert passed > 40 and set(others) <= set(NOT_PASSED)
