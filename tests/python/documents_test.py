"""The tutorial runs from top to bottom; the site of the documents is built without a warning; docstrings say
what they should."""

import importlib.util
import inspect
import os
import pathlib
import shutil
import subprocess
import sys

import pytest

import raydix
import raydix.open3d
import raydix.scipy
import raydix.trimesh
from raydix.embree import mesh_construction, rtcore_scene

ROOT = pathlib.Path(__file__).resolve().parents[2]


def require(*modules):
    for module in modules:
        if importlib.util.find_spec(module) is None:
            pytest.skip(f"{module} is not installed")


def test_the_tutorial_runs(tmp_path):
    require("nbclient", "nbformat", "ipykernel", "matplotlib")
    import nbclient
    import nbformat

    notebook = nbformat.read(ROOT / "docs/python/tutorial.ipynb", as_version=4)
    client = nbclient.NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": tmp_path}}
    )
    client.create_kernel_manager()
    client.km.kernel_spec.argv[0] = (
        sys.executable
    )  # this interpreter, whatever kernels the machine has registered
    client.execute()
    outputs = [
        output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs
    ]
    pictures = [output for output in outputs if "image/png" in output.get("data", {})]
    assert len(pictures) == 4 and not any(output.output_type == "error" for output in outputs)
    assert any("<table>" in output.get("data", {}).get("text/html", "") for output in outputs)
    printed = "".join(output.text for output in outputs if output.output_type == "stream")
    assert "beams came back" in printed and "dynamic_fetch" in printed


def test_the_site_builds_without_a_warning():
    require("sphinx", "myst_parser", "breathe")
    if shutil.which("doxygen") is None:
        pytest.skip("doxygen is not installed")
    done = subprocess.run(
        [ROOT / "scripts/docs"],
        env={**os.environ, "PYTHON": sys.executable},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    site = ROOT / "build/docs/html"
    assert "BasicScene" in (site / "cpp/scenes.html").read_text("utf-8")
    page = (site / "python/reference.html").read_text("utf-8")
    for name in raydix.__all__:
        assert (
            name == "__version__" or f'id="raydix.{name}"' in page
        ), f"{name} is not in the reference"


def public_things():
    stand_ins = (raydix.scipy, raydix.trimesh, raydix.open3d, rtcore_scene, mesh_construction)
    for module in (raydix, *stand_ins):
        for name, thing in vars(module).items():
            if (
                name.startswith("_")
                or not callable(thing)
                or not getattr(thing, "__module__", "").startswith("raydix")
            ):
                continue
            yield f"{module.__name__}.{name}", thing
            if inspect.isclass(thing):
                for member, value in inspect.getmembers(thing):
                    if not member.startswith("_") and (
                        inspect.isfunction(value) or isinstance(value, property)
                    ):
                        yield f"{module.__name__}.{name}.{member}", value


def test_everything_public_has_a_docstring():
    things = dict(public_things())
    assert len(things) > 60
    missing = [name for name, thing in things.items() if not (thing.__doc__ or "").strip()]
    assert not missing


def test_examples_in_docstrings_name_what_exists():
    assert set(raydix.__all__) <= set(vars(raydix))
