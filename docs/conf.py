"""How the documentation is built: sphinx-build docs docs/_build."""

import os
import sys
from importlib import metadata
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_extensions"))

project = "quakedesign"
author = "the quakedesign authors"
copyright = author
version = release = metadata.version("quakedesign")
extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "myst_nb",
    "generated",
    "mathml",
]
source_suffix = {".md": "myst-nb", ".rst": "restructuredtext"}
exclude_patterns = ["_build", "_extensions", "jupyter_execute", "tutorial/own", "reference/_*"]
suppress_warnings = ["myst-nb.lexer", "misc.highlighting_failure"]

myst_enable_extensions = ["colon_fence", "dollarmath", "deflist"]
myst_heading_anchors = 3
nb_execution_mode = os.environ.get("QUAKEDESIGN_DOCS_EXECUTE", "off")
nb_execution_raise_on_error = True
nb_execution_timeout = 600

autosummary_generate = False
autodoc_typehints = "none"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

if "QUAKEDESIGN_DOCS_ONLINE" in os.environ:  # links into other projects need their inventories from the network
    extensions.append("sphinx.ext.intersphinx")
    intersphinx_mapping = {
        "python": ("https://docs.python.org/3", None),
        "control": ("https://python-control.readthedocs.io/en/stable", None),
        "casadi": ("https://web.casadi.org/python-api", None),
        "cvxpy": ("https://www.cvxpy.org", None),
        "sympy": ("https://docs.sympy.org/latest", None),
    }

html_math_renderer = "mathml"
html_theme = "furo"
html_title = "quakedesign"
