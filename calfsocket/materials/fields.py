"""Laws of a mesh's regions, as functions that are constant in each cell."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from dolfinx import fem
from dolfinx.mesh import Mesh, MeshTags, meshtags
from numpy.typing import NDArray

from calfsocket.forms.mixed import LawForm, Material
from calfsocket.io.errors import InputError
from calfsocket.materials.law import Law
from calfsocket.materials.stress_free import StressFree

Kind = tuple[LawForm, int]
"""What compiled code depends on: a law's form and the number of its coefficients."""


def kind(law: Law) -> Kind:
    """Return the kind of a law; laws of one kind differ in numbers alone."""
    return type(law).energy_form, len(law.coefficients())


class LawFields:
    """Parameters of the laws of a mesh, constant in each cell (collective).

    `cell_tags` has the region of every cell, `regions` the tag of each region, and `region_laws`
    the law of each region that has cells.

    Attributes
    ----------
    stress_free : StressFree
        Stress-free states of the regions.
    tags : MeshTags
        Tags of the cells, ghosts included, for `forms.mixed.volume_measure`.
    inverse_bulk, pressure_scale : fem.Function
        See `forms.mixed.Material`.
    """

    def __init__(
        self,
        mesh: Mesh,
        cell_tags: MeshTags,
        regions: Mapping[str, int],
        region_laws: Mapping[str, Law],
    ) -> None:
        laws = _law_of_region(mesh, cell_tags, regions, region_laws)
        self._tags = dict(regions)
        self._laws = laws
        self._space = fem.functionspace(mesh, ("DG", 0))
        self._dofs = self._space.dofmap.list[cell_tags.indices, 0]
        self._regions, self._position = np.unique(cell_tags.values, return_inverse=True)
        self.inverse_bulk = fem.Function(self._space, name="inverse_bulk")
        self.pressure_scale = fem.Function(self._space, name="pressure_scale")
        self.stress_free = StressFree(mesh, cell_tags, regions)
        # Their order does not depend on the regions: compiled forms are named after it.
        ordered = sorted(laws.values(), key=lambda law: (law.name, len(law.coefficients())))
        numbers = {each: i for i, each in enumerate(dict.fromkeys(map(kind, ordered)), start=1)}
        names = {kind(law): law.name for law in ordered}
        self._materials = {
            number: Material(
                law_form=form,
                coefficients=tuple(
                    fem.Function(self._space, name=f"{names[form, size]}_{i + 1}")
                    for i in range(size)
                ),
                inverse_bulk=self.inverse_bulk,
                pressure_scale=self.pressure_scale,
            )
            for (form, size), number in numbers.items()
        }
        self._number = {region: numbers[kind(law)] for region, law in laws.items()}
        self.tags = meshtags(
            mesh, mesh.topology.dim, cell_tags.indices, self._by_cell(self._number, np.int32)
        )
        self.set_laws({})

    def set_laws(self, region_laws: Mapping[str, Law]) -> None:
        """Change the parameters of regions' laws; nothing is compiled again.

        Raises
        ------
        ValueError
            If a region's law would be of another kind.
        """
        for name, law in region_laws.items():
            before = self._laws[self._tags[name]]
            if kind(law) != kind(before):
                was, new = (f"{each.name} with {kind(each)[1]}" for each in (before, law))
                raise ValueError(f"law of {name}: is {was} coefficients, not {new}")
        self._laws |= {self._tags[name]: law for name, law in region_laws.items()}
        of_region = self._laws.items()
        self._fill(self.inverse_bulk, {region: 1 / law.bulk_modulus for region, law in of_region})
        scale = {region: law.initial_shear_modulus for region, law in of_region}
        self._fill(self.pressure_scale, scale)
        for number, material in self._materials.items():
            mine = {r: law.coefficients() for r, law in of_region if self._number[r] == number}
            for i, function in enumerate(material.coefficients):
                self._fill(function, {region: values[i] for region, values in mine.items()})

    @property
    def materials(self) -> dict[int, Material]:
        """Material of each cell tag of `tags`, one a kind of law.

        Its coefficients are DG0 functions, which are 1 in cells of other kinds. All share
        `inverse_bulk`, `pressure_scale` and, while some region has one, the stress-free state.
        """
        tensor = self.stress_free.tensor
        return {tag: replace(each, stress_free=tensor) for tag, each in self._materials.items()}

    def of_region(self, name: str) -> Material:
        """Material of a region."""
        return self.materials[self._number[self._tags[name]]]

    @property
    def parameters(self) -> list[fem.Function]:
        """All functions."""
        coefficients = [each for one in self._materials.values() for each in one.coefficients]
        return [*coefficients, self.inverse_bulk, self.pressure_scale]

    def _fill(self, function: fem.Function, values: Mapping[int, float]) -> None:
        function.x.array[self._dofs] = self._by_cell(values, np.float64)
        function.x.scatter_forward()

    def _by_cell(self, values: Mapping[int, float], dtype: type) -> NDArray[np.generic]:
        """Value of each tagged cell's region, 1 where there is none."""
        by_region = [values.get(region, 1) for region in self._regions.tolist()]
        return np.array(by_region, dtype=dtype)[self._position]


def _law_of_region(
    mesh: Mesh, cell_tags: MeshTags, regions: Mapping[str, int], region_laws: Mapping[str, Law]
) -> dict[int, Law]:
    """Laws of all regions that have cells, by tag, the same on every rank; every cell has one."""
    cells = mesh.topology.index_map(mesh.topology.dim)
    n_local = int(np.count_nonzero(cell_tags.indices < cells.size_local))
    untagged = mesh.comm.allreduce(cells.size_local - n_local)
    if untagged:
        raise InputError(f"mesh: {untagged} cells belong to no region; tag every cell")
    collected = mesh.comm.allgather(np.unique(cell_tags.values).tolist())
    names = {tag: name for name, tag in regions.items()}
    found = {tag: names[tag] for tag in sorted(set().union(*collected))}
    missing = [name for name in found.values() if name not in region_laws]
    if missing:
        raise InputError(f"region_laws: no law for {', '.join(missing)}; give each region one")
    return {tag: region_laws[name] for tag, name in found.items()}
