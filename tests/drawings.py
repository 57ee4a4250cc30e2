"""Drawings for the tests of outlines."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezdxf


def dxf(draw: Callable[[Any], object], unit: int = 4) -> Callable[[Path], None]:
    """A DXF drawing in millimetres, or in another unit by its number."""

    def write(path: Path) -> None:
        document = ezdxf.new()
        document.units = unit
        draw(document.modelspace())
        document.saveas(path)

    return write
