"""Quantities as pydantic types: text with a unit in files, a number in Python.

A number in Python is in the program's own unit (mm, MPa, 1/MPa, degrees, a share of 1); a text with
a unit is accepted there, too. In files the unit is required.

`model_dump` gives numbers, or texts as files have them with `context={"units": {...}}`, a mapping
of the program's units to those that are wanted, e.g. ``{"MPa": "kPa"}``; both read back without
loss.
"""

from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from calfsocket.io.units import Dimension


@dataclass(frozen=True)
class Written:
    """Annotation of a float that files give as a text such as ``"12 kPa"``."""

    dimension: Dimension
    example: str  #: shown by editors

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Convert a text before the number is checked, and back when it is dumped."""
        return core_schema.with_info_before_validator_function(
            self._convert,
            handler(source),
            serialization=core_schema.plain_serializer_function_ser_schema(
                self._write, info_arg=True
            ),
        )

    def _convert(self, value: Any, info: core_schema.ValidationInfo) -> Any:
        if isinstance(value, str) or (info.context or {}).get("units_required"):
            return self.dimension.parse(value)
        return value

    def _write(self, value: float, info: core_schema.SerializationInfo) -> float | str:
        units = (info.context or {}).get("units")
        if units is None:
            return value
        internal = self.dimension.internal
        return self.dimension.text(value, units.get(internal, internal))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Describe the text."""
        return self.dimension.json_schema(self.example)
