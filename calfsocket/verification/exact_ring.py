"""The concentric limb in a smaller socket against its exact solution."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from mpi4py import MPI

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
from calfsocket.verification.sampling import FloatArray, skin_mean, worst

OVERCLOSURE = 0.92
"""mm; 5.3 % of the limb's area, as much as the tightest socket of the study takes off. No quarter
of it is within 5 % of an overclosure at which another wave becomes unstable."""

MATERIALS: tuple[BaseSet, ...] = ("separate", "combined")
STEPS = 4
WAVES = range(41)
RADIAL = "radial solution by collocation"


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
    #: errors of Cauchy stress and stretch at the elements' Gauss points by ring, see `ring_errors`;
    #: None where not asked for
    rings: pd.DataFrame | None
    exact: ExactRing  #: what it is compared with
    negative_modes: int | None  #: of the equilibrium; None where not counted

    def checks(self) -> list[Check]:
        """Check everything, at 1 mm elements."""
        assert self.rings is not None
        stress, stretch = self.rings[["mean_stress", "mean_stretch"]].max()
        errors = {
            "contact pressure": (self.pressure_error, 1e-6),
            "skin radius": (self.radius_error, 1e-6),
            "mean stress of a tissue": (stress, 1e-5),
            "mean stretch of a tissue": (stretch, 1e-6),
        }
        exact, source = unstable_modes(self.exact), "second variation, wave by wave"
        modes = self.negative_modes or 0
        return [
            *(Check(f"{self.name}: {of}", *error, RADIAL) for of, error in errors.items()),
            Check(f"{self.name}: unstable modes", modes, exact, source, rule="exactly"),
        ]


def unstable_modes(exact: ExactRing) -> int:
    """Count the unstable modes of the exact solution."""
    return sum(unstable_waves(exact.solution, WAVES).values())


def solve_ring(
    material: BaseSet,
    overclosure: float,
    h: float,
    steps: int = 1,
    fields: bool = True,
    count_modes: bool = False,
) -> list[RingCase]:
    """Solve the section in equal load steps and compare each of them.

    Overclosure and element size h are in mm; stress and stretch are compared if `fields`.
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
                rings=ring_errors(problem, tissues, exact) if fields else None,
                exact=exact,
                negative_modes=stepper.newton.negative_modes() if count_modes else None,
            )
        )

    stepper = LoadStepper(problem, [k / steps for k in range(1, steps + 1)], on_step=compare)
    stepper.run()
    return cases


def ring_errors(problem: Problem, tissues: dict[str, str], exact: ExactRing) -> pd.DataFrame:
    """Compare stress and stretch with the exact ones at the elements' Gauss points, ring by ring.

    A row a ring, the socket among them: the larger difference of the mean, radial or hoop, and the
    root mean square of the difference of both components at all points; stresses over the ring's
    largest exact one.
    """
    fields = section_fields(problem, tissues)
    assert fields is not None  # one rank
    position = np.einsum(
        "qa,cad->cqd", _triangle_shapes(fields.gauss_points), fields.points[fields.cells]
    )
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
    rows = {}
    for tag, name in fields.region_names.items():
        cells = fields.region == tag
        at = exact.solution.profile(name, radius[cells].ravel())
        scale = np.abs(at.stress[:2]).max()
        errors = {
            "stress": (stress[:, cells].reshape(2, -1) - at.stress[:2]) / scale,
            "stretch": stretch[:, cells].reshape(2, -1) - at.stretch,
        }
        rows[name] = {f"mean_{of}": worst(error.mean(axis=1)) for of, error in errors.items()} | {
            f"rms_{of}": np.sqrt(np.mean(error**2)) for of, error in errors.items()
        }
    return pd.DataFrame.from_dict(rows, orient="index")


def _triangle_shapes(at: FloatArray) -> FloatArray:
    """Shape functions of VTK's six-node triangle at reference coordinates (n, 2); (n, 6)."""
    x, y = at.T
    z = 1.0 - x - y
    return np.stack(
        [z * (2 * z - 1), x * (2 * x - 1), y * (2 * y - 1), 4 * z * x, 4 * x * y, 4 * y * z], axis=1
    )


# -- report ---------------------------------------------------------------------------------------

SIZES = (4.0, 2.0, 1.0)


def report() -> Section:
    """Contact pressure, skin radius, stress, stretch and unstable modes, step by step."""
    checks: list[Check] = []
    convergence: list[Curve] = []
    finest = {}
    for material, style in zip(MATERIALS, ("o-", "s--"), strict=True):
        laws = MaterialSet.paper(material).tissue_laws()
        exact = exact_ring(laws, OVERCLOSURE)
        nodes = exact_ring(laws, OVERCLOSURE, nodes=28).pressure / exact.pressure - 1.0
        by_size = [solve_ring(material, OVERCLOSURE, h, STEPS, count_modes=True) for h in SIZES]
        errors = [abs(cases[-1].pressure_error) for cases in by_size]
        convergence.append((SIZES, errors, style, material))
        finest[material] = by_size[-1]
        work = work_error(laws, OVERCLOSURE)
        checks += [
            Check(f"{material}: work - energy", work, 1e-12, "conservation"),
            Check(f"{material}: twice the nodes", nodes, 1e-12, "the radial solution itself"),
            *(check for case in finest[material] for check in case.checks()),
        ]
    gap, wave = onset(MaterialSet.paper("separate").tissue_laws(), OVERCLOSURE, WAVES)
    return Section(
        checks,
        {
            "ring_convergence": curves(
                ("element side, mm", "relative error of contact pressure"), convergence, **LOG
            ),
            "ring_stress": curves(
                ("radius, mm", "Cauchy stress, kPa"),
                _stress_lines({name: cases[-1].exact for name, cases in finest.items()}),
                yscale="symlog",
            ),
            "ring_modes": curves(
                ("overclosure, mm", "unstable modes, Separate set"), _mode_lines(finest["separate"])
            ),
        },
        values={"onset": gap, "wave": wave},
    )


def _stress_lines(exact: dict[BaseSet, ExactRing]) -> list[Curve]:
    lines: list[Curve] = []
    for (material, ring_state), style in zip(exact.items(), ("-", "--"), strict=True):
        for k, ring in enumerate(LIMB):
            radius = np.linspace(ring.inner, ring.outer, 30)
            at = ring_state.solution.profile(ring.name, radius)
            for row, (component, colour) in enumerate((("radial", "C0"), ("hoop", "C3"))):
                label = f"{material}, {component}" if k == 0 else None
                lines.append((at.radius, KILOPASCAL * at.stress[row], style + colour, label))
    return lines


def _mode_lines(found: list[RingCase]) -> list[Curve]:
    laws = MaterialSet.paper("separate").tissue_laws()
    share = np.linspace(0.05, 1.0, 20)
    ends = np.append(share - 0.025, 1.025)
    counts = [unstable_modes(exact_ring(laws, OVERCLOSURE, s)) for s in share]
    loads = np.array([case.load for case in found])
    counted = [case.negative_modes or 0 for case in found]
    return [
        (OVERCLOSURE * np.repeat(ends, 2)[1:-1], np.repeat(counts, 2), "-", "second variation"),
        (OVERCLOSURE * loads, counted, "ko", "finite elements"),
    ]
