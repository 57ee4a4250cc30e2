"""calfsocket answers what a prosthetic socket does inside a leg.

A FEniCSx application: a transverse section of a calf with 27 regions of 6 tissues, pressed by
deformable prosthetic sockets through large-sliding frictional Nitsche contact.
"""

from pathlib import Path

__version__ = "0.1.0"

# `calfsocket.meshes` and `calfsocket.forms` lie at the top of the repository. An installed package
# has them as ordinary subpackages; in a bare checkout, the repository joins the search path.
_repository = Path(__file__).resolve().parent.parent
if (_repository / "pyproject.toml").is_file() and (_repository / "meshes" / "tags.py").is_file():
    __path__.append(str(_repository))
