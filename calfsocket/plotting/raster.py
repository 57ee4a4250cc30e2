"""Fields as images: where in the section each pixel is, found once for all fields."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backend_bases import RendererBase
from matplotlib.cm import ScalarMappable
from numpy.typing import NDArray
from PIL import Image

Window = tuple[float, float, float, float]
"""Left, right, bottom and top of a piece of the section, mm."""

_CORNERS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
"""The four straight triangles of a six-node triangle."""

_PLACES = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
"""Local coordinates r and s of the six nodes."""

_LEVEL = 1e-6
"""Pixels: an edge that rises less is level."""


def _monomials(r: NDArray[np.float64], s: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.stack([np.ones_like(r), r, s, r * r, r * s, s * s], axis=-1)


_COEFFICIENTS = np.linalg.inv(_monomials(*_PLACES.T))
"""Of the monomials, from the values at the six nodes."""


@dataclass(frozen=True)
class Raster:
    """Pixels of an image that lie in cells, in runs: each in one row and one straight triangle.

    Along a run the local coordinates change evenly, so that a quadratic field is a quadratic
    function of the column.
    """

    shape: tuple[int, int]
    """Rows, the lowest first, and columns."""
    first: NDArray[np.int64]
    """Of each run: its first pixel, as an index into the image's ravel(), (n,)."""
    count: NDArray[np.int64]
    """Its number of pixels, (n,)."""
    cell: NDArray[np.int64]
    """Its cell, (n,)."""
    start: NDArray[np.float64]
    """Local coordinates r, s of its first pixel, (2, n)."""
    step: NDArray[np.float64]
    """By how much they change from pixel to pixel, (2, n)."""

    @classmethod
    def of(cls, cells: NDArray[np.float64], window: Window, pixels: int) -> "Raster":
        """Find the pixels, `pixels` across the window's width, of six-node cells (n_cells, 6, 2).

        A cell counts as its four straight triangles: its edges are straight from node to node.
        """
        left, right, bottom, top = window
        size = (right - left) / pixels
        shape = (round((top - bottom) / size), pixels)
        place = (cells - (left, bottom)) / size - 0.5  # pixel centres are whole numbers
        x, y = np.moveaxis(place[:, _CORNERS].reshape(-1, 3, 2), -1, 0)
        triangle, row, begin, end = _crossings(x, y, shape[0])
        first = np.clip(np.ceil(begin), 0, pixels).astype(int)
        count = np.clip(np.floor(end), -1, pixels - 1).astype(int) - first + 1
        hit = np.flatnonzero(count > 0)
        triangle, row, first, count = (each[hit] for each in (triangle, row, first, count))
        origin, across, up = (each[:, triangle] for each in _local(x, y))
        start = origin + first * across + row * up
        return cls(shape, row * pixels + first, count, triangle // 4, start, across)

    def sampled(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a field, at the six nodes of every cell (n_cells, 6), at each of `pixels`."""
        one, r, s, rr, rs, ss = (values @ _COEFFICIENTS.T)[self.cell].T
        (r0, s0), (dr, ds) = self.start, self.step
        constant = one + r0 * (r + r0 * rr + s0 * rs) + s0 * (s + s0 * ss)
        linear = dr * (r + 2 * r0 * rr + s0 * rs) + ds * (s + r0 * rs + 2 * s0 * ss)
        square = dr * (dr * rr + ds * rs) + ds * ds * ss
        column = self._columns
        found = np.repeat(square, self.count)  # in place: pictures have millions of pixels
        for each in (linear, constant):
            found *= column
            found += np.repeat(each, self.count)
        return found

    @cached_property
    def pixels(self) -> NDArray[np.int64]:
        """Index into the image's ravel() of every pixel in a run, run by run."""
        return _ranges(self.first, self.count)[1]

    @cached_property
    def _columns(self) -> NDArray[np.int64]:
        """Place of every pixel in its run."""
        return self.pixels - np.repeat(self.first, self.count)


def _ranges(
    start: NDArray[np.int64], count: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return for ranges of whole numbers, one after the other, the range of each and the number."""
    count = np.maximum(count, 0)
    of = np.repeat(np.arange(len(count)), count)
    return of, np.arange(len(of)) + np.repeat(start - np.cumsum(count) + count, count)


def _crossings(
    x: NDArray[np.float64], y: NDArray[np.float64], rows: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Return triangle, row and the columns where the row enters and leaves it, of all that meet.

    Corners are (n, 3). Along its height a triangle has a long edge on one side and two short ones
    on the other.
    """
    order = np.argsort(y, axis=1)
    (x0, x1, x2), (y0, y1, y2) = (np.take_along_axis(each, order, 1).T for each in (x, y))

    def line(x0: Any, y0: Any, x1: Any, y1: Any) -> tuple[Any, Any]:
        """Return column at row 0, and its change from row to row, along edges."""
        rise = y1 - y0
        level = rise < _LEVEL
        change = np.where(level, 0.0, x1 - x0) / np.where(level, 1.0, rise)
        return x0 - y0 * change, change

    low = np.clip(np.ceil(y0), 0, rows).astype(int)
    high = np.clip(np.floor(y2), -1, rows - 1).astype(int)
    triangle, row = _ranges(low, high - low + 1)
    at, change = line(x0, y0, x2, y2)
    one = at[triangle] + row * change[triangle]
    short = zip(line(x0, y0, x1, y1), line(x1, y1, x2, y2), strict=True)
    at, change = (np.concatenate(each) for each in short)
    edge = triangle + len(y1) * (row >= y1[triangle])
    other = at[edge] + row * change[edge]
    return triangle, row, np.minimum(one, other), np.maximum(one, other)


def _local(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return local coordinates at pixel 0, and their change with column and row, (2, n) each.

    Corners are (n, 3), four triangles a cell.
    """
    (x1, x2), (y1, y2) = (each[:, 1:].T - each[:, 0] for each in (x, y))
    corners = np.tile(_PLACES[_CORNERS], (len(x) // 4, 1, 1))
    origin, first, second = corners.transpose(1, 2, 0)
    area = x1 * y2 - x2 * y1
    across = (y2 * (first - origin) - y1 * (second - origin)) / area
    up = (x1 * (second - origin) - x2 * (first - origin)) / area
    return origin - x[:, 0] * across - y[:, 0] * up, across, up


class FieldImage(Artist):
    """A field in colours over all of its axes, white where there is no value.

    It is made of the pixels in cells and the values there, as of `Raster.sampled`.

    Its pixels are those of the figure at its resolution, in every kind of file: what has as many
    is shown as it is, and more are averaged, once.
    """

    def __init__(self, raster: Raster, values: NDArray[np.float64], scale: ScalarMappable) -> None:
        super().__init__()
        self.raster, self.values, self.scale = raster, values, scale
        self.set_zorder(-1)  # below all else, of which it would hide what is outside the cells

    @cached_property
    def colours(self) -> NDArray[np.uint8]:
        """Red, green, blue and opacity of each pixel, the lowest row first."""
        rgba = np.full((*self.raster.shape, 4), 255, np.uint8)
        rgba.reshape(-1, 4)[self.raster.pixels] = self.scale.cmap(
            self.scale.norm(self.values), bytes=True
        )
        return rgba

    def draw(self, renderer: RendererBase) -> None:
        """Draw it."""
        assert self.axes is not None
        box, scale = self.axes.bbox, renderer.get_image_magnification()
        size = round(box.width * scale), round(box.height * scale)
        if self.colours.shape[1::-1] != size:
            image = Image.fromarray(self.colours)
            self.colours = np.array(image.resize(size, Image.Resampling.HAMMING))
        renderer.draw_image(renderer.new_gc(), box.x0, box.y0, self.colours)
