"""Sphinx configuration: `make docs` builds the site in build/docs."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

project = "rig-service"
extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "reference_pages",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
templates_path = ["_templates"]
exclude_patterns = ["viewers"]
html_theme = "furo"
html_title = "rig-service"
html_copy_source = False
html_show_copyright = False
myst_heading_anchors = 4
suppress_warnings = ["myst.header"]  # an operation of the REST reference stands below its tag without a level between
autodoc_typehints = "none"  # the docstrings state the types
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
