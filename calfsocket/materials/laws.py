"""Laws with their parameters, and how they reach the forms: one law a region."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from dolfinx import fem
from dolfinx.mesh import Mesh, MeshTags, meshtags

from calfsocket.forms.mixed import LAW_IDS, LawFields
from calfsocket.io.errors import InputError

OgdenForm = Literal["abaqus", "as-printed"]
OGDEN_FORMS: tuple[OgdenForm, ...] = ("abaqus", "as-printed")


@dataclass(frozen=True)
class Ogden:
    """Ogden's law (`forms.ogden`) with one or more terms.

    Attributes
    ----------
    mu : tuple of float
        Moduli, MPa; their sum is positive.
    alpha : tuple of float
        Exponents, not 0, as many as moduli.
    d1 : float
        D1 = 2/K, 1/MPa; 0 where incompressible.
    form : str
        Factor of the terms: "abaqus" 2 mu/alpha^2, or "as-printed" mu/alpha, which is the paper's
        equation (1) and the same energy with mu alpha/2 in the place of mu.

    Examples
    --------
    >>> Ogden(mu=(0.22,), alpha=(12.0,), d1=0.0912).initial_shear_modulus
    0.22
    >>> Ogden(mu=(0.22,), alpha=(12.0,), d1=0.0912, form="as-printed").initial_shear_modulus
    1.32
    """

    name: ClassVar[str] = "ogden"
    mu: tuple[float, ...]
    alpha: tuple[float, ...]
    d1: float
    form: OgdenForm = "abaqus"

    def __post_init__(self) -> None:
        if self.form not in OGDEN_FORMS:
            raise InputError(f"Ogden: form is {self.form!r}; use one of {', '.join(OGDEN_FORMS)}")
        if not self.mu or len(self.mu) != len(self.alpha):
            raise InputError(
                f"Ogden: {len(self.mu)} mu and {len(self.alpha)} alpha; "
                "give one of each a term, and at least one term"
            )
        for alpha in self.alpha:
            if not math.isfinite(alpha) or alpha == 0:
                raise InputError(f"Ogden: alpha is {alpha}; give a finite number other than 0")
        _positive("Ogden", "initial shear modulus", self.initial_shear_modulus)
        _not_negative("Ogden", "D1", self.d1)

    @property
    def abaqus_mu(self) -> tuple[float, ...]:
        """Moduli that give this energy in Abaqus's form, MPa."""
        if self.form == "abaqus":
            return self.mu
        return tuple(mu * alpha / 2 for mu, alpha in zip(self.mu, self.alpha, strict=True))

    @property
    def initial_shear_modulus(self) -> float:
        """Sum of the moduli in Abaqus's form, MPa."""
        return math.fsum(self.abaqus_mu)

    @property
    def bulk_modulus(self) -> float:
        """K = 2/D1, MPa; infinite where incompressible."""
        return 2 / self.d1 if self.d1 else math.inf


@dataclass(frozen=True)
class Yeoh:
    """Yeoh's law (`forms.yeoh`), incompressible.

    Attributes
    ----------
    c10, c20, c30 : float
        Coefficients, MPa; C10 + 2 C20 i + 3 C30 i^2 stays positive for every i = I1 - 3 >= 0.
    """

    name: ClassVar[str] = "yeoh"
    c10: float
    c20: float = 0.0
    c30: float = 0.0

    def __post_init__(self) -> None:
        _positive("Yeoh", "C10", self.c10)
        for key, value in (("C20", self.c20), ("C30", self.c30)):
            if not math.isfinite(value):
                raise InputError(f"Yeoh: {key} is {value} MPa; give a finite number")
        softens = self.c20 < 0 and self.c20**2 >= 3 * self.c10 * self.c30
        if self.c30 < 0 or softens:
            raise InputError(
                f"Yeoh: with C10, C20, C30 = {self.c10}, {self.c20}, {self.c30} MPa the stiffness "
                "falls to 0 at large strain; give C30 >= 0, and C20 > -sqrt(3 C10 C30)"
            )

    @property
    def initial_shear_modulus(self) -> float:
        """2 C10, MPa."""
        return 2 * self.c10

    @property
    def bulk_modulus(self) -> float:
        """Infinite: incompressible."""
        return math.inf


@dataclass(frozen=True)
class Hencky:
    """Linear elasticity in the logarithmic strain (`forms.hencky`).

    Attributes
    ----------
    e : float
        Young's modulus, MPa.
    nu : float
        Poisson's ratio, -1 < nu <= 0.5; 0.5 is incompressible.
    """

    name: ClassVar[str] = "hencky"
    e: float
    nu: float

    def __post_init__(self) -> None:
        _positive("Hencky", "E", self.e)
        if not -1 < self.nu <= 0.5:
            raise InputError(f"Hencky: nu is {self.nu}; give -1 < nu <= 0.5")

    @property
    def initial_shear_modulus(self) -> float:
        """E / (2 (1 + nu)), MPa."""
        return self.e / (2 * (1 + self.nu))

    @property
    def bulk_modulus(self) -> float:
        """K = E / (3 (1 - 2 nu)), MPa; infinite where incompressible."""
        return self.e / (3 * (1 - 2 * self.nu)) if self.nu < 0.5 else math.inf


Law = Ogden | Yeoh | Hencky


def neo_hookean(mu: float, d1: float) -> Ogden:
    """Neo-Hookean law, psi = mu/2 (I1b - 3): Ogden's of one term with alpha = 2.

    Parameters
    ----------
    mu : float
        Initial shear modulus, MPa.
    d1 : float
        D1 = 2/K, 1/MPa; 0 where incompressible.
    """
    return Ogden(mu=(mu,), alpha=(2.0,), d1=d1)


