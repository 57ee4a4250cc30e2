"""fields.pvd: the fields of a case over load steps and stages, as one series for ParaView."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree

from calfsocket.io.files import replacing
from calfsocket.postprocess.quantities import Quantities
from calfsocket.postprocess.vtu import FIELDS_FILE, write_fields

SERIES_FILE = "fields.pvd"
STEPS_FOLDER = "load_steps"
_DIGITS = 6
"""Of a load in the name of its folder: steps are 0.001 or larger by default."""


def write_step(folder: Path, quantities: Quantities, load: float) -> Path:
    """Write the fields of an equilibrium on the way to the full load."""
    own = _of_step(folder, load)
    own.mkdir(parents=True, exist_ok=True)
    return write_fields(own, quantities, load)


def _of_step(folder: Path, load: float) -> Path:
    return Path(folder) / STEPS_FOLDER / f"{load:.{_DIGITS}f}"


def loads_of_steps(folder: Path) -> list[float]:
    """Return the loads whose fields `write_step` has written, in their order."""
    written = (Path(folder) / STEPS_FOLDER).glob(f"*/{FIELDS_FILE}")
    return sorted(float(path.parent.name) for path in written)


def remove_steps(folder: Path, beyond: float = -1.0) -> None:
    """Remove the fields of the loads beyond one; by default of all."""
    for load in loads_of_steps(folder):
        if load > round(beyond, _DIGITS):
            own = _of_step(folder, load)
            (own / FIELDS_FILE).unlink(missing_ok=True)
            with suppress(OSError):  # it holds something else
                own.rmdir()
    with suppress(OSError):
        (Path(folder) / STEPS_FOLDER).rmdir()


def write_series(folder: Path, load: float, states: Sequence[str]) -> Path | None:
    """Write fields.pvd where a case has more than one state; return its path.

    Time is the load, 0 to 1, up to the donned socket; each stage of loading then takes 1.
    """
    folder = Path(folder)
    times = {at: _of_step(folder, at) for at in loads_of_steps(folder) if at < load}
    times[load] = folder
    times |= {load + number: folder / name for number, name in enumerate(states, 1)}
    if len(times) == 1:
        return None
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    collection = ElementTree.SubElement(root, "Collection")
    for time, place in times.items():
        file = (place / FIELDS_FILE).relative_to(folder).as_posix()
        ElementTree.SubElement(collection, "DataSet", timestep=f"{time:.6g}", part="0", file=file)
    ElementTree.indent(root)
    path = folder / SERIES_FILE
    with replacing(path) as temporary:
        temporary.write_text(ElementTree.tostring(root, encoding="unicode") + "\n", "utf-8")
    return path
