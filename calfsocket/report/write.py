"""The report of a study: tables, figures and page, from its results alone."""

import gc
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from mpi4py import MPI

from calfsocket.io.errors import InputError
from calfsocket.parallel.first_rank import on_first_rank
from calfsocket.parallel.tasks import side_by_side
from calfsocket.plotting.files import Drawing
from calfsocket.plotting.style import type_set
from calfsocket.postprocess.contact_line import RUNNING_MEAN_MM
from calfsocket.postprocess.levels import SHARES
from calfsocket.postprocess.mesh_error import SETTLED
from calfsocket.postprocess.pressure_map import PLANE_STRAIN
from calfsocket.report import along, inputs, method
from calfsocket.report.answer import BEYOND, MOST_LISTED, MOST_NAMED, Answer
from calfsocket.report.damage import DamageThresholds
from calfsocket.report.figures import figures, maps
from calfsocket.report.findings import Findings
from calfsocket.report.loads import Loads
from calfsocket.report.page import Page
from calfsocket.report.table import Table
from calfsocket.report.tables import tables
from calfsocket.report.templates import PACKAGE
from calfsocket.report.variants import MOVES, ROBUST
from calfsocket.simulation.results import MAPS, Results

Draw = Callable[[], Figure]

PLUS_MINUS = f"±: mesh error; *: not settled within {100 * SETTLED:g}\N{NO-BREAK SPACE}%."
"""What a table says of its mesh errors."""


class Guest:
    """What a guest adds to a report: a template that extends the report's, and what it shows.

    This one adds nothing. What is drawn is asked for on every rank, all else on the first alone.
    """

    package, template = PACKAGE, "report.html"
    numbers: Mapping[str, str] = {}
    """Of figures, the report's and its own, by their names."""

    @property
    def figures(self) -> Mapping[str, Draw]:
        """Figures to draw."""
        return {}

    @property
    def made(self) -> Mapping[str, tuple[Path, Path]]:
        """Figures that are files already, PNG and PDF."""
        return {}

    @property
    def tables(self) -> Mapping[str, Table]:
        """Tables by their names."""
        return {}

    @property
    def warnings(self) -> Sequence[str]:
        """What a reader must know first."""
        return ()

    @property
    def values(self) -> Mapping[str, Any]:
        """Of the template."""
        return {}


def write_report(
    results: Results,
    invite: Callable[[Findings], Guest | None] = lambda _: None,
    thresholds: DamageThresholds | None = None,
    comm: MPI.Intracomm = MPI.COMM_SELF,
) -> Path:
    """Write tables/, figures/ and report.html into a study's folder; return the page's path.

    The study may be incomplete. `invite` returns what a guest adds to its report, or None. All
    ranks of `comm` draw (collective).

    Raises
    ------
    InputError
        When results cannot be read, or no case reached its full load.
    WriteError
        When the report cannot be written.
    """
    if not results:
        why = "; ".join(f"{name}: {text}" for name, text in results.left_out.items())
        raise InputError(
            f"{results.folder}: no case reached its full load ({why}); solve the study first"
        )
    results.write_uncertainty(comm)  # where an interrupted run has not
    findings = Findings(results, thresholds or DamageThresholds())
    guest = invite(findings) or Guest()
    gc.freeze()  # what is there is no garbage: to look at it again and again takes a sixth longer
    try:
        drawn = _draw({**figures(findings), **guest.figures}, comm, lambda: _ahead(guest))
        return on_first_rank(comm, lambda: _write(findings, guest, drawn))
    finally:
        gc.unfreeze()


def _ahead(guest: Guest) -> tuple[object, ...]:
    """Compute what the page shows of a guest, which keeps it."""
    return guest.tables, guest.values


