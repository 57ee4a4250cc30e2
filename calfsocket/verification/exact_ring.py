"""The concentric limb in a smaller socket against its exact solution."""

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
    RadialSolution,
    exact_ring,
    work_error,
)
from calfsocket.verification.report import LOG, Check, Curve, Section, curves
from calfsocket.verification.ring_stability import onset, unstable_waves
from calfsocket.verification.sampling import FloatArray, skin_mean, triangle_shapes, worst

OVERCLOSURE = 0.92
"""mm; 5.3 % of the limb's area, as much as the tightest socket of the study takes off. No quarter
of it is within 5 % of an overclosure at which another wave becomes unstable."""

MATERIALS: tuple[BaseSet, ...] = ("separate", "combined")
STEPS = 4
WAVES = range(41)
RADIAL = "radial solution by collocation"


RADIAL_BARS = {
    "contact pressure": ("pressure", 1e-6),
    "skin radius": ("radius", 1e-6),
    "mean stress of a tissue": ("mean_stress", 1e-5),
    "mean stretch of a tissue": ("mean_stretch", 1e-6),
}
"""What is checked of a load step: its column and its bar, at 1 mm elements."""


def step_checks(steps: pd.DataFrame) -> list[Check]:
    """Check every load step of `solve_ring`."""
    checks, by_waves = [], "second variation, wave by wave"
    for name, step in steps.iterrows():
        checks += [
            Check(f"{name}: {what}", step[column], bar, RADIAL)
            for what, (column, bar) in RADIAL_BARS.items()
        ]
        label = f"{name}: unstable modes"
        checks.append(Check(label, step.modes, step.exact_modes, by_waves, rule="exactly"))
    return checks


def unstable_modes(exact: ExactRing) -> int:
    """Count the unstable modes of the exact solution."""
    return sum(unstable_waves(exact.solution, WAVES).values())


def solve_ring(
    material: BaseSet, overclosure: float, h: float, steps: int = 1, whole: bool = True
) -> pd.DataFrame:
    """Solve the section in equal load steps and compare each of them; overclosure and h in mm.

    A row a load step, named by material and released overclosure: its load; relative errors of the
    mean contact pressure per undeformed area and of the skin's mean radius over its displacement;
    scatter, the standard deviation of the pressure over its mean. If `whole`, also the largest
    `ring_errors`, the rings, and negative modes beside those of the exact solution.
    """
    laws = MaterialSet.paper(material).tissue_laws()
    inner = LIMB[-1].outer - overclosure
    layers = [(ring.name, ring.inner, ring.outer) for ring in LIMB]
    section = ring_mesh(MPI.COMM_SELF, layers, (inner, inner + SOCKET_THICKNESS), h)
    tissues = {ring.name: ring.tissue for ring in LIMB} | {SOCKET: SOCKET}
    problem = limb_problem(section, {name: laws[tissue] for name, tissue in tissues.items()})
    rows: dict[str, dict[str, float]] = {}

    def compare(step: LoadStep) -> None:
        if not step.newton.converged:
            return
        problem.set_unknowns(stepper.newton.x)
        exact, contact = exact_ring(laws, overclosure, step.load), problem.contact
        pressure = contact.state().traction.pressure
        mean = skin_mean(contact, pressure)
        radius = skin_mean(contact, np.hypot(*contact.deformed_points().T))
        row = {
            "load": step.load,
            "pressure": mean / exact.pressure - 1.0,
            "radius": (radius - exact.skin_radius) / (LIMB[-1].outer - exact.skin_radius),
            "scatter": float(pressure.std()) / mean,
        }
        if whole:
            modes, exact_modes = stepper.newton.negative_modes(), unstable_modes(exact)
            rings = ring_errors(problem, tissues, exact)
            row |= {**rings.max(), "modes": modes, "exact_modes": exact_modes, "rings": len(rings)}
        rows[f"{material}, {1e3 * overclosure * step.load:.0f} um"] = row

    stepper = LoadStepper(problem, [k / steps for k in range(1, steps + 1)], on_step=compare)
    stepper.run()
    return pd.DataFrame.from_dict(rows, orient="index")


