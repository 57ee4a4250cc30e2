"""The report of a study: tables, figures and page, from its results alone."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from calfsocket.io.errors import InputError
from calfsocket.postprocess.contact_line import RUNNING_MEAN_MM
from calfsocket.postprocess.pressure_map import PLANE_STRAIN
from calfsocket.report import along, inputs, method
from calfsocket.report.answer import MOST_LISTED, MOST_NAMED, Answer
from calfsocket.report.damage import DamageThresholds
from calfsocket.report.figures import figures, maps
from calfsocket.report.findings import Findings
from calfsocket.report.loads import Loads
from calfsocket.report.page import Page
from calfsocket.report.table import Table
from calfsocket.report.tables import tables
from calfsocket.report.templates import PACKAGE
from calfsocket.report.variants import ROBUST
from calfsocket.simulation.results import MAPS, Results


@dataclass(frozen=True)
class Guest:
    """What a guest adds to a report: a template that extends the report's, and what it shows."""

    package: str
    template: str
    tables: Mapping[str, Table] = field(default_factory=dict)
    figures: Mapping[str, Callable[[], Figure] | tuple[Path, Path]] = field(default_factory=dict)
    numbers: Mapping[str, str] = field(default_factory=dict)
    """Of figures, the report's and its own, by their names."""
    warnings: tuple[str, ...] = ()
    values: Mapping[str, Any] = field(default_factory=dict)
    """Of the template."""


ALONE = Guest(PACKAGE, "report.html")
"""A report without a guest."""


def write_report(
    results: Results,
    invite: Callable[[Findings], Guest | None] = lambda _: None,
    thresholds: DamageThresholds | None = None,
) -> Path:
    """Write tables/, figures/ and report.html into a study's folder; return the page's path.

    The study may be incomplete. `invite` returns what a guest adds to its report, or None.

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
    findings = Findings(results, thresholds or DamageThresholds())
    guest = invite(findings) or ALONE
    page = Page(
        results.folder,
        {**figures(findings), **guest.figures},
        {**tables(findings), **guest.tables},
        guest.numbers,
    )
    warnings = [*method.warnings(results), *guest.warnings]
    values = {**values_of(findings), **guest.values, "warnings": warnings}
    return page.write(guest.template, guest.package, **values)


def values_of(findings: Findings) -> dict[str, Any]:
    """Return what the sentences of the report are about."""
    study, results, run = findings.study, findings.results, findings.study.run
    of_socket = {name: [m for s, m in results if s == name] for name in results.sockets}
    return {
        "findings": findings,
        "results": results,
        "limb": findings.limb,
        "liner": findings.liner,
        "levels": findings.levels,
        "maps": along.maps(findings),
        "map_files": results.folder.joinpath(MAPS).is_dir(),
        "one_design": len({record.along[0] for record in results.records.values()}) == 1,
        "several": _several(findings),
        "plane_strain": PLANE_STRAIN,
        "answer": Answer(findings),
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
        "robust_pct": f"{100 * (ROBUST - 1):.0f}",
        "most_named": MOST_NAMED,
        "most_listed": MOST_LISTED,
        "literature": DamageThresholds(),
    }


def _several(findings: Findings) -> str:
    """Say what there are several of where a table or a sentence has one for each socket."""
    if findings.levels is None:
        return "sockets"
    designs = {record.along[0] for record in findings.results.records.values()}
    return "levels" if len(designs) == 1 else "sockets at their levels"


def _axes(findings: Findings) -> str:
    x, y, *_ = findings.frame.words
    return f"+x {x} and +y {y}" if findings.frame.known else "in the section's x and y"
