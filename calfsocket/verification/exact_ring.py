r"""The concentric limb in a smaller socket against its exact solution.

Rings of all six tissues lie around a fixed circle as in a calf, bone innermost and skin outermost.
A PETG ring, smaller than the skin by the overclosure, presses on them. The exact solution solves
ordinary differential equations (`radial`) and is made without UFL; the finite elements are the
program's own `Problem` and `LoadStepper`.

The axisymmetric equilibrium may be unstable. Fascia (megapascals) compressed along its
circumference between muscle and fat (kilopascals) buckles in waves. On a perfect ring Newton's
method converges to the unstable equilibrium all the same, which is what a measurement of the error
needs. The number of unstable modes is known as well, from the second variation of the potential,
wave number by wave number (`ring_stability`), and the program must count the same. In the Combined
set nothing buckles, because fascia is as soft as muscle there.

Below 1 mm the error falls with the first instead of the fourth power of the element size: 4 Gauss
points on an edge do not resolve the kinks of the socket's shape functions inside it. With 16 points
the error falls from 6e-7 to 6e-8 in a ring of muscle and skin at 0.5 mm; on a limb neither can be
measured.
"""

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from calfsocket.materials.material_set import BaseSet, MaterialSet
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.problem import Problem
from calfsocket.mechanics.stepping import LoadStep, LoadStepper
from calfsocket.meshes.rings import ring_mesh
from calfsocket.postprocess.extract import KILOPASCAL, section_fields
from calfsocket.verification.radial import (
    LIMB,
    SOCKET,
    SOCKET_THICKNESS,
    ExactRing,
    exact_ring,
    work_error,
)
from calfsocket.verification.report import LOG, Check, Curve, Section, curves
from calfsocket.verification.ring_stability import onset, unstable_waves
from calfsocket.verification.sampling import skin_mean, worst

FloatArray = NDArray[np.float64]

OVERCLOSURE = 0.92
"""mm; 5.3 % of the limb's area, as much as the tightest socket of the study takes off. No quarter
of it is within 5 % of an overclosure at which another wave becomes unstable."""

MATERIALS: tuple[BaseSet, ...] = ("separate", "combined")
STEPS = 4
WAVES = range(41)


@dataclass(frozen=True)
class RingErrors:
    """One ring of a solved section against the exact solution at the elements' Gauss points."""

    #: (2,) difference of the mean Cauchy stress, radial and hoop, over the ring's largest exact one
    mean_stress: FloatArray
    mean_stretch: FloatArray  #: (2,) difference of the mean stretch, radial and hoop
    #: root mean square of the difference of all components at all points, on the same scale
    rms_stress: float
    rms_stretch: float


@dataclass(frozen=True)
class RingCase:
    """A solved load step against the exact solution."""

    name: str  #: material set, and how much of the overclosure is released
    load: float  #: its released share
    #: relative errors of the mean contact pressure per undeformed area, and of the mean radius of
    #: the skin over its displacement
    pressure_error: float
    radius_error: float
    pressure_scatter: float  #: standard deviation of the contact pressure over its mean
    #: errors by ring, the socket among them; empty where not asked for
    rings: dict[str, RingErrors]
    exact: ExactRing  #: what it is compared with
    negative_modes: int | None  #: of the equilibrium; None where not counted

    @property
    def exact_modes(self) -> int:
        """Unstable modes of the exact solution."""
        return sum(unstable_waves(self.exact.solution, WAVES).values())

    def checks(self) -> list[Check]:
        """Check everything, at 1 mm elements."""
        name, by_waves = self.name, "second variation, wave by wave"
        stress, stretch = (
            worst([getattr(ring, f"mean_{what}") for ring in self.rings.values()])
            for what in ("stress", "stretch")
        )
        modes = self.negative_modes or 0
        return [
            Check(f"{name}: contact pressure", self.pressure_error, 1e-6, RADIAL),
            Check(f"{name}: skin radius", self.radius_error, 1e-6, RADIAL),
            Check(f"{name}: mean stress of a tissue", stress, 1e-5, RADIAL),
            Check(f"{name}: mean stretch of a tissue", stretch, 1e-6, RADIAL),
            Check(f"{name}: unstable modes", modes, self.exact_modes, by_waves, rule="exactly"),
        ]


