"""Friction on the limb: load steps, and the way in which the socket is put on.

A tight socket grips the skin where it touches it. Where the limb would slide along the socket,
friction resists, and how much shear remains in the end depends on when the skin was gripped.
Equilibria of one and the same problem (Signorini's contact with Coulomb's friction) therefore
differ in their shear, and the path is part of the model. Here the same limb is brought into the
same socket by three paths (`release_paths`), and without friction, which bounds them.

- *closed*, as in studies: all gaps are closed in proportion. The skin sticks from the first load
  step, with all of its motion along the socket still to come, and slides where the shear reaches mu
  p.
- *shrunk*: a socket that is too large shrinks to its size. The points that it touches first are
  under little pressure and slide while it finds its place; a point that is touched late has made
  part of its motion before. Then the skin sticks, too.
- *stiffened*: the whole overclosure is present at once, and contact becomes stiff gradually. Hardly
  any point reaches mu p, and yet the shear is the smallest of all: while the tangential springs are
  soft, the skin moves along the socket on them, and it keeps that position as the pressure rises.
  This is creep, not slip: it depends on the ratio e_t/e of tangential to normal springs (0.5 unless
  stated), a number of the method and not of the skin. The stiffer the springs, the closer the shear
  is to that of *closed*.

The shear has the same pattern on all paths that end on one branch; its size differs. Of the tissues
only the skin is affected: its largest stress is halved, the others change by a few per cent. The
mean pressure, which follows from the area loss and the bulk moduli, hardly depends on the path.

In the tightest socket, HS, the stiffened path also ends on another branch. The posterior deep
fascia, which waves in any case, has no equilibrium near the last one when four fifths of the
pressure are reached, and snaps into waves elsewhere; dashpots carry the limb across. Both branches
are stable. Local pressure differs between them by as much as it does at the front with and without
friction.
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from calfsocket.contact.friction import OPEN, SLIP
from calfsocket.contact.nitsche import ContactState
from calfsocket.contact.parameters import Contact
from calfsocket.mechanics.limb_problem import SocketSupport
from calfsocket.mechanics.stepping import LoadStep, LoadStepper, LoadSteps
from calfsocket.postprocess.contact_line import ContactLine, running_mean
from calfsocket.postprocess.extract import KILOPASCAL
from calfsocket.simulation.record import FORCE_TOLERANCE, GAP_TOLERANCE
from calfsocket.verification.limb_runs import End, one_case
from calfsocket.verification.release_paths import path_problem
from calfsocket.verification.report import Check, Figure, Section, Table, curves
from calfsocket.verification.sampling import Slid

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Fitting:
    """A socket put on the limb by one path."""

    end: End  #: the limb at full load
    #: by converged step: load, mean pressure (kPa), shear_ratio, slip_share, open_share
    history: pd.DataFrame
    slid: FloatArray  #: (m,) way that each point of the contact line slid in all, mm

    @property
    def line(self) -> ContactLine:
        """Contact at the end."""
        return self.end.line

    @property
    def mean_pressure(self) -> float:
        """Mean contact pressure, kPa."""
        return self.end.mean_pressure

    @property
    def shear_ratio(self) -> float:
        """Mean |shear| over mean pressure."""
        line = self.line
        pressing = line.weight_mm @ line.pressure_kPa
        return float(line.weight_mm @ np.abs(line.shear_kPa) / pressing)


def fit(
    socket: str,
    path: str,
    largest: float,
    size: str = "coarse",
    contact: Contact | None = None,
    support: SocketSupport = "floating",
) -> Fitting:
    """Put a socket on the limb, in the Separate set.

    Parameters
    ----------
    socket : str
        Its name.
    path : str
        One of `release_paths.PATHS`.
    largest : float
        Largest load step.
    size : str
        Mesh size.
    contact : Contact
        Friction and contact stiffness; the study's unless given.
    support : str
        Whether the socket floats.
    """
    case, section, laws = one_case(socket, "separate", size)
    problem = path_problem(path, section, laws, contact, support)
    skin = problem.contact
    history: list[dict[str, float]] = []
    slid = np.zeros(len(skin.points.weight))
    before = skin.state()

    def watch(step: LoadStep) -> None:
        nonlocal before, slid
        if not step.newton.converged:
            return
        problem.set_unknowns(stepper.newton.x)
        state = skin.state()
        way = np.abs(Slid.between(skin, before, state).slip)
        slid = slid + np.where(state.traction.status == SLIP, way, 0.0)
        before = state
        history.append(_history_row(step.load, state, skin.points.weight))
        if path == "stiffened" and problem.foundation is not None:
            problem.foundation.rest(problem.w.x.array)

    steps = LoadSteps(first=min(0.1, largest), largest=largest)
    stepper = LoadStepper(problem, steps, on_step=watch)
    stepper.run()
    end = End.of(stepper, case.limb)
    order = cKDTree(skin.deformed_points()).query(end.line.points)[1]
    return Fitting(end, pd.DataFrame(history), slid[order])


def _history_row(load: float, state: ContactState, weight: FloatArray) -> dict[str, float]:
    law = state.traction
    pressing, length = float(weight @ law.pressure), float(weight.sum())
    return {
        "load": load,
        "mean_pressure": KILOPASCAL * pressing / length,
        "shear_ratio": float(weight @ np.abs(law.shear)) / pressing if pressing else 0.0,
        "slip_share": float(weight[law.status == SLIP].sum()) / length,
        "open_share": float(weight[law.status == OPEN].sum()) / length,
    }


#: Sockets, in the Separate set.
SOCKETS = ("TSB", "HS")
#: Largest load steps; the last is the one that is shown.
STEPS = {"closed": (0.25, 0.1), "stiffened": (0.05,), "shrunk": (0.05,)}
#: Ratios e_t/e of the springs.
SPRINGS = (0.1, 2.0, 8.0)
TISSUES = (
    ("skin", "effective_stress", "kPa"),
    ("fat", "amp_log_strain", "%"),
    ("muscle", "shear_log_strain", "%"),
    ("fascia", "effective_stress", "kPa"),
)
FREE = Contact(friction=0.0)
NO_FRICTION = "no friction"
SAME = "the same problem"


def report(size: str = "coarse") -> Section:
    """Compare load steps and paths on the limb: minutes.

    Parameters
    ----------
    size : str
        Mesh size.
    """
    checks, figures, rows, findings = [], [], [], []
    for socket in SOCKETS:
        ends = {}
        for path, steps in STEPS.items():
            fits = [fit(socket, path, step, size) for step in steps]
            rows += [_row(socket, path, step, made) for step, made in zip(steps, fits, strict=True)]
            ends[path] = fits[-1]
            if len(fits) > 1:
                change = fits[-2].shear_ratio / fits[-1].shear_ratio - 1.0
                name = f"{socket}, {path}: shear over pressure, step {steps[-2]} for {steps[-1]}"
                checks.append(Check(name, change, 0.01, SAME))
        ends[NO_FRICTION] = fit(socket, "closed", 0.1, size, FREE)
        rows.append(_row(socket, NO_FRICTION, 0.1, ends[NO_FRICTION]))
        checks += _end_checks(socket, ends)
        figures += _figures(socket, ends)
        findings.append(_finding(socket, ends))
    rows.append(_row("TSB", "stiffened", 0.1, fit("TSB", "stiffened", 0.1, size)))
    for ratio in SPRINGS:
        made = fit("TSB", "stiffened", 0.05, size, Contact(gamma_t=ratio * FREE.gamma))
        rows.append(_row("TSB", f"stiffened, e_t/e = {ratio:g}", 0.05, made))
    smooth, exact = (
        fit("TSB", path, 0.1, size, FREE).line.pressure_kPa for path in ("stiffened", "closed")
    )
    difference = float(np.abs(smooth - exact).max() / exact.max())
    name = "TSB without friction, stiffened: largest difference of pressure"
    checks.append(Check(name, difference, 1e-5, SAME))
    text = "\n".join([__doc__ or "", *findings])
    table = Table("Ends of the paths, Separate set.", pd.DataFrame(rows))
    return Section("Friction on the limb", text, checks, figures, [table])


def _end_checks(socket: str, ends: dict[str, Fitting]) -> list[Check]:
    """Check what every path must end in."""
    lines = [made.line for made in ends.values()]
    gap = max(float(np.abs(line.gap_mm[line.status != "open"]).max()) for line in lines)
    imbalance = max(made.end.checks.relative_force_imbalance for made in ends.values())
    modes = sum(made.end.checks.negative_modes for made in ends.values())
    closed = ends["closed"].mean_pressure
    return [
        *(
            Check(f"{socket}, {path}: mean pressure", made.mean_pressure / closed - 1.0, 0.04, SAME)
            for path, made in ends.items()
            if path != "closed"
        ),
        Check(f"{socket}: gap in contact", gap, GAP_TOLERANCE, "Signorini", "mm"),
        Check(f"{socket}: force balance", imbalance, FORCE_TOLERANCE, "tibia's reaction"),
        Check(f"{socket}: negative modes", modes, 0.0, "stable equilibria"),
    ]


def _finding(socket: str, ends: dict[str, Fitting]) -> str:
    """Describe how far each path ends from the study's."""
    closed, others = ends["closed"], []
    for path, made in ends.items():
        if path == "closed":
            continue
        moved = made.end.moved_from(closed.end)
        pressure = np.abs(made.line.pressure_kPa - closed.line.pressure_kPa).max()
        others.append(f"{pressure:.1f} kPa and {moved:.2f} mm ({path})")
    return (
        f"{socket}: from closed gaps, local pressure and displacement of the limb differ by up to "
        f"{', '.join(others)}."
    )


