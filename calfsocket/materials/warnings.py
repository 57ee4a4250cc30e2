"""What a person should know of a law before it is used, in words."""

from calfsocket.materials.law import readable
from calfsocket.materials.laws import Law, Ogden
from calfsocket.materials.stability import instability


class MaterialWarning(UserWarning):
    """A material set that can be used, but perhaps should not be."""


def warnings(law: Law) -> list[str]:
    """Say what makes one doubt that a law is the one that is meant, or that it can be solved."""
    found = [instability(law), law.doubt if isinstance(law, Ogden) else "", _expands(law)]
    return [text for text in found if text]


def _expands(law: Law) -> str:
    """Say that Poisson's ratio is negative, which a slip of D1's unit makes it."""
    bulk, mu = law.bulk_modulus, law.initial_shear_modulus
    if 3 * bulk >= 2 * mu:
        return ""
    nu = (3 * bulk - 2 * mu) / (6 * bulk + 2 * mu)
    return (
        f"Poisson's ratio at small strain is {nu:.2g}: the bulk modulus, {readable(bulk)}, is "
        f"small beside the shear modulus, {readable(mu)}; check d1 or k and its unit"
    )
