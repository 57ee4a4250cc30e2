"""Contact of a limb's levels unrolled over angle and height, and as a surface in space."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from calfsocket.io.files import replacing
from calfsocket.io.tables import FLOAT_FORMAT
from calfsocket.meshes.curves import ClosedCurve
from calfsocket.meshes.frame import Frame
from calfsocket.meshes.levels import Place
from calfsocket.meshes.limb import Limb
from calfsocket.postprocess.contact_line import RUNNING_MEAN_MM, ContactLine, running_mean
from calfsocket.postprocess.vtu import xml_text

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

ANGLE_STEP = 2.0
"""Distance of the angles of a map, degrees: 1.7 mm on a limb of 50 mm radius, less than the window
of the running mean."""

SKIN_STEP_MM = 0.25
"""Distance of the points of the skin among which those at the angles are found."""

PLANE_STRAIN = (
    "Each level is a section in plane strain, solved on its own: the limb is taken as endless and "
    "alike along its axis there, so that nothing moves or carries load from one level to the next."
)
"""What a reader must know of results along a limb."""


def angles() -> Array:
    """Return the anatomical angles of every map, degrees."""
    return np.asarray(np.arange(0.0, 360.0, ANGLE_STEP))


@dataclass(frozen=True)
class MapLevel:
    """A level of a map.

    Attributes
    ----------
    place : Place
        Where along the limb it lies.
    missing : str
        Why there are no results; empty where there are.
    points : Array
        The unloaded skin at the angles of the map in the source's axes, mm, (m, 3); NaN where there
        is no section.
    pressure_kPa, shear_kPa : Array
        Contact pressure and friction at the angles, (m,), both as running means along the skin;
        friction is positive toward larger anatomical angles. NaN where there are no results.
    error_kPa : float
        Mesh error of the level's largest pressure; NaN without a second mesh.
    """

    place: Place
    missing: str = ""
    points: Array = field(default_factory=lambda: np.full((len(angles()), 3), np.nan))
    pressure_kPa: Array = field(default_factory=lambda: np.full(len(angles()), np.nan))
    shear_kPa: Array = field(default_factory=lambda: np.full(len(angles()), np.nan))
    error_kPa: float = np.nan

    @property
    def solved(self) -> bool:
        """Whether there are results."""
        return not self.missing

    @classmethod
    def of(
        cls,
        place: Place,
        limb: Limb | None,
        line: ContactLine | None,
        missing: str = "",
        error_kPa: float = np.nan,
    ) -> "MapLevel":
        """Make a level of its section and the contact along it; None where there is none."""
        points: dict[str, Any] = {} if limb is None else {"points": placed(limb, place)}
        if line is None or limb is None:
            return cls(place, missing or "not solved", **points)
        frame = limb.frame
        angle = frame.anatomical(line.angle_deg)
        turn = np.sign((frame.anatomical(1.0) - frame.anatomical(0.0) + 180) % 360 - 180)
        return cls(
            place,
            "",
            **points,
            pressure_kPa=_at_angles(angle, line.running_mean_kPa),
            shear_kPa=turn * _at_angles(angle, running_mean(line, values=line.shear_kPa)),
            error_kPa=error_kPa,
        )


@dataclass(frozen=True)
class PressureMap:
    """Contact of one socket and material set over anatomical angle and height.

    Attributes
    ----------
    socket, material_set : str
        Names of the cases, without their level.
    levels : sequence of MapLevel
        From distal to proximal, with those that have no results.
    frame : Frame
        Whether the angles are anatomical; where a limb's axes are not known, they are polar.
    """

    socket: str
    material_set: str
    levels: Sequence[MapLevel]
    frame: Frame

    @property
    def name(self) -> str:
        """Start of the names of its files."""
        return f"{self.socket}_{self.material_set}"

    @property
    def missing(self) -> dict[str, str]:
        """Level -> why it has no results."""
        return {each.place.name: each.missing for each in self.levels if not each.solved}

    @property
    def height_mm(self) -> Array:
        """Heights of the levels from the distal end, (n,)."""
        return np.array([each.place.height_mm for each in self.levels])

    @property
    def pressure_kPa(self) -> Array:
        """Contact pressure, (n levels, m angles); NaN where a level is missing."""
        return np.stack([each.pressure_kPa for each in self.levels])

    @property
    def shear_kPa(self) -> Array:
        """Friction, as `pressure_kPa`."""
        return np.stack([each.shear_kPa for each in self.levels])

    @property
    def table(self) -> "pd.DataFrame":
        """One row a level and angle; pressure and shear are empty where a level is missing."""
        import pandas as pd

        angle = angles()
        return pd.concat(
            [
                pd.DataFrame(
                    {
                        "level": each.place.height,
                        "height_mm": each.place.height_mm,
                        "angle_deg": angle,
                        "pressure_kPa": each.pressure_kPa,
                        "shear_kPa": each.shear_kPa,
                        **dict(zip(("x_mm", "y_mm", "z_mm"), each.points.T, strict=True)),
                    }
                )
                for each in self.levels
            ],
            ignore_index=True,
        )

    def surface(self) -> Any:
        """Return the skin between the levels as a pyvista surface in the source's axes, mm.

        Point data are pressure_kPa, shear_kPa, level, height_mm and angle_deg; NaN where a level is
        missing. Cell data: `solved` is 1 where both levels at a cell's ends have results. There are
        no cells across a level of which there is no section.
        """
        import pyvista  # takes a second

        table, n = self.table, len(angles())
        around = np.arange(n)
        quads, solved = [], []
        for row, (below, above) in enumerate(zip(self.levels[:-1], self.levels[1:], strict=True)):
            if np.isnan([below.points, above.points]).any():
                continue
            here, onward = row * n + around, row * n + np.roll(around, -1)
            quads.append(np.column_stack([here, onward, onward + n, here + n]))
            solved.append(np.full(n, below.solved and above.solved, dtype=np.uint8))
        faces = np.concatenate(quads) if quads else np.empty((0, 4), dtype=int)
        used, cells = np.unique(faces, return_inverse=True)
        rows = table.iloc[used]
        points = rows[["x_mm", "y_mm", "z_mm"]].to_numpy()
        found = pyvista.PolyData.from_regular_faces(points, cells.reshape(-1, 4))
        for column in ("pressure_kPa", "shear_kPa", "level", "height_mm", "angle_deg"):
            found.point_data[column] = rows[column].to_numpy()
        found.cell_data["solved"] = np.concatenate(solved) if solved else np.empty(0, np.uint8)
        return found

    def write(self, folder: Path) -> tuple[Path, Path]:
        """Write NAME.csv and NAME.vtp; return their paths."""
        from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

        csv, vtp = folder / f"{self.name}.csv", folder / f"{self.name}.vtp"
        with replacing(csv) as temporary:
            self.table.to_csv(temporary, index=False, float_format=FLOAT_FORMAT)
        with replacing(vtp) as temporary:
            temporary.write_text(xml_text(vtkXMLPolyDataWriter(), self.surface()), encoding="ascii")
        return csv, vtp


def placed(limb: Limb, place: Place) -> Array:
    """Return the skin of a section at the angles of a map, in the source's axes, mm, (m, 3).

    A limb that was not made of a source in space stands upright: z is its height.
    """
    flat = _skin_at_angles(limb.skin, limb.frame)
    source = limb.source
    if source is None or source.origin is None or source.normal is None or source.anterior is None:
        return np.column_stack([flat, np.full(len(flat), place.height_mm)])
    y, normal = np.array(source.anterior), np.array(source.normal)
    return np.asarray(np.array(source.origin) + flat @ np.stack([np.cross(y, normal), y]))


def _skin_at_angles(skin: ClosedCurve, frame: Frame) -> Array:
    points = skin.evaluate(skin.sample(SKIN_STEP_MM))
    angle = frame.angle(points)
    return np.column_stack([_at_angles(angle, points[:, axis]) for axis in (0, 1)])


def _at_angles(angle: Array, values: Array) -> Array:
    """Return values at the angles of a map, linear between those around the limb."""
    order = np.argsort(angle, kind="stable")
    return np.interp(angles(), angle[order], values[order], period=360.0)


WINDOW = f"{RUNNING_MEAN_MM:g} mm"
"""Of the running mean, in words."""
