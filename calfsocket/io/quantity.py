"""Quantities as pydantic types: text with a unit in files, a number in Python.

A number in Python is in the program's own unit (mm, MPa, 1/MPa, degrees, a share of 1); a text with
a unit is accepted there, too. In files the unit is required.
"""

from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from calfsocket.io.units import Dimension


@dataclass(frozen=True)
class Written:
    """Annotation of a float that files give as a text such as ``"12 kPa"``.

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
        """Convert a text before the number is checked."""
        return core_schema.with_info_before_validator_function(self._convert, handler(source))

    def _convert(self, value: Any, info: core_schema.ValidationInfo) -> Any:
        if isinstance(value, str) or (info.context or {}).get("units_required"):
            return self.dimension.parse(value)
        return value

    def text(self, value: float) -> str:
        """Write a value as files have it, in the unit of the example, to its last digit."""
        return self.dimension.text(value, self.example.split()[-1])

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Describe the text."""
        return self.dimension.json_schema(self.example)
