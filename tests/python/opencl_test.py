"""Scenes on OpenCL devices: on Intel's driver for processors where scripts/setup --test has put it into
build/opencl-rt, elsewhere on what the system's loader finds."""

import os
import pathlib
import subprocess
import sys

import pytest

import raydix

CHECKS = pathlib.Path(__file__).with_name("opencl_checks.py")
DRIVER = CHECKS.parents[2] / "build" / "opencl-rt" / "lib"


def environment(folder):
    """With the driver, if it is there."""
    found = dict(os.environ)
    # open3d sets it where it is imported. Intel's driver then spoils memory when a process ends (docs/gpu.md).
    found.pop("TCM_ENABLE", None)
    if (DRIVER / "libintelocl.so").exists() and "OCL_ICD_VENDORS" not in found:
        (folder / "intel.icd").write_text(f"{DRIVER / 'libintelocl.so'}\n")
        found["OCL_ICD_VENDORS"] = str(folder)
        found["LD_LIBRARY_PATH"] = f"{DRIVER}:{found.get('LD_LIBRARY_PATH', '')}".rstrip(":")
    return found


def test_rays_on_a_device(tmp_path):
    done = subprocess.run(
        [sys.executable, CHECKS],
        env=environment(tmp_path),
        capture_output=True,
        text=True,
        timeout=600,
    )
    if done.returncode == 77 and os.environ.get("RAYDIX_DEVICE_REQUIRED") != "opencl":
        pytest.skip(done.stdout.strip())
    assert done.returncode == 0, done.stdout + done.stderr


def test_names_of_devices():
    names = [device.name for device in raydix.devices()]
    assert names[:2] == ["cpu", "cuda"] and names[2] in ("opencl", "opencl:0")
    assert names[-1].split(":")[0] == "hip"
    for device in raydix.devices():
        assert device.detail
        assert raydix.Scene(device=device.name).device == device.name
    wrong_names = ("opencl:", "opencl:x", "opencl:-1", "opencl: 0", "OpenCL", "hip:", "hip:-1", "gpu")
    for wrong in (*wrong_names, None, 0):
        with pytest.raises(ValueError, match="device: expected 'cpu', .* 'hip' or 'hip:N'"):
            raydix.Scene(device=wrong)


def test_a_device_that_is_missing_says_so():
    """When it is asked, with the reason that `devices` gives."""
    for device in raydix.devices():
        if device.available:
            continue
        scene = raydix.Scene([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], device=device.name)
        with pytest.raises(raydix.BackendUnavailable) as error:
            scene.intersect([[0.2, 0.2, 1, 0, 0, 0, -1, 9]])
        assert str(error.value) == device.detail
        assert scene.closest_point([0.2, 0.2, 1])["distance"] == 1
