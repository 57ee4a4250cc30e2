"""Settings of the documentation, which `python3 -m sphinx docs docs/_build` makes into a site."""

import sys
from pathlib import Path

import calfsocket

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "calfsocket"
version = release = calfsocket.__version__
project_copyright = "the authors of calfsocket"

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "mathml",
    "reference_tables",
]
exclude_patterns = ["_build", "_generated"]
nitpicky = True

html_theme = "furo"
html_title = f"calfsocket {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"
html_copy_source = False

myst_enable_extensions = ["amsmath", "colon_fence", "dollarmath"]
# The verification page links to its own headings, by the names that code forges give them.
myst_heading_anchors = 3

# Tutorials are run when the site is built, so that what they show is what the program does now.
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True

autodoc_typehints = "none"
autodoc_member_order = "bysource"
autosummary_generate = True
numpydoc_show_class_members = False
