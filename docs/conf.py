"""Sphinx: the pages of this folder, the executed gallery of examples/, and the reference from the docstrings.

`make docs` builds them without a network, with warnings as errors, from a copy of the sources. So no file is written into this folder.
"""

import sys
from pathlib import Path

import matplotlib

import armlet

matplotlib.use("Agg")
sys.path.insert(0, str(Path(__file__).parent))
import house

project = "armlet"
copyright = "The armlet developers"  # Sphinx reads this name
version = release = armlet.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_gallery.gen_gallery",
    "sphinxcontrib.bibtex",
    "sphinx-mathjax-offline",  # MathJax among the pages: formulas are rendered without a network
    "house",
    "live_loops",  # links to the pages of tools/docs.sh that run loops
]
root_doc = "index"
exclude_patterns = ["_build", "auto_examples/**/*.ipynb"]
templates_path = ["_templates"]
nitpicky = False
html_theme = "furo"
html_title = f"armlet {release}"
html_show_sphinx = False
html_static_path = ["_static"]
html_extra_path = ["../extra"] if (Path(__file__).parents[1] / "extra").is_dir() else []  # made by tools/docs.sh
html_css_files = ["pages.css"]
myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]  # the fence that GitHub renders too
bibtex_bibfiles = ["references.bib"]
bibtex_default_style = "alpha"
autosummary_generate = True
autodoc_typehints = "none"  # the docstrings say shape and unit, which types cannot
autodoc_member_order = "bysource"
default_role = "code"
napoleon_custom_sections = [("Other Args", "params_style")]  # the arguments that few calls need
napoleon_use_rtype = False  # "Returns:" has the type and the text in one line
napoleon_use_ivar = True  # attributes stand in the docstring of their class, once

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "auto_examples",
    "filename_pattern": house.executed(Path(__file__).parents[1] / "examples"),
    "reset_argv": "house.with_figure",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "min_reported_time": 1e9,
    "show_memory": False,
    "write_computation_times": False,
    "download_all_examples": False,
    "show_signature": False,
    "image_scrapers": ("matplotlib",),
}
