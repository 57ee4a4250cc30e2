"""What a person should know of a law before it is used, in words."""

from calfsocket.materials.law import readable
from calfsocket.materials.laws import Law, Ogden
from calfsocket.materials.ogden import ALPHA_MAX
from calfsocket.materials.stability import instability, unstable_at_small_strain


class MaterialWarning(UserWarning):
    """A material set that can be used, but perhaps should not be."""


def warnings(law: Law) -> list[str]:
    """Say what makes one doubt that a law is the one that is meant, or that it can be solved."""
    found = [instability(law), _expands(law)]
    if isinstance(law, Ogden):
        found += [law.doubt, _steep(law)]
    return [text for text in found if text]


def refusal(law: Law) -> str:
    """Say why no limb can be solved with a law; empty where one can."""
    text = unstable_at_small_strain(law)
    if not text:
        return ""
    # Constants of another form are the usual reason.
    doubt = law.doubt if isinstance(law, Ogden) else ""
    return f"{text}; {doubt or 'check its parameters'}"


def _steep(law: Ogden) -> str:
    """Say that exponents are beyond those for which the forms are made."""
    largest = max(law.alpha, key=abs)
    if abs(largest) <= ALPHA_MAX:
        return ""
    return (
        f"an exponent is {largest:g}; beyond {ALPHA_MAX:g} in magnitude, stresses at large strain "
        "are less accurate (1e-9 at l1/l2 = 2 up to there)"
    )


def _expands(law: Law) -> str:
    """Say that Poisson's ratio is negative, which a slip of D1's unit makes it."""
    bulk, mu = law.bulk_modulus, law.initial_shear_modulus
    if 3 * bulk >= 2 * mu:
        return ""
    nu = (3 * bulk - 2 * mu) / (6 * bulk + 2 * mu)
    return (
        f"Poisson's ratio at small strain is {nu:.2g}: the bulk modulus, {readable(bulk)}, is "
        f"small beside the shear modulus, {readable(mu)}; check d1, k or nu"
    )