def solve_ring(
    material: BaseSet,
    overclosure: float,
    h: float,
    steps: int = 1,
    fields: bool = True,
    count_modes: bool = False,
) -> list[RingCase]:
    """Solve the section in equal load steps and compare each of them.

    Parameters
    ----------
    material : str
        Material set.
    overclosure, h : float
        Overclosure and element size, mm.
    steps : int
        Load steps.
    fields, count_modes : bool
        Whether stress and stretch are compared, and negative modes counted.
    """
    laws = MaterialSet.paper(material).tissue_laws()
    inner = LIMB[-1].outer - overclosure
    layers = [(ring.name, ring.inner, ring.outer) for ring in LIMB]
    section = ring_mesh(MPI.COMM_SELF, layers, (inner, inner + SOCKET_THICKNESS), h)
    tissues = {ring.name: ring.tissue for ring in LIMB} | {SOCKET: SOCKET}
    problem = limb_problem(section, {name: laws[tissue] for name, tissue in tissues.items()})
    cases: list[RingCase] = []

    def compare(step: LoadStep) -> None:
        if not step.newton.converged:
            return
        problem.set_unknowns(stepper.newton.x)
        exact, contact = exact_ring(laws, overclosure, step.load), problem.contact
        pressure = contact.state().traction.pressure
        mean = skin_mean(contact, pressure)
        radius = skin_mean(contact, np.hypot(*contact.deformed_points().T))
        cases.append(
            RingCase(
                name=f"{material}, {1e3 * overclosure * step.load:.0f} um",
                load=step.load,
                pressure_error=mean / exact.pressure - 1.0,
                radius_error=(radius - exact.skin_radius) / (LIMB[-1].outer - exact.skin_radius),
                pressure_scatter=float(pressure.std()) / mean,
                rings=_ring_errors(problem, tissues, exact) if fields else {},
                exact=exact,
                negative_modes=stepper.newton.negative_modes() if count_modes else None,
            )
        )

    stepper = LoadStepper(problem, [k / steps for k in range(1, steps + 1)], on_step=compare)
    stepper.run()
    return cases


def _ring_errors(
    problem: Problem, tissues: dict[str, str], exact: ExactRing
) -> dict[str, RingErrors]:
    """Compare stress and stretch at the elements' Gauss points."""
    fields = section_fields(problem, tissues)
    assert fields is not None  # one rank
    shapes = _triangle_shapes(fields.gauss_points)
    position = np.einsum("qa,cad->cqd", shapes, fields.points[fields.cells])
    radius = np.linalg.norm(position, axis=2)
    # Points of an axisymmetric solution move along their own radius.
    along = position / radius[:, :, None]
    across = np.stack([-along[:, :, 1], along[:, :, 0]], axis=2)

    def polar(tensor: FloatArray) -> FloatArray:
        """Radial and hoop components of (c, q, 2, 2)."""
        return np.array([np.einsum("cqi,cqij,cqj->cq", n, tensor, n) for n in (along, across)])

    s11, s22, _, s12 = np.moveaxis(fields.stress / KILOPASCAL, 2, 0)
    stress = polar(np.moveaxis(np.array([[s11, s12], [s12, s22]]), (0, 1), (2, 3)))
    stretch = polar(fields.deformation_gradient)
    errors = {}
    for tag, name in fields.region_names.items():
        cells = fields.region == tag
        at = exact.solution.profile(name, radius[cells].ravel())
        scale = np.abs(at.stress[:2]).max()
        stress_error = (stress[:, cells].reshape(2, -1) - at.stress[:2]) / scale
        stretch_error = stretch[:, cells].reshape(2, -1) - at.stretch
        errors[name] = RingErrors(
            stress_error.mean(axis=1),
            stretch_error.mean(axis=1),
            float(np.sqrt(np.mean(stress_error**2))),
            float(np.sqrt(np.mean(stretch_error**2))),
        )
    return errors


