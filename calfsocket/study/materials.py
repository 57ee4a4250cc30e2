"""A material set in a study file: one of the paper's two, with custom laws in it."""

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag

from calfsocket.io.schema import Strict
from calfsocket.materials.laws import IN_FILES, AnyLaw, Law
from calfsocket.materials.material_set import BaseSet
from calfsocket.study.names import File

_NAMES = ", ".join(IN_FILES)


class LawFile(Strict):
    """A law in a separate file, as `fit` and `calibrate` write it."""

    file: File


def _kind(content: Any) -> str | None:
    """Return the tag of a law's table or a material file; brackets mark it as a tag in errors."""
    if isinstance(content, Law | LawFile):
        return "<law>" if isinstance(content, Law) else "<file>"
    if not isinstance(content, dict) or ("law" in content) == ("file" in content):
        return None
    return "<file>" if "file" in content else "<law>"


LawOrFile = Annotated[
    Annotated[AnyLaw, Tag("<law>")] | Annotated[LawFile, Tag("<file>")],
    Discriminator(
        _kind,
        custom_error_type="law_kind",
        custom_error_message=f"is not a law; write a table with law = one of {_NAMES}, "
        "or with file = 'FILE'",
    ),
]


class MaterialSetTable(BaseModel):
    """Laws by tissue or region: all other keys are names of these.

    In a set like "combined", `combined` is the law that muscle and fascia share.
    """

    model_config = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False)
    __pydantic_extra__: dict[str, LawOrFile] = Field(init=False)

    like: BaseSet = "separate"

    @property
    def laws(self) -> dict[str, Any]:
        """Laws, or their files, by tissue or region."""
        return self.__pydantic_extra__ or {}
