"""The package's laws, and the type of a law in a file."""

from typing import Annotated

from pydantic import Field

from calfsocket.materials.hencky import Hencky
from calfsocket.materials.law import Law
from calfsocket.materials.ogden import NeoHookean, Ogden, OgdenForm, neo_hookean
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
    "neo_hookean",
]

LAWS: dict[str, type[Law]] = {"ogden": Ogden, "yeoh": Yeoh, "hencky": Hencky}
"""Laws by name."""

AnyLaw = Annotated[Ogden | NeoHookean | Yeoh | Hencky, Field(discriminator="law")]
"""A law as files have it: the key `law` names it."""

IN_FILES = (*LAWS, "neo-hookean")
"""What files may give as `law`."""