def _triangle_shapes(at: FloatArray) -> FloatArray:
    """Shape functions of VTK's six-node triangle at reference coordinates (n, 2); (n, 6)."""
    x, y = at.T
    z = 1.0 - x - y
    return np.stack(
        [z * (2 * z - 1), x * (2 * x - 1), y * (2 * y - 1), 4 * z * x, 4 * x * y, 4 * y * z], axis=1
    )


# -- report ---------------------------------------------------------------------------------------

SIZES = (4.0, 2.0, 1.0)
RADIAL = "radial solution by collocation"


def report() -> Section:
    """Contact pressure, skin radius, stress, stretch and unstable modes, step by step."""
    cases = {
        (material, h): solve_ring(material, OVERCLOSURE, h, steps=STEPS, count_modes=True)
        for material in MATERIALS
        for h in SIZES
    }
    checks = []
    for material in MATERIALS:
        laws = MaterialSet.paper(material).tissue_laws()
        exact = exact_ring(laws, OVERCLOSURE)
        nodes = exact_ring(laws, OVERCLOSURE, nodes=28).pressure / exact.pressure - 1.0
        work, itself = work_error(laws, OVERCLOSURE), "the radial solution itself"
        checks += [
            Check(f"{material}: work - energy", work, 1e-12, "conservation"),
            Check(f"{material}: twice the nodes", nodes, 1e-12, itself),
        ]
        checks += [check for case in cases[material, SIZES[-1]] for check in case.checks()]
    gap, wave = onset(MaterialSet.paper("separate").tissue_laws(), OVERCLOSURE, WAVES)
    last = {key: steps[-1] for key, steps in cases.items()}
    convergence: list[Curve] = [
        (SIZES, [abs(last[material, h].pressure_error) for h in SIZES], style, material)
        for material, style in zip(MATERIALS, ("o-", "s--"), strict=True)
    ]
    text = (
        f"{__doc__}\nHere the Separate set becomes unstable at an overclosure of {gap:.2f} mm, in "
        f"{wave} waves around the limb."
    )
    return Section(
        "The concentric limb",
        text,
        checks,
        [
            curves(
                "ring_convergence",
                "Contact pressure against the exact one.",
                ("element side, mm", "relative error of contact pressure"),
                convergence,
                **LOG,
            ),
            curves(
                "ring_stress",
                "The exact solution at full overclosure.",
                ("radius, mm", "Cauchy stress, kPa"),
                _stress_lines({name: last[name, SIZES[-1]].exact for name in MATERIALS}),
                yscale="symlog",
            ),
            curves(
                "ring_modes",
                "Unstable modes: exact (line), finite elements (points).",
                ("overclosure, mm", "unstable modes, Separate set"),
                _mode_lines(cases["separate", SIZES[-1]]),
            ),
        ],
    )


def _stress_lines(exact: dict[BaseSet, ExactRing]) -> list[Curve]:
    lines: list[Curve] = []
    for (material, ring_state), style in zip(exact.items(), ("-", "--"), strict=True):
        for k, ring in enumerate(LIMB):
            radius = np.linspace(ring.inner, ring.outer, 30)
            at = ring_state.solution.profile(ring.name, radius.astype(float))
            for row, (component, colour) in enumerate((("radial", "C0"), ("hoop", "C3"))):
                label = f"{material}, {component}" if k == 0 else None
                lines.append((at.radius, KILOPASCAL * at.stress[row], style + colour, label))
    return lines


def _mode_lines(found: list[RingCase]) -> list[Curve]:
    laws = MaterialSet.paper("separate").tissue_laws()
    share = np.linspace(0.05, 1.0, 20)
    ends = np.append(share - 0.025, 1.025)
    counts = [
        sum(unstable_waves(exact_ring(laws, OVERCLOSURE, s).solution, WAVES).values())
        for s in share
    ]
    counted = [case.negative_modes or 0 for case in found]
    loads = np.array([case.load for case in found])
    return [
        (OVERCLOSURE * np.repeat(ends, 2)[1:-1], np.repeat(counts, 2), "-", "second variation"),
        (OVERCLOSURE * loads, counted, "ko", "finite elements"),
    ]
