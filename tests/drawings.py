"""Drawings for the tests of outlines."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np


def dxf(draw: Callable[[Any], object], unit: int = 4) -> Callable[[Path], None]:
    """A DXF drawing in millimetres, or in another unit by its number."""

    def write(path: Path) -> None:
        document = ezdxf.new()
        document.units = unit
        draw(document.modelspace())
        document.saveas(path)

    return write


def outlined_svg(path: Path, curves: Mapping[str, np.ndarray]) -> Path:
    """Write closed curves, mm, as an SVG drawing, each under an id of its own."""
    paths = (
        f'<path id="{name}" d="M {" L ".join(f"{x:.4f},{-y:.4f}" for x, y in points)} Z"/>'
        for name, points in curves.items()
    )
    path.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="200mm" height="200mm"'
        ' xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
        f' viewBox="-100 -100 200 200">{"".join(paths)}</svg>'
    )
    return path
