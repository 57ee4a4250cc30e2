"""Quantities of files as pydantic types: text with a unit outside, a number inside."""

from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from calfsocket.io.units import Dimension


@dataclass(frozen=True)
class Written:
    """Annotation of a float that files have as a text such as ``"12 kPa"``.

    Attributes
    ----------
    dimension : Dimension
        Its units.
    example : str
        Shown by editors.
    """

    dimension: Dimension
    example: str

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Read the text before the number is checked."""
        return core_schema.no_info_before_validator_function(self.dimension.parse, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Describe the text."""
        return self.dimension.json_schema(self.example)
