"""Sphinx: the pages of this folder, the C++ reference from the headers (Doxygen, Breathe), the Python
reference from the docstrings of the installed package. scripts/docs runs it."""

import os
import pathlib
import re
import sys
import types

import raydix

ROOT = pathlib.Path(__file__).resolve().parent.parent

# raydix.mpi is read without MPI: by modules that stand for what it imports.
mpi4py, raydix_mpi = types.ModuleType("mpi4py"), types.ModuleType("raydix._mpi")
mpi4py.MPI = types.SimpleNamespace(Comm=type("Comm", (), {}), Get_library_version=str, Is_initialized=bool)
raydix_mpi.library, raydix_mpi.CommunicationError = str, RuntimeError
sys.modules.update({"mpi4py": mpi4py, "raydix._mpi": raydix_mpi})

project = "raydix"
author = "the raydix authors"
version = release = raydix.__version__
extensions = ["sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode", "myst_parser", "breathe"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["**/*.ipynb", "performance/figures.json"]

myst_heading_anchors = 4

breathe_projects = {"raydix": os.environ["RAYDIX_DOXYGEN_XML"]}
breathe_default_project = "raydix"
breathe_show_include = False

autodoc_typehints = "signature"
autodoc_type_aliases = {name: name for name in ("ArrayLike", "DTypeLike")}  # else each is five lines
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
napoleon_numpy_docstring = True
napoleon_google_docstring = False

html_theme = "alabaster"
html_title = "raydix"
html_theme_options = {"page_width": "1100px", "sidebar_width": "260px", "fixed_sidebar": True}
nitpicky = False


def name_aliases(app, what, name, obj, options, signature, returns):
    """A union with an alias says how the alias is stored."""
    return tuple(text and re.sub(r"TypeAliasForwardRef\('(\w+)'\)", r"\1", text) for text in (signature, returns))


def setup(app):
    app.connect("autodoc-process-signature", name_aliases)
