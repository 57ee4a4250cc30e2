"""The calibration: Separate's curve, the combined law fitted to it, and what else is compared."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from calfsocket.calibration.fit import Fit, fit_curve, ogden
from calfsocket.calibration.indentation import Curve, Indentation
from calfsocket.calibration.names import FITTED, IGNORED, SEPARATE, TABLE1
from calfsocket.calibration.record import deviation
from calfsocket.calibration.specimen import Specimen, compound_specimen, limb_specimen
from calfsocket.contact.parameters import Contact
from calfsocket.io.errors import InputError
from calfsocket.materials.laws import Law, Ogden
from calfsocket.materials.material_set import MaterialSet
from calfsocket.materials.tissues import KPA, FasciaC10
from calfsocket.meshes.compound import Compound
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.sizing import named_size
from calfsocket.postprocess.extract import section_fields
from calfsocket.postprocess.fields import SectionFields

STARTS = (ogden(5e-3, 5.0), ogden(30e-3, 25.0))
"""Where searches begin, on either side of any combined material of muscle and fascia."""

NAMES = {SEPARATE: "Separate", FITTED: "Combined (fitted)", TABLE1: "Combined (Table 1)"}
"""Curves as statements name them."""


@dataclass(frozen=True)
class Settings:
    """What a calibration depends on."""

    compound: Compound
    limb: Limb
    specimen: Literal["compound", "limb"] = "compound"
    size: str = "coarse"  #: of the mesh
    fascia_c10: FasciaC10 = "printed"
    materials: Mapping[str, Law] = field(default_factory=dict)  #: in the place of Table 1's laws
    contact: Contact = field(default_factory=Contact)
    stroke: float | None = None  #: way of the plate, mm; the specimen's own otherwise
    points: int = 8  #: of each curve
    starts: tuple[Ogden, ...] = STARTS  #: of searches; the best result counts
    free_d: bool = False  #: whether D1 is fitted, too, instead of following from nu = 0.495

    def __post_init__(self) -> None:
        needed = 4 if self.free_d else 3
        if self.points < needed:
            raise InputError(f"--points: is {self.points}; the fit needs at least {needed}")
        if self.stroke is not None and not 0 < self.stroke < np.inf:
            raise InputError(f"--stroke: is {self.stroke}; give a length above 0, in mm")


@dataclass(frozen=True)
class Calibration:
    """Results of a calibration."""

    specimen: Specimen
    curves: dict[str, Curve]  #: `SEPARATE`, `FITTED`, `TABLE1` and `IGNORED`
    fits: tuple[Fit, ...]  #: one a start, the best first
    fields: SectionFields | None  #: Separate's state at the full stroke, on rank 0

    @property
    def law(self) -> Ogden:
        """The fitted combined law."""
        return self.fits[0].law

    @property
    def displacement(self) -> NDArray[np.float64]:
        """Way of the plate at the points of all curves, mm, (n,)."""
        return self.curves[SEPARATE].displacement

    @property
    def force_per_metre(self) -> dict[str, NDArray[np.float64]]:
        """Force of each curve, N per metre of limb, (n,)."""
        return {name: np.asarray(curve.force / KPA) for name, curve in self.curves.items()}

    def deviation(self, name: str) -> float:
        """Root mean square difference of a curve to Separate's, as a share of its largest force."""
        return deviation(self.force_per_metre, name)

    def ordering(self) -> dict[str, bool]:
        """Return which of the paper's observations (section 4) hold here."""
        ignored = self.curves[IGNORED].force
        softer = {
            f"ignoring fascia is softer than {title}": bool(
                np.all(ignored < self.curves[name].force)
            )
            for name, title in NAMES.items()
        }
        further = {
            f"ignoring fascia is further from Separate than {title}": (
                self.deviation(IGNORED) > self.deviation(name)
            )
            for name, title in NAMES.items()
            if name != SEPARATE
        }
        return softer | further


def separate_laws(settings: Settings) -> dict[str, Law]:
    """Laws of the separate materials, by tissue."""
    paper = MaterialSet.paper("separate", settings.fascia_c10)
    return paper.replace_known(settings.materials).tissue_laws()


def calibrate(
    comm: MPI.Comm, settings: Settings, on_line: Callable[[str], None] = lambda text: None
) -> Calibration:
    """Solve all curves and fit the combined law (collective); `on_line` gets a line for each."""
    size = named_size(settings.size)
    if settings.specimen == "compound":
        specimen = compound_specimen(comm, settings.compound, size)
    else:
        specimen = limb_specimen(comm, settings.limb, size)
    if settings.stroke is not None:
        specimen = replace(specimen, stroke=settings.stroke)
    displacements = specimen.stroke / settings.points * np.arange(1.0, settings.points + 1)
    separate = separate_laws(settings)
    curves = {}

    def press(name: str, laws: Mapping[str, Law]) -> Indentation:
        test = Indentation(specimen, laws, settings.contact)
        curves[name] = test.curve(displacements, count_modes=True)
        on_line(f"{name}: {curves[name].force[-1]:.4g} N/mm at {specimen.stroke:g} mm")
        return test

    reference = press(SEPARATE, separate)
    fields = section_fields(reference.problem, specimen.tissues)
    press(IGNORED, separate | {"fascia": separate["muscle"]})

    def combined(law: Law) -> dict[str, Law]:
        return separate | {"muscle": law, "fascia": law}

    table1 = MaterialSet.paper("combined").replace_known(settings.materials).laws["combined"]
    test = press(TABLE1, combined(table1))

    def curve_of(law: Ogden, neighbours: Sequence[Ogden]) -> Curve:
        test.set_laws(combined(law))
        return test.curve(displacements, variations=[combined(near) for near in neighbours])

    def on_curve(law: Ogden, rms: float) -> None:
        on_line(f"mu {1e3 * law.mu[0]:.4g} kPa, alpha {law.alpha[0]:.4g}: {100 * rms:.3g} % off")

    fits = sorted(
        (
            fit_curve(curve_of, curves[SEPARATE].force, start, settings.free_d, on_curve)
            for start in settings.starts
        ),
        key=lambda fit: fit.rms,
    )
    test.set_laws(combined(fits[0].law))
    curves[FITTED] = test.curve(displacements, count_modes=True)
    return Calibration(specimen, curves, tuple(fits), fields)