def _row(socket: str, path: str, step: float, made: Fitting) -> dict[str, str]:
    """Row of the table: what the path changes."""
    line = made.line
    return {
        "socket": socket,
        "path": path,
        "step": f"{step:g}",
        "mean pressure, kPa": f"{made.mean_pressure:.2f}",
        "largest, kPa": f"{line.running_mean_kPa.max():.1f}",
        "shear / pressure": f"{made.shear_ratio:.4f}",
        "slips at the end": f"{np.average(line.status == 'slip', weights=line.weight_mm):.3f}",
        "slid, um": f"{1e3 * np.average(made.slid, weights=line.weight_mm):.1f}",
    } | {
        f"{tissue}, {unit}": f"{made.end.value(tissue, quantity):.3g}"
        for tissue, quantity, unit in TISSUES
    }


def _figures(socket: str, made: dict[str, Fitting]) -> list[Figure]:
    """Pressure, shear and slip along the skin, and shear as the pressure rises."""
    rough = {path: end for path, end in made.items() if path != NO_FRICTION}
    pressures = {path: end.line.running_mean_kPa for path, end in made.items()}
    shears = {path: _mean_along(end.line, end.line.shear_kPa) for path, end in rough.items()}
    ways = {path: 1e3 * _mean_along(end.line, end.slid) for path, end in rough.items()}
    name, along = f"limb_friction_{socket}", "along the skin from lateral, by anterior, mm"
    figures = [
        curves(
            f"{name}_{what}",
            f"{socket}: {caption}",
            (along, label),
            [(made[path].line.arc_mm, values, "-", path) for path, values in by_path.items()],
        )
        for what, caption, label, by_path in (
            (
                "pressure",
                "contact pressure by path.",
                "pressure (3 mm mean), kPa",
                pressures,
            ),
            ("shear", "shear traction by path.", "shear traction (3 mm mean), kPa", shears),
            ("slid", "how far the skin slid on the socket.", "way slid (3 mm mean), um", ways),
        )
    ]
    rise = [
        (end.history.mean_pressure, end.history.shear_ratio, ".-", path)
        for path, end in rough.items()
    ]
    labels = "mean contact pressure, kPa", "mean |shear| / mean pressure"
    caption = f"{socket}: shear as the pressure rises."
    return [*figures, curves(f"{name}_rise", caption, labels, rise)]


def _mean_along(line: ContactLine, values: FloatArray) -> FloatArray:
    """Average values over 3 mm of the skin, as contact pressure is."""
    return running_mean(replace(line, pressure_kPa=values))
