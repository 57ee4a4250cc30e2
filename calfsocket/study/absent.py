"""Keys that one may look for in study files, which do not have them."""

from collections.abc import Mapping
from typing import Any

from calfsocket.io.errors import InputError

_LOADS = (
    "loads on the socket after donning are stages: add [[loads]] with a name and force, moment, "
    "displacement, rotation or volume"
)
_LINERS = "a liner has a table of its own, [liner], with thickness and law, for all sockets"
_PRESSURES = (
    "prescribed pressures are not implemented: contact pressure is a result of the socket's shape"
)
_TIME = "time is not implemented: a result is an equilibrium, and `steps` are shares of the load"
_OF_THE_LIMB = "belongs in the limb's own file, which `limb` in the table [study] names"

ABSENT = {
    **dict.fromkeys(
        ("load", "force", "forces", "weight", "body_weight", "torque", "moment"), _LOADS
    ),
    **dict.fromkeys(("shear", "shear_force", "axial", "axial_load", "displacement"), _LOADS),
    **dict.fromkeys(("liners", "sock", "socks", "interface", "liner_thickness"), _LINERS),
    **dict.fromkeys(("pressure", "pressures", "vacuum", "suction"), _PRESSURES),
    **dict.fromkeys(("time", "times", "duration", "gait", "viscosity", "density"), _TIME),
    **dict.fromkeys(("side", "axes", "seen_from"), _OF_THE_LIMB),
}
"""What is said of each of them."""

_INSIDE = {**ABSENT, "liner": _LINERS}
"""The same within tables."""

_OF_LAWS = ("materials", "laws")
"""Tables whose keys are names of sets, tissues and regions, which may be any."""


def refuse_word(key: str) -> None:
    """Raise an InputError for a key that study files do not have."""
    if key in ABSENT:
        raise InputError(f"{key}: {ABSENT[key]}")


def refuse_absent(content: Mapping[str, Any]) -> None:
    """Refuse keys that study files do not have.

    Raises
    ------
    InputError
        That names the key and says what is done in its place.
    """
    for key, table in content.items():
        refuse_word(key)
        if key in _OF_LAWS or not isinstance(table, Mapping):
            continue
        inner = {f"sockets.{name}": of for name, of in table.items()} if key == "sockets" else {}
        for place, values in (inner or {key: table}).items():
            for word in values if isinstance(values, Mapping) else ():
                if word in _INSIDE:
                    raise InputError(f"{place}.{word}: {_INSIDE[word]}")
