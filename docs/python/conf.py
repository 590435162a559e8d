"""Sphinx: the reference is made from the docstrings of the installed package. scripts/python-docs
runs it."""

import raydix

project = "raydix"
author = "the raydix authors"
version = release = raydix.__version__
extensions = ["sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode", "myst_parser"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["*.ipynb"]
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
napoleon_numpy_docstring = True
napoleon_google_docstring = False
html_theme = "alabaster"
html_title = "raydix for Python"
nitpicky = False
