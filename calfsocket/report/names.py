"""Names that people read, for what the files call otherwise."""

from calfsocket.postprocess.levels import NEARLY_ALL
from calfsocket.postprocess.quantities import REPORTED

TISSUES = {name: name for name in REPORTED} | {"vessel": "vessels"}
QUANTITIES = {
    "effective_stress": "effective stress",
    "shear_stress": "shear stress",
    "amp_log_strain": "AMP strain",
    "shear_log_strain": "shear strain",
    "tensile_log_strain": "tensile strain",
    "pressure": "pressure",
    "contact_pressure_max": "largest contact pressure",
    "contact_pressure_mean": "mean contact pressure",
    "contact_share": "share in contact",
    "contact_pressure": "contact pressure",
    "contact_shear": "shear along the skin",
}
QUANTITIES |= {f"{name}_{NEARLY_ALL}": words for name, words in QUANTITIES.items()}
SITES = {
    "max_separate": "at the Separate maximum",
    "max_combined": "at the Combined maximum",
    "max_both": "of the maxima",
}
SETS = {"separate": "Separate", "combined": "Combined"}
"""Material sets that are compared."""


def material_set(name: str) -> str:
    """Return the name of a material set: the package's with a capital, others as they are."""
    return SETS.get(name, name)


def region(name: str) -> str:
    """Region name without underscores."""
    return name.replace("_", " ")
