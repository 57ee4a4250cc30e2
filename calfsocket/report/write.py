"""The report of a study: tables, figures and page, from its results alone."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from calfsocket.io.errors import InputError
from calfsocket.plotting.style import save, type_set
from calfsocket.report import answer, method, tables, variants
from calfsocket.report.chapters import Chapter, Content, Drawn, Figure, Guest
from calfsocket.report.damage import DamageThresholds
from calfsocket.report.figures import figures
from calfsocket.report.findings import Findings
from calfsocket.report.page import Page, write_page
from calfsocket.report.table import Table
from calfsocket.simulation.results import Results

FIGURES, TABLES = "figures", "tables"
"""Folders beside the page."""

TITLE = "What a prosthetic socket does inside a leg"


def write_report(
    results: Results,
    guests: Sequence[Callable[[Findings], Guest | None]] = (),
    thresholds: DamageThresholds | None = None,
) -> Path:
    """Write tables/, figures/ and report.html into a study's folder; return the page's path.

    The study may be incomplete. Guests return what they add to its report, or None.

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
    added = [guest for make in guests if (guest := make(findings)) is not None]
    made = _drawn(_joined(_chapters(findings), added), added, results.folder / FIGURES)
    shown = [each for chapter in made for each in chapter.content if isinstance(each, Table)]
    for table in (*shown, *(table for each in added for table in each.tables)):
        table.write(results.folder / TABLES)
    page = Page(
        title=_title(results, added),
        summary=method.summary(findings.results),
        warnings=[*method.warnings(results), *(text for each in added for text in each.warnings)],
        answer=answer.joined(answer.answer(findings), (line for g in added for line in g.lines)),
        notes=[each.note for each in added if each.note],
        chapters=made,
        method=method.tables(results),
    )
    return write_page(page, results.folder)


def _title(results: Results, guests: Sequence[Guest]) -> str:
    content = results.run.study.content if results.run else {}
    titles = [content.get("study", {}).get("title"), *(guest.title for guest in guests)]
    return next(filter(None, titles), TITLE)


def _chapters(findings: Findings) -> list[Chapter]:
    """Return the chapters of any study's report; those without content are left out later."""
    results = findings.results
    drawn = figures(results)

    def content(*parts: Content | None) -> tuple[Content, ...]:
        return tuple(part for part in parts if part is not None)

    return [
        Chapter(
            "model",
            "The model",
            "A transverse section of a leg in plane strain, pressed by a socket that is smaller "
            "than the limb.",
            content(drawn["regions"], drawn["overlays"], tables.laws(results)),
        ),
        Chapter(
            "cases-side-by-side",
            "The cases side by side",
            content=content(tables.sweep(findings.study), tables.maxima(results)),
        ),
        Chapter(
            "stress",
            "Stress",
            "Compression, distortion and shear of the tissues at rest in the socket, without body "
            "weight. The largest value of a tissue is the largest level reached in two "
            "neighbouring elements and five of their nodes, so that no single point decides.",
            content(drawn["effective_stress"]),
        ),
        Chapter(
            "strain",
            "Strain",
            "Shear strain is engineering shear, twice the tensor's component. Stiff fascia in soft "
            "muscle buckles under little compression: waves along it are part of the result, "
            "stable where a run counts no negative modes.",
            content(drawn["shear_strain"]),
        ),
        Chapter("contact", "Contact pressure", content=content(drawn["contact_pressure"])),
        Chapter(
            "damage-risk",
            "Damage thresholds",
            content=content(tables.thresholds(results), tables.damage(findings.damage)),
        ),
        Chapter(
            "choices",
            "What the variants change",
            content=content(*variants.tables(findings.study)),
        ),
    ]


def _joined(chapters: Sequence[Chapter], guests: Sequence[Guest]) -> list[Chapter]:
    """Add guests' chapters to those of the same anchor, or behind the one that they follow."""
    replaced = {name for guest in guests for name in guest.replaces}
    joined = []
    for chapter in chapters:
        kept = (each for each in chapter.content if getattr(each, "name", None) not in replaced)
        joined.append(replace(chapter, content=tuple(kept)))
    for chapter in (chapter for guest in guests for chapter in guest.chapters):
        anchors = [each.anchor for each in joined]
        if chapter.anchor in anchors:
            place = anchors.index(chapter.anchor)
            known = joined[place]
            title = chapter.title or known.title
            intro = f"{known.intro} {chapter.intro}".strip()
            content = (*known.content, *chapter.content)
            joined[place] = replace(known, title=title, intro=intro, content=content)
        else:
            place = anchors.index(chapter.after) + 1 if chapter.after else len(joined)
            joined.insert(place, chapter)
    return [chapter for chapter in joined if chapter.content]


def _drawn(chapters: Sequence[Chapter], guests: Sequence[Guest], folder: Path) -> list[Chapter]:
    """Draw the chapters' figures into files, numbered as guests say, or in the page's order."""
    numbers = {name: number for guest in guests for name, number in guest.numbers.items()}
    captions = {name: text for guest in guests for name, text in guest.captions.items()}
    count = 0
    made = []
    for chapter in chapters:
        content: list[Content] = []
        for each in chapter.content:
            if isinstance(each, Figure):
                number, caption = each.number, each.caption
                if not number:
                    count += 1
                    number = numbers.get(each.name, str(count))
                    caption = f"{caption} {captions.get(each.name, '')}".strip()
                name = f"figure{number}_{each.name}"
                with type_set():
                    files = save(each.draw(), folder, name)
                each = Drawn(name, each.title, caption, number, *files)
            content.append(each)
        made.append(replace(chapter, content=tuple(content)))
    return made
