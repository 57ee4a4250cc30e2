r"""Liners: a shape with a law, and laws of common materials by name.

The named laws are neo-Hookean with round initial shear moduli, nearly incompressible (nu = 0.495,
as the tissues of the package), E = 3 mu:

| name | mu | E |
|---|--:|--:|
| silicone | 130 kPa | 0.39 MPa |
| urethane | 100 kPa | 0.3 MPa |
| gel | 40 kPa | 0.12 MPa |

They are not fitted to anyone's curves. Their size is that of 0.38 MPa, which finite element studies
have used for liners since Zhang and Roberts 2000, doi:10.1016/S1350-4533(00)00079-5. Their order is
that of tests of products: polyurethane and silicone liners tend to be stiffer in compression and
shear than those of thermoplastic gel, and all are essentially incompressible (Cagle, Hafner, Taflin
and Sanders 2018, doi:10.1097/JPO.0000000000000205); gels are softer than silicone elastomers in
compression, shear and tension, and silicone elastomers alone span a wide range (Sanders et al.
2004, J. Rehabil. Res. Dev. 41, 175-186). For a product, fit a law to its own test (`fit`).
"""

from typing import Annotated, Any

from pydantic import (
    BeforeValidator,
    GetJsonSchemaHandler,
    SerializeAsAny,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
)
from pydantic_core import CoreSchema

from calfsocket.io.schema import first_problem, nearest
from calfsocket.materials.laws import AnyLaw, Law, Ogden
from calfsocket.materials.warnings import refusal
from calfsocket.meshes.lining import Lining


def _rubber(mu: float) -> Ogden:
    """Neo-Hookean law of an initial shear modulus, MPa."""
    return Ogden(mu=(mu,), alpha=(2.0,), nu=0.495)


LINER_LAWS: dict[str, Law] = {
    "silicone": _rubber(0.130),
    "urethane": _rubber(0.100),
    "gel": _rubber(0.040),
}
"""Laws by name; see above for where they come from."""


def _by_name(value: Any, info: ValidationInfo) -> Any:
    if isinstance(value, str):
        if value not in LINER_LAWS:
            raise ValueError(f"no liner law '{value}'; {nearest(value, LINER_LAWS)}; or {_TABLE}")
        return LINER_LAWS[value]
    if isinstance(value, dict):
        try:
            value = TypeAdapter(AnyLaw).validate_python(value, context=info.context)
        except ValidationError as error:
            raise ValueError(first_problem(value, error)) from None
    if not isinstance(value, Law):
        raise ValueError(f"is {value!r}; use one of {', '.join(LINER_LAWS)}, or {_TABLE}")
    if text := refusal(value):
        raise ValueError(text)
    return value


_TABLE = "give a table with law = 'ogden', say, and its parameters"


class _NameOrTable:
    """How editors check a liner's law."""

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"anyOf": [{"enum": list(LINER_LAWS)}, handler(TypeAdapter(AnyLaw).core_schema)]}


class Liner(Lining):
    """A liner between the limb's skin and the socket.

    Attributes
    ----------
    law : Law
        Of its material: "silicone", "urethane", "gel" (`materials.liner`), or any law.

    Examples
    --------
    >>> Liner(thickness=6.0, law="silicone").law.initial_shear_modulus
    0.13
    """

    law: Annotated[SerializeAsAny[Law], BeforeValidator(_by_name), _NameOrTable()]
