"""What a case leaves for the next one: its mesh, the problem set up on it, its first solution."""

import ctypes
import gc
from collections.abc import Callable, Hashable
from contextlib import suppress

import numpy as np

from calfsocket.contact.parameters import Contact
from calfsocket.materials.fields import kind
from calfsocket.materials.law import Law
from calfsocket.mechanics.problem import Problem
from calfsocket.meshes.distributed import SectionMesh
from calfsocket.meshes.refinement import FirstError


class Prepared:
    """Mesh and problem of the last case on a group of ranks, and the error that refined its mesh.

    A case finds them as they were made, whatever the last one did with them, and has the same
    digits as alone.
    """

    def __init__(self) -> None:
        self._geometry: Hashable = None
        self._section: SectionMesh | None = None
        self._points: np.ndarray = np.empty(0)
        self._kind: Hashable = None
        self._problem: Problem | None = None
        self._first: tuple[Hashable, FirstError] | None = None

    def first_error(self, inputs: Hashable, make: Callable[[], FirstError]) -> FirstError:
        """Return the error of a first solution; that of the last one, if its inputs are the same.

        `make` is collective.
        """
        if self._first is None or self._first[0] != inputs:
            self._first = inputs, make()
        return self._first[1]

    def for_second_mesh(self) -> "Prepared":
        """Return what a second mesh of the last case can use: the error of its first solution."""
        second = Prepared()
        second._first = self._first
        return second

    def section(self, geometry: Hashable, make: Callable[[], SectionMesh]) -> SectionMesh:
        """Return the mesh of a geometry; the last one, if it has that (collective)."""
        if self._section is None or geometry != self._geometry:
            if self._section is not None:
                self.forget()
            self._section, self._geometry = make(), geometry
            self._points = self._section.mesh.geometry.x.copy()
        self._section.mesh.geometry.x[:] = self._points  # an expanded socket moves its nodes
        return self._section

    def problem(
        self,
        laws: dict[str, Law],
        contact: Contact,
        conditions: Hashable,
        make: Callable[[], Problem],
    ) -> Problem:
        """Return a problem on that mesh at load 0: the last one, if numbers alone differ.

        `conditions` are what else the problem depends on. One whose socket a carrier has moved is
        made anew.
        """
        kinds = tuple((name, kind(law)) for name, law in laws.items())
        # Without friction the socket rests on a foundation; `Contact` has the other numbers.
        wanted = kinds, contact.gauss_points, contact.friction == 0.0, conditions
        if self._problem is not None and self._problem.carrier is None and wanted == self._kind:
            self._problem.restart(laws, contact)
        else:
            self._problem = None  # not two at a time
            self._problem, self._kind = make(), wanted
        return self._problem

    def forget(self) -> None:
        """Free all of it: Python's cycles, and pages that glibc keeps for later.

        The next case does not fit into their gaps: without this, six cases come to twice the
        memory.
        """
        self._section = self._problem = self._first = None
        gc.collect()
        with suppress(AttributeError):  # not glibc
            ctypes.CDLL(None).malloc_trim(0)