def d1_from_poisson(mu: float, nu: float) -> float:
    """D1 = 3 (1 - 2 nu) / (mu (1 + nu)), 1/MPa (the paper's note under Table 1).

    Parameters
    ----------
    mu : float
        Initial shear modulus, MPa, > 0.
    nu : float
        Poisson's ratio at small strain, -1 < nu <= 0.5; 0.5 is incompressible and gives 0.

    Raises
    ------
    InputError
        When nu is outside its range.
    """
    if not -1 < nu <= 0.5:
        raise InputError(f"nu is {nu}; give -1 < nu <= 0.5")
    return 3 * (1 - 2 * nu) / (mu * (1 + nu))


def ogden_terms(laws: Iterable[Law]) -> int:
    """Ogden terms that forms for these laws have: as many as the longest law, and at least one."""
    return max([len(law.mu) for law in laws if isinstance(law, Ogden)], default=1)


def _positive(law: str, key: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0):
        raise InputError(f"{law}: {key} is {value}; give a finite number above 0")


def _not_negative(law: str, key: str, value: float) -> None:
    if not (math.isfinite(value) and value >= 0):
        raise InputError(f"{law}: {key} is {value}; give a finite number of 0 or more")


def law_tags(mesh: Mesh, cell_tags: MeshTags, region_laws: Mapping[int, Law]) -> MeshTags:
    """Cell tags of the laws, `forms.mixed.LAW_IDS`, for `forms.mixed.volume_measure`."""
    laws = _law_of_region(mesh, cell_tags, region_laws)
    ids = {region: LAW_IDS[law.name] for region, law in laws.items()}
    values = np.array([ids[region] for region in cell_tags.values.tolist()], dtype=np.int32)
    return meshtags(mesh, mesh.topology.dim, cell_tags.indices, values)


def law_fields(mesh: Mesh, cell_tags: MeshTags, region_laws: Mapping[int, Law]) -> LawFields:
    """Parameters of the laws, constant in each cell.

    Parameters
    ----------
    mesh : Mesh
        Distributed mesh.
    cell_tags : MeshTags
        Region of every cell.
    region_laws : mapping of int to law
        Law of each region that the cells name.

    Returns
    -------
    LawFields
        DG0 functions; a law's parameters are 0 (Ogden's alpha 1) in cells of other laws. There are
        as many Ogden terms as the longest law has, and at least one.
    """
    laws = _law_of_region(mesh, cell_tags, region_laws)
    space = fem.functionspace(mesh, ("DG", 0))
    dofs = space.dofmap.list[cell_tags.indices, 0]
    regions, position = np.unique(cell_tags.values, return_inverse=True)

    def field(name: str, values: Mapping[int, float], otherwise: float = 0.0) -> fem.Function:
        function = fem.Function(space, name=name)
        by_region = np.array([values.get(region, otherwise) for region in regions.tolist()])
        function.x.array[dofs] = by_region[position] if len(regions) else []
        function.x.scatter_forward()
        return function

    ogden = {region: law for region, law in laws.items() if isinstance(law, Ogden)}
    yeoh = {region: law for region, law in laws.items() if isinstance(law, Yeoh)}
    hencky = {region: law for region, law in laws.items() if isinstance(law, Hencky)}
    n_terms = ogden_terms(laws.values())

    def term(i: int, values: Mapping[int, tuple[float, ...]]) -> dict[int, float]:
        return {region: value[i] for region, value in values.items() if i < len(value)}

    mu = {region: law.abaqus_mu for region, law in ogden.items()}
    alpha = {region: law.alpha for region, law in ogden.items()}
    return LawFields(
        ogden_mu=tuple(field(f"ogden_mu_{i + 1}", term(i, mu)) for i in range(n_terms)),
        ogden_alpha=tuple(
            field(f"ogden_alpha_{i + 1}", term(i, alpha), otherwise=1.0) for i in range(n_terms)
        ),
        c10=field("c10", {region: law.c10 for region, law in yeoh.items()}),
        c20=field("c20", {region: law.c20 for region, law in yeoh.items()}),
        c30=field("c30", {region: law.c30 for region, law in yeoh.items()}),
        hencky_mu=field(
            "hencky_mu", {region: law.initial_shear_modulus for region, law in hencky.items()}
        ),
        inverse_bulk=field(
            "inverse_bulk", {region: 1 / law.bulk_modulus for region, law in laws.items()}
        ),
        pressure_scale=field(
            "pressure_scale",
            {region: law.initial_shear_modulus for region, law in laws.items()},
        ),
    )


def _law_of_region(
    mesh: Mesh, cell_tags: MeshTags, region_laws: Mapping[int, Law]
) -> dict[int, Law]:
    """Laws of all regions of the mesh, the same on every rank; every cell has one."""
    cells = mesh.topology.index_map(mesh.topology.dim)
    n_local = int(np.count_nonzero(cell_tags.indices < cells.size_local))
    untagged = mesh.comm.allreduce(cells.size_local - n_local)
    if untagged:
        raise InputError(f"mesh: {untagged} cells belong to no region; tag every cell")
    gathered = mesh.comm.allgather(np.unique(cell_tags.values).tolist())
    regions = sorted(set().union(*gathered))
    missing = [region for region in regions if region not in region_laws]
    if missing:
        raise InputError(f"region_laws: no law for region {missing}; give one law a region")
    return {region: region_laws[region] for region in regions}
