"""Settings of the documentation: `python3 -m sphinx docs docs/_build/html` builds the site."""

import os
import shutil
import sys
from pathlib import Path

from sphinx.application import Sphinx

import calfsocket

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "calfsocket"
version = release = calfsocket.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "sphinx.ext.mathjax",
    "reference_tables",
]
exclude_patterns = ["_build", "_generated"]
templates_path = ["_templates"]
nitpicky = True
default_role = "code"

html_theme = "furo"
html_title = f"calfsocket {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_copyright = False

myst_enable_extensions = ["amsmath", "colon_fence", "dollarmath"]
# The verification page links to its own headings, by the names that code forges give them.
myst_heading_anchors = 3

# Tutorials are run when the site is built, so that what they show is what the program does now.
nb_execution_mode = "force"
os.environ["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"  # of their kernels
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True
nb_output_stderr = "remove"  # progress

autodoc_typehints = "none"
autodoc_member_order = "bysource"
autosummary_generate = True
numpydoc_show_class_members = False

# Debian's MathJax, copied into the site: formulas need no network. MyST's own settings are for
# MathJax 3.
MATHJAX = Path("/usr/share/javascript/mathjax")
myst_update_mathjax = False
mathjax_path = "mathjax/MathJax.js"
mathjax2_config = {
    "jax": ["input/TeX", "output/CommonHTML"],
    "extensions": ["tex2jax.js"],
    "CommonHTML": {"scale": 90},
    "TeX": {"extensions": ["AMSmath.js", "AMSsymbols.js"]},
    "tex2jax": {
        "inlineMath": [["\\(", "\\)"]],
        "ignoreClass": "body",
        "processClass": "math",
    },
    "showMathMenu": False,
    "messageStyle": "none",
}


def copy_mathjax(app: Sphinx, error: Exception | None) -> None:
    """Copy what the settings above load."""
    if error or app.builder.format != "html":
        return
    target = Path(app.outdir) / "_static" / "mathjax"
    for part in (
        "MathJax.js",
        "extensions",
        "fonts/HTML-CSS/TeX/woff",
        "jax/element",
        "jax/input/TeX",
        "jax/output/CommonHTML",
    ):
        source = MATHJAX / part
        if source.is_dir():
            shutil.copytree(source, target / part, dirs_exist_ok=True)
        else:
            target.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target / part)


def setup(app: Sphinx) -> None:
    """Copy MathJax when a build ends."""
    app.connect("build-finished", copy_mathjax)
