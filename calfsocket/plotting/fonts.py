"""Fonts in PDF files: cut down to their letters once for all figures, not once for each."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from io import BytesIO
from typing import Any

from matplotlib.backends import _backend_pdf_ps as backend

LETTERS = frozenset(
    map(chr, [*range(0x20, 0x7F), *range(0xA0, 0x100), 0x2070, *range(0x2074, 0x207A), 0x2212])
)
"""Of every cut: Latin 1, the axes' minus and exponents. A figure with others gets its own cut."""

LAYOUT = ["FFTM", "GDEF", "GPOS", "GSUB", "kern"]
"""Tables of rules for setting text, which a PDF does not use: half of the work."""

# A private name of matplotlib 3.10: later releases cut each figure's fonts by themselves.
_cut: Any = getattr(backend, "get_glyphs_subset", None)


class _Font:
    """A cut font as matplotlib uses it: what it saves as."""

    def __init__(self, data: bytes) -> None:
        self.data = data

    def __enter__(self) -> "_Font":
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def save(self, file: BytesIO, **_: Any) -> None:
        """Write it."""
        file.write(self.data)


@cache
def _font(path: str) -> _Font:
    options = backend.subset.Options(glyph_names=True, recommended_glyphs=True)
    options.drop_tables += LAYOUT
    with backend.subset.load_font(path, options) as font:
        cutter = backend.subset.Subsetter(options)
        cutter.populate(text="".join(sorted(LETTERS)))
        cutter.subset(font)
        return _Font(backend.font_as_file(font).getvalue())


def _shared(path: str, letters: Any) -> Any:
    known = isinstance(letters, str) and LETTERS.issuperset(letters)
    return _font(path) if known else _cut(path, letters)


@contextmanager
def cut_once() -> Iterator[None]:
    """Let PDF files share cut fonts, so that a file depends on its own letters alone."""
    if _cut is None:
        yield
        return
    backend.get_glyphs_subset = _shared
    try:
        yield
    finally:
        backend.get_glyphs_subset = _cut