def ring_errors(problem: Problem, tissues: dict[str, str], exact: ExactRing) -> pd.DataFrame:
    """Compare stress and stretch with the exact ones at the elements' Gauss points, ring by ring.

    A row a ring, the socket among them: the larger difference of the mean, radial or hoop, and the
    root mean square of the difference of both components at all points; stresses over the ring's
    largest exact one.
    """
    fields = section_fields(problem, tissues)
    assert fields is not None  # one rank
    position = np.einsum(
        "qa,cad->cqd", triangle_shapes(fields.gauss_points), fields.points[fields.cells]
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
    rows: dict[str, dict[str, float]] = {}
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


SIZES = (4.0, 2.0, 1.0)


def report() -> Section:
    """Contact pressure, skin radius, stress, stretch and unstable modes, step by step."""
    checks: list[Check] = []
    convergence: list[Curve] = []
    solutions, finest = {}, {}
    for material, style in zip(MATERIALS, ("o-", "s--"), strict=True):
        laws = MaterialSet.paper(material).tissue_laws()
        exact = exact_ring(laws, OVERCLOSURE)
        nodes = exact_ring(laws, OVERCLOSURE, nodes=28).pressure / exact.pressure - 1.0
        by_size = [solve_ring(material, OVERCLOSURE, h, STEPS) for h in SIZES]
        errors = [abs(steps.pressure.iloc[-1]) for steps in by_size]
        convergence.append((SIZES, errors, style, material))
        solutions[material], finest[material] = exact.solution, by_size[-1]
        work = work_error(laws, OVERCLOSURE)
        checks += [
            Check(f"{material}: work - energy", work, 1e-12, "conservation"),
            Check(f"{material}: twice the nodes", nodes, 1e-12, "the radial solution itself"),
            *step_checks(finest[material]),
        ]
    gap, wave = onset(MaterialSet.paper("separate").tissue_laws(), OVERCLOSURE, WAVES)
    return Section(
        checks,
        {
            "ring_convergence": curves(
                ("element side, mm", "relative error of contact pressure"), convergence, **LOG
            ),
            "ring_stress": curves(
                ("radius, mm", "Cauchy stress, kPa"), _stress_lines(solutions), yscale="symlog"
            ),
            "ring_modes": curves(
                ("overclosure, mm", "unstable modes, Separate set"), _mode_lines(finest["separate"])
            ),
        },
        values={"onset": gap, "wave": wave},
    )


def _stress_lines(solutions: dict[BaseSet, RadialSolution]) -> list[Curve]:
    lines: list[Curve] = []
    for (material, solution), style in zip(solutions.items(), ("-", "--"), strict=True):
        for k, ring in enumerate(LIMB):
            at = solution.profile(ring.name, np.linspace(ring.inner, ring.outer, 30))
            for row, (component, colour) in enumerate((("radial", "C0"), ("hoop", "C3"))):
                label = f"{material}, {component}" if k == 0 else None
                lines.append((at.radius, KILOPASCAL * at.stress[row], style + colour, label))
    return lines


def _mode_lines(found: pd.DataFrame) -> list[Curve]:
    laws = MaterialSet.paper("separate").tissue_laws()
    share = np.linspace(0.05, 1.0, 20)
    ends = np.append(share - 0.025, 1.025)
    counts = [unstable_modes(exact_ring(laws, OVERCLOSURE, s)) for s in share]
    return [
        (OVERCLOSURE * np.repeat(ends, 2)[1:-1], np.repeat(counts, 2), "-", "second variation"),
        (OVERCLOSURE * found.load, found.modes, "ko", "finite elements"),
    ]
