"""The package's laws, and the type of a law in a file."""

from typing import Annotated, Any, cast

from pydantic import Field, TypeAdapter, ValidationError

from calfsocket.io.errors import InputError
from calfsocket.io.schema import first_problem
from calfsocket.materials.hencky import Hencky
from calfsocket.materials.law import Law
from calfsocket.materials.notations import Notation
from calfsocket.materials.ogden import Ogden, OgdenForm
from calfsocket.materials.yeoh import Yeoh

__all__ = [
    "IN_FILES",
    "LAWS",
    "AnyLaw",
    "Hencky",
    "Law",
    "Ogden",
    "OgdenForm",
    "Yeoh",
    "material_law",
]

LAWS: dict[str, type[Law]] = {"ogden": Ogden, "yeoh": Yeoh, "hencky": Hencky}
"""Laws by name."""

AnyLaw = Annotated[Ogden | Yeoh | Hencky | Notation, Field(discriminator="law")]
"""A law as files have it: the key `law` names it."""

IN_FILES = (*LAWS, "mooney-rivlin", "neo-hookean", "linear-elastic")
"""What files may give as `law`."""


def material_law(law: str, /, **parameters: Any) -> Law:
    """Return a law by the name and the parameters that material files have for it.

    Parameters
    ----------
    law : str
        "ogden", "yeoh", "hencky"; "mooney-rivlin", "neo-hookean" or "linear-elastic", which become
        one of these.
    **parameters
        Numbers, stresses in MPa, or texts with a unit.

    Raises
    ------
    InputError
        For another name, or parameters that cannot be used.

    Examples
    --------
    >>> material_law("mooney-rivlin", c10="2 kPa", c01="1 kPa", nu=0.495).initial_shear_modulus
    0.006
    """
    content = {"law": law, **parameters}
    try:
        return cast(Law, TypeAdapter(AnyLaw).validate_python(content))
    except ValidationError as error:
        raise InputError(f"{law}: {first_problem(content, error)}") from None
