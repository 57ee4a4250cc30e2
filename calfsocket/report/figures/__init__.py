"""The figures of any study: the section, the sockets, stress, strain, contact pressure."""

from calfsocket.report.chapters import Figure
from calfsocket.report.figures import geometry, maps, pressure
from calfsocket.simulation.results import Results


def figures(results: Results) -> dict[str, Figure]:
    """Return the figures of a study by name, not yet drawn."""
    made = (
        Figure(
            "regions",
            "The section and its regions",
            "Unloaded section of a right leg seen from above, all regions with their tissues. "
            "The marrow cavity of the tibia is fixed.",
            lambda: geometry.regions(results),
        ),
        Figure(
            "overlays",
            "Limb and sockets before contact",
            "Every socket is smaller than the limb. The overlap is released in small steps until "
            "the limb lies inside the socket; nothing else loads it.",
            lambda: geometry.overlays(results),
        ),
        Figure(
            "effective_stress",
            "Effective stress",
            "Mises stress of the soft tissues in the deformed section, on a scale of 0 to 10 kPa. "
            "White marks: where a tissue holds its largest value.",
            lambda: maps.draw_map(results, maps.EFFECTIVE_STRESS),
        ),
        Figure(
            "shear_strain",
            "Logarithmic shear strain",
            "LE12 (engineering shear, +x lateral and +y anterior) of the soft tissues in the "
            "deformed section, within ±50 %, the level of the damage risk volume in muscle.",
            lambda: maps.draw_map(results, maps.SHEAR_STRAIN),
        ),
        Figure(
            "contact_pressure",
            "Contact pressure around the limb",
            "Pressure between skin and socket, drawn outward from the deformed skin on one scale.",
            lambda: pressure.contact_pressure(results),
        ),
    )
    return {figure.name: figure for figure in made}