def _draw(
    figures: Mapping[str, Draw], comm: MPI.Intracomm, first: Callable[[], object]
) -> dict[str, Drawing]:
    """Draw figures on all ranks; return them by their names on the first, which has other work."""

    def drawn(names: Sequence[str]) -> dict[str, Drawing]:
        with type_set():
            return {name: Drawing.of(figures[name]()) for name in names}

    alone = [[name] for name in figures if name not in maps.MAPS]
    groups = [[name for name in maps.MAPS if name in figures], *alone]
    parts = side_by_side(comm, [partial(drawn, names) for names in groups], first)
    return {name: drawing for part in parts for name, drawing in part.items()}


def _write(findings: Findings, guest: Guest, drawn: Mapping[str, Drawing]) -> Path:
    """Write the page with its tables and figures."""
    page = Page(
        findings.study.folder,
        {**drawn, **guest.made},
        {**tables(findings), **guest.tables},
        guest.numbers,
    )
    uncertain = findings.uncertainty
    of_design = uncertain.warnings if uncertain else []
    warnings = [*method.warnings(findings.judged), *of_design, *guest.warnings]
    values = {**values_of(findings), **guest.values, "warnings": warnings}
    return page.write(guest.template, guest.package, **values)


def values_of(findings: Findings) -> dict[str, Any]:
    """Return what the sentences of the report are about."""
    study, results, run = findings.study, findings.results, findings.study.run
    mesh_errors = method.second_meshes(results)
    of_socket = {name: [m for s, m in results if s == name] for name in results.sockets}
    return {
        "findings": findings,
        "results": results,
        "limb": findings.limb,
        "liner": findings.liner,
        "levels": findings.levels,
        "uncertain": findings.uncertainty,
        "maps": along.maps(findings),
        "map_files": results.folder.joinpath(MAPS).is_dir(),
        "one_design": len({record.along[0] for record in results.records.values()}) == 1,
        "several": _several(findings),
        "plane_strain": PLANE_STRAIN,
        "answer": Answer(findings),
        "mesh_errors": mesh_errors,
        "plus_minus": PLUS_MINUS if mesh_errors else "",
        "finer_second": method.finer_second(results),
        "settled_pct": f"{100 * SETTLED:g}",
        "nearly_all": f"{SHARES[-1]:g}",
        "beyond": f"{BEYOND:g}",
        "shares": [f"{share:g}" for share in SHARES[:-1]],
        "one_case": len(results) == 1,
        "one_socket": len(results.sockets) == 1,
        "several_sets": len(results.material_sets) > 1,
        "sets_of": of_socket,
        "study_title": run.study.content.get("study", {}).get("title") if run else None,
        "settings": method.in_words(findings, method.FIRST),
        "axes": _axes(findings),
        "friction": any(inputs.friction(study)),
        "donning": " or ".join(inputs.donning(study)),
        "wide": inputs.wide(study),
        "carried": inputs.carried(study),
        "loading": Loads(results),
        "options": [f"{key} {value}" for key, value in run.petsc_options.items()] if run else [],
        "stress": maps.EFFECTIVE_STRESS,
        "strain": maps.SHEAR_STRAIN,
        "running_mean": f"{RUNNING_MEAN_MM:g}",
        "moves": MOVES,
        "robust_pct": f"{100 * (ROBUST - 1):.0f}",
        "most_named": MOST_NAMED,
        "most_listed": MOST_LISTED,
        "literature": DamageThresholds(),
    }


def _several(findings: Findings) -> str:
    """Say what there are several of where a table or a sentence has one for each socket."""
    records = findings.results.records.values()
    if findings.levels is None:
        swept = any(record.socket != record.of[0] for record in records)
        return "sockets at their points of the sweep" if swept else "sockets"
    designs = {record.along[0] for record in records}
    return "levels" if len(designs) == 1 else "sockets at their levels"


def _axes(findings: Findings) -> str:
    x, y, *_ = findings.frame.words
    return f"+x {x} and +y {y}" if findings.frame.known else "in the section's x and y"
