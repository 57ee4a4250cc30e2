"""Figures of the report, numbered as in the paper: drawn from results alone, as PNG and PDF."""

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from calfsocket.report.drawn import Drawn, Heading
from calfsocket.report.figures import changes, geometry, maps, pressure
from calfsocket.report.figures.style import save, type_set
from calfsocket.report.results import Results

FOLDER = "figures"


@dataclass(frozen=True)
class Plan(Heading):
    """A figure that a study may have; its files are called by its name.

    Attributes
    ----------
    draw
        Draws it.
    compares
        Whether it needs a socket of the paper that is solved with both material sets.
    """

    draw: Callable[[Results], Figure]
    compares: bool = False


EQUATION_3 = (
    "(Combined \N{MINUS SIGN} Separate) / |Separate| of signed values, equation (3) of the paper"
)
SITES = (
    "Sites of maxima: S where Separate has it, C where Combined "
    "has it; both sets are compared there."
)

PLANS = (
    Plan(
        "1",
        "figure1_regions",
        "The section and its regions",
        "Unloaded section of a right calf seen from above, all regions with their tissues. "
        "The marrow cavity of the tibia is fixed.",
        geometry.regions,
    ),
    Plan(
        "2",
        "figure2_overlays",
        "Limb and sockets before contact",
        "Every socket is smaller than the limb. The overlap is released in small steps until the "
        "limb lies inside the socket; nothing else loads it.",
        geometry.overlays,
    ),
    Plan(
        "4",
        "figure4_effective_stress",
        "Effective stress",
        "Mises stress of the soft tissues in the deformed section, on the paper's scale of 0 to "
        "10 kPa. White marks: where a tissue holds its largest value.",
        lambda results: maps.draw_map(results, maps.EFFECTIVE_STRESS),
    ),
    Plan(
        "5",
        "figure5_changes_of_maxima",
        "Relative change of the maxima",
        f"{EQUATION_3}; each set's own maximum, wherever it lies. A positive change of a negative "
        "value is a smaller magnitude: the next figure shows magnitudes.",
        changes.of_maxima,
        compares=True,
    ),
    Plan(
        "5b",
        "figure5b_changes_of_magnitude",
        "Change of the maxima's magnitude",
        "(|Combined| \N{MINUS SIGN} |Separate|) / |Separate|, not equation (3): above 0 the "
        "Combined set has the larger stress or strain, whatever its sign. The paper's numbers "
        "follow from its Tables 2 and 4.",
        changes.of_magnitudes,
        compares=True,
    ),
    Plan(
        "6",
        "figure6_stress_at_sites",
        "Relative change of stresses at the sites of maxima",
        f"{EQUATION_3}. {SITES} Upper row: full range, logarithmic beyond 100 %. "
        "Changes of thousands of percent have a reference near 0.",
        changes.of_stress_at_sites,
        compares=True,
    ),
    Plan(
        "7",
        "figure7_shear_strain",
        "Logarithmic shear strain",
        "LE12 (engineering shear, +x lateral and +y anterior) of the soft tissues in the deformed "
        "section, within the paper's ±50 %, the level of the damage risk volume in muscle.",
        lambda results: maps.draw_map(results, maps.SHEAR_STRAIN),
    ),
    Plan(
        "8",
        "figure8_strain_at_sites",
        "Relative change of strains at the sites of maxima",
        f"{EQUATION_3}. {SITES} Upper row: full range, logarithmic beyond 100 %.",
        changes.of_strain_at_sites,
        compares=True,
    ),
    Plan(
        "9",
        "figure9_contact_pressure",
        "Contact pressure around the limb",
        "Pressure between skin and socket, drawn outward from the deformed skin on one scale.",
        pressure.contact_pressure,
    ),
)
"""In the paper's order. Figure 3 is drawn by the calibration, which a report only shows."""


def draw_figures(results: Results) -> list[Drawn]:
    """Draw every figure that the solved cases allow into the results' folder of figures."""
    folder = results.folder / FOLDER
    paper = results.of_paper
    both = paper and any(paper.complete(socket) for socket in paper.sockets)
    drawn = []
    for plan in PLANS:
        if plan.compares and not both:
            continue
        with type_set():
            figure = plan.draw(paper if plan.compares and paper else results)
            png, pdf = save(figure, folder, plan.name)
        drawn.append(Drawn(plan, png, pdf))
    return drawn
