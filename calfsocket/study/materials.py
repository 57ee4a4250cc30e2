"""A material set in a study file: one of the paper's two, with laws of one's own in it."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag

from calfsocket.io.schema import Strict
from calfsocket.materials.entry import (
    ENTRIES,
    Entry,
    HenckyEntry,
    NeoHookeanEntry,
    OgdenEntry,
    YeohEntry,
)
from calfsocket.materials.laws import Law
from calfsocket.materials.tissues import MaterialSet
from calfsocket.study.files import Files
from calfsocket.study.quantities import File


class LawFile(Strict):
    """A law in a file of its own, as `fit` and `calibrate` write it."""

    file: File


def _kind(content: Any) -> str | None:
    """Tell which law a table is; the brackets tell it from a key in errors."""
    if isinstance(content, Strict):
        content = dict(content)
    if not isinstance(content, dict) or ("law" in content) == ("file" in content):
        return None
    if "file" in content:
        return "<file>"
    name = content["law"]
    return f"<{name}>" if isinstance(name, str) and name in ENTRIES else None


LawOrFile = Annotated[
    Annotated[OgdenEntry, Tag("<ogden>")]
    | Annotated[NeoHookeanEntry, Tag("<neo-hookean>")]
    | Annotated[YeohEntry, Tag("<yeoh>")]
    | Annotated[HenckyEntry, Tag("<hencky>")]
    | Annotated[LawFile, Tag("<file>")],
    Discriminator(
        _kind,
        custom_error_type="law_kind",
        custom_error_message=f"is no law; give a table with law = one of {', '.join(ENTRIES)}, "
        "or with file = a material file",
    ),
]


class MaterialSetEntry(BaseModel):
    """Laws by tissue or region: all other keys are names of these.

    In a set like "combined", `combined` is the law that muscle and fascia share.
    """

    model_config = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False)
    __pydantic_extra__: dict[str, LawOrFile] = Field(init=False)

    like: MaterialSet = "separate"

    def laws(self, files: Files) -> dict[str, Law]:
        """Laws by tissue or region."""
        return laws(self.__pydantic_extra__ or {}, files)


def laws(entries: Mapping[str, Entry | LawFile], files: Files) -> dict[str, Law]:
    """Laws by name."""
    return {
        name: entry.to_law() if isinstance(entry, Entry) else files.law(entry.file)
        for name, entry in entries.items()
    }
