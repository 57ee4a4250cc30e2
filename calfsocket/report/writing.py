"""The whole report of a study: tables, scoreboard, figures and page, from its files alone."""

import logging
from pathlib import Path

from calfsocket.io.errors import InputError
from calfsocket.report import calibration, scoreboard, tables, variants
from calfsocket.report.answer import answer
from calfsocket.report.damage import Thresholds
from calfsocket.report.figures import draw_figures
from calfsocket.report.page import write_page
from calfsocket.report.results import RUN_FILE, VARIANTS_FOLDER, read_results

log = logging.getLogger(__name__)


def write_report(folder: Path, thresholds: Thresholds | None = None) -> Path:
    """Write tables/, figures/ and report.html into a folder of results; return the page's path.

    Parameters
    ----------
    folder : Path
        Of a study, complete or not, or of a study with variants: then the base's page is written,
        which compares them.
    thresholds : Thresholds, optional
        Damage thresholds, the paper's by default.

    Raises
    ------
    InputError
        When the folder holds no results that can be read.
    """
    folder = Path(folder)
    base = folder / VARIANTS_FOLDER / variants.BASE
    if not (folder / RUN_FILE).exists() and base.is_dir():
        folder = base
    results = read_results(folder)
    made = tables.build(results, thresholds)
    figures = draw_figures(results)
    why_no_calibration = None
    try:
        found = results.calibration
        made.append(calibration.table(found, results.run["laws"]["separate"]))
        figures.append(found.figure)
    except InputError as error:
        why_no_calibration = error
        if not isinstance(error, calibration.NoCalibration):
            log.warning("the calibration is left out: %s", error)
    if folder.resolve().match(f"{VARIANTS_FOLDER}/{variants.BASE}"):
        made += variants.build(variants.read_variants(folder.resolve().parents[1]), thresholds)
    board = scoreboard.scoreboard(results, thresholds)
    tables.write(results, [*made, scoreboard.table(board)] if len(board) else made)
    return write_page(
        results, answer(results, board, thresholds), figures, made, board, why_no_calibration
    )
