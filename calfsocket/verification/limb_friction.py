"""Friction on the limb: load steps, and the way in which the socket is put on."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from calfsocket.contact.friction import SLIP
from calfsocket.contact.nitsche import ContactState
from calfsocket.contact.parameters import Contact
from calfsocket.contact.resultants import Slid
from calfsocket.mechanics.stepping import LoadStep, LoadStepper, LoadSteps
from calfsocket.postprocess.contact_line import ContactLine, running_mean
from calfsocket.postprocess.extract import KILOPASCAL
from calfsocket.simulation.record import FORCE_TOLERANCE, GAP_TOLERANCE
from calfsocket.simulation.result import Result
from calfsocket.verification.limb_runs import largest_distance, mean_pressure, one_case, value
from calfsocket.verification.release_paths import path_problem
from calfsocket.verification.report import Check, Draw, Section, check_each, curves
from calfsocket.verification.sampling import FloatArray


@dataclass(frozen=True)
class Fitting:
    """A socket put on the limb by one path."""

    end: Result  #: the limb at full load
    #: by converged step: mean_pressure (kPa), shear_ratio, slip_share
    history: pd.DataFrame
    slid: FloatArray  #: (m,) way that each point of the contact line slid in all, mm

    @property
    def line(self) -> ContactLine:
        """Contact at the end."""
        return self.end.line

    @property
    def mean_pressure(self) -> float:
        """Mean contact pressure, kPa."""
        return mean_pressure(self.end)

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
) -> Fitting:
    """Put a socket on the limb, in the Separate set, by one of `release_paths.PATHS`.

    Load steps are at most `largest`; contact is the study's unless given.
    """
    case, section, laws = one_case(socket, "separate", size)
    problem = path_problem(path, section, laws, contact)
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
        history.append(_history_row(state, skin.points.weight))
        if path == "stiffened" and problem.foundation is not None:
            problem.foundation.rest(problem.w.x.array)

    steps = LoadSteps(first=min(0.1, largest), largest=largest)
    stepper = LoadStepper(problem, steps, on_step=watch)
    stepper.run()
    end = case.result(stepper)
    order = cKDTree(skin.deformed_points()).query(end.line.points)[1]
    return Fitting(end, pd.DataFrame(history), slid[order])


def _history_row(state: ContactState, weight: FloatArray) -> dict[str, float]:
    law = state.traction
    pressing, length = float(weight @ law.pressure), float(weight.sum())
    return {
        "mean_pressure": KILOPASCAL * pressing / length,
        "shear_ratio": float(weight @ np.abs(law.shear)) / pressing if pressing else 0.0,
        "slip_share": float(weight[law.status == SLIP].sum()) / length,
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
    """Compare load steps and paths on the limb, at a mesh size: minutes."""
    checks, figures, rows = list[Check](), dict[str, Draw](), list[dict[str, str]]()
    differences = {}
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
        figures |= _figures(socket, ends)
        differences[socket] = _differences(ends)
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
    return Section(checks, figures, {"ends": pd.DataFrame(rows)}, values={"sockets": differences})


def _end_checks(socket: str, ends: dict[str, Fitting]) -> list[Check]:
    """Check what every path must end in."""
    lines = [made.line for made in ends.values()]
    found = [made.end.checks for made in ends.values()]
    gap = max(float(np.abs(line.gap_mm[line.status != "open"]).max()) for line in lines)
    imbalance = max(each.relative_force_imbalance for each in found)
    modes = sum(each.negative_modes for each in found)
    pressures = {
        f"{socket}, {path}: mean pressure": made.mean_pressure / ends["closed"].mean_pressure - 1.0
        for path, made in ends.items()
        if path != "closed"
    }
    return [
        *check_each(pressures, 0.04, SAME),
        Check(f"{socket}: gap in contact", gap, GAP_TOLERANCE, "Signorini", "mm"),
        Check(f"{socket}: force balance", imbalance, FORCE_TOLERANCE, "tibia's reaction"),
        Check(f"{socket}: negative modes", modes, 0.0, "stable equilibria"),
    ]


def _differences(ends: dict[str, Fitting]) -> dict[str, tuple[float, float]]:
    """Largest difference of each end from the study's: local pressure, kPa, and place, mm."""
    closed = ends["closed"]
    return {
        path: (
            float(np.abs(made.line.pressure_kPa - closed.line.pressure_kPa).max()),
            largest_distance(made.end, closed.end),
        )
        for path, made in ends.items()
        if path != "closed"
    }


def _row(socket: str, path: str, step: float, made: Fitting) -> dict[str, str]:
    """Row of the table: what the path changes."""
    line = made.line
    slips, slid = (
        np.average(each, weights=line.weight_mm) for each in (line.status == "slip", made.slid)
    )
    return {
        "socket": socket,
        "path": path,
        "step": f"{step:g}",
        "mean pressure, kPa": f"{made.mean_pressure:.2f}",
        "largest, kPa": f"{line.running_mean_kPa.max():.1f}",
        "shear / pressure": f"{made.shear_ratio:.4f}",
        "slips at the end": f"{slips:.3f}",
        "slid, um": f"{1e3 * slid:.1f}",
    } | {
        f"{tissue}, {unit}": f"{value(made.end, tissue, quantity):.3g}"
        for tissue, quantity, unit in TISSUES
    }


ALONG = "along the skin from lateral, by anterior, mm"


def _figures(socket: str, made: dict[str, Fitting]) -> dict[str, Draw]:
    """Pressure, shear and slip along the skin, and shear as the pressure rises."""
    rough = {path: end for path, end in made.items() if path != NO_FRICTION}
    shown = {
        "pressure": (
            "pressure (3 mm mean), kPa",
            {path: end.line.running_mean_kPa for path, end in made.items()},
        ),
        "shear": (
            "shear traction (3 mm mean), kPa",
            {path: _mean_along(end.line, end.line.shear_kPa) for path, end in rough.items()},
        ),
        "slid": (
            "way slid (3 mm mean), um",
            {path: 1e3 * _mean_along(end.line, end.slid) for path, end in rough.items()},
        ),
    }
    figures = {
        f"limb_friction_{socket}_{what}": curves(
            (ALONG, label),
            [(made[path].line.arc_mm, values, "-", path) for path, values in by_path.items()],
        )
        for what, (label, by_path) in shown.items()
    }
    rise = curves(
        ("mean contact pressure, kPa", "mean |shear| / mean pressure"),
        [
            (end.history.mean_pressure, end.history.shear_ratio, ".-", path)
            for path, end in rough.items()
        ],
    )
    return figures | {f"limb_friction_{socket}_rise": rise}


def _mean_along(line: ContactLine, values: FloatArray) -> FloatArray:
    """Average values over 3 mm of the skin, as contact pressure is."""
    return running_mean(replace(line, pressure_kPa=values))
