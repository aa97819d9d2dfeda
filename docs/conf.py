"""The book: `make docs` builds it with Sphinx; build/docs/index.html is its front page."""

from __future__ import annotations

import sys
from importlib.metadata import distribution
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from inercal import __version__

project = "inercal"
author = "The inercal developers"
copyright = author
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax", "generated"]
# MathJax as it is published, in a package of its own: the book is read without a network
_MATHJAX = distribution("sphinx-mathjax-offline").locate_file("sphinx-mathjax-offline/static")
exclude_patterns = ["paper", "pictures"]

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_use_type_comments = False  # there are none; to look for them, every module is parsed
autodoc_type_aliases = {name: name for name in ("Array", "ArrayLike")}
python_use_unqualified_type_names = True
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
default_role = "py:obj"
toc_object_entries = False
suppress_warnings = ["ref.python"]  # a short name in a docstring that several rooms have

html_theme = "furo"
html_title = f"inercal {version}"
html_static_path = ["style", str(_MATHJAX)]
html_css_files = ["book.css"]
html_copy_source = False
html_show_sphinx = False
mathjax_path = "mathjax/tex-chtml.js"
