"""Material sets: the law of every tissue of a limb and of its socket."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from math import inf
from typing import Literal, get_args
from warnings import warn

from calfsocket.io.errors import InputError
from calfsocket.io.schema import nearest
from calfsocket.materials import tissues
from calfsocket.materials.laws import Law, Ogden, OgdenForm, Yeoh
from calfsocket.materials.tissues import FasciaC10
from calfsocket.materials.warnings import MaterialWarning, refusal
from calfsocket.materials.warnings import warnings as law_warnings
from calfsocket.meshes.limb import Limb

BaseSet = Literal["separate", "combined"]
BASE_SETS: tuple[BaseSet, ...] = get_args(BaseSet)

SOFT_TISSUES = ("skin", "fat", "muscle", "fascia", "vessel")


@dataclass(frozen=True)
class MaterialSet:
    """Laws by tissue, and by region where a region has one of its own.

    Two are the paper's, `MaterialSet.paper`; `replace` makes others of them.

    Attributes
    ----------
    name : str
        Name in results.
    base : {"separate", "combined"}
        Whether muscle and fascia have a law each, or share one, which is called "combined".
    laws : mapping of str to Law
        By tissue: skin, fat, muscle and fascia or combined, vessel, bone, socket.
    regions : mapping of str to Law
        By name of a region of the limb, in the place of its tissue's.

    Raises
    ------
    InputError
        When a tissue's law is missing, there is no such tissue, every soft tissue is
        incompressible, or a law loses stability at small strain.

    Warns
    -----
    MaterialWarning
        Where a law loses stability, or may not be the one that is meant; the same are `warnings`.

    Examples
    --------
    >>> fat = Ogden(mu=(1e-3,), alpha=(26.0,), nu=0.495)
    >>> MaterialSet.paper("separate").replace(fat=fat).tissue_laws()["fat"].alpha
    (26.0,)
    """

    name: str
    base: BaseSet
    laws: Mapping[str, Law]
    regions: Mapping[str, Law] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check_choice("material set", self.base, BASE_SETS)
        needed = dict.fromkeys(self.material(tissue) for tissue in tissues.IN_SETS)
        for name, law in {**self.laws, **self.regions}.items():
            if not isinstance(law, Law):
                raise InputError(f"material set {self.name}: {name} is {law!r}; it must be a law")
        for name in self.laws:
            if name not in needed:
                raise InputError(
                    f"material set {self.name}: no tissue '{name}'; {nearest(name, needed)}"
                )
        for name in needed:
            if name not in self.laws:
                raise InputError(f"material set {self.name}: {name} is missing; give its law")
        soft = [*(self.laws[self.material(tissue)] for tissue in SOFT_TISSUES)]
        if all(law.bulk_modulus == inf for law in (*soft, *self.regions.values())):
            raise InputError(
                "every soft tissue is incompressible, but the socket reduces the limb's area; "
                "give at least one tissue nu < 0.5 or d1 > 0"
            )
        for name, law in {**self.laws, **self.regions}.items():
            if text := refusal(law):
                raise InputError(f"material set {self.name}: {name}: {text}")
        for name, text in self.warnings:
            warn(f"material set {self.name}: {name}: {text}", MaterialWarning, stacklevel=3)

    @property
    def warnings(self) -> tuple[tuple[str, str], ...]:
        """Tissue or region, and what makes one doubt its law (`materials.warnings`)."""
        laws = {**self.laws, **self.regions}
        return tuple((name, text) for name, law in laws.items() for text in law_warnings(law))

    @classmethod
    def paper(
        cls,
        name: BaseSet,
        fascia_c10: FasciaC10 = "printed",
        ogden_form: OgdenForm = "abaqus",
    ) -> "MaterialSet":
        """One of the paper's two sets (Table 1).

        Parameters
        ----------
        name : {"separate", "combined"}
            "separate": every tissue its own law; "combined": muscle and fascia share one.
        fascia_c10 : {"printed", "tables"}
            C10 of the separate fascia: "printed" in Table 1, 4.91 MPa, or as the paper's result
            "tables" need it, 0.491 MPa.
        ogden_form : {"abaqus", "as-printed"}
            Factor of Ogden's terms: "abaqus", which reproduces the paper's results, or
            "as-printed", its equation (1).

        Raises
        ------
        InputError
            For another choice.
        """
        _check_choice("material set", name, BASE_SETS)
        _check_choice("fascia_c10", fascia_c10, get_args(FasciaC10))
        _check_choice("ogden_form", ogden_form, get_args(OgdenForm))

        def ogden(law: Ogden) -> Ogden:
            return law.model_copy(update={"form": ogden_form})

        fascia = {**tissues.FASCIA.model_dump(), "c10": tissues.FASCIA_C10[fascia_c10]}
        separate: dict[str, Law] = {"muscle": ogden(tissues.MUSCLE), "fascia": Yeoh(**fascia)}
        combined: dict[str, Law] = {"combined": ogden(tissues.MUSCLE_AND_FASCIA)}
        return cls(
            name,
            name,
            {
                "skin": ogden(tissues.SKIN),
                "fat": ogden(tissues.FAT),
                **(separate if name == "separate" else combined),
                "vessel": tissues.VESSEL,
                "bone": tissues.BONE,
                "socket": tissues.SOCKET,
            },
        )

    def replace(self, limb_regions: Iterable[str] | None = None, /, **laws: Law) -> "MaterialSet":
        """Return a set with other laws of some tissues or regions.

        Parameters
        ----------
        limb_regions : iterable of str, optional
            Names of the limb's regions; those of the reference limb unless given.
        **laws : Law
            By tissue ("combined" in a combined set) or region.

        Raises
        ------
        InputError
            For a name that is neither a tissue of the set nor a region.
        """
        regions = _reference_regions() if limb_regions is None else tuple(limb_regions)
        for name in laws:
            if name not in self.laws and name not in regions:
                raise self._unknown(name, regions)
        by_tissue = {name: law for name, law in laws.items() if name in self.laws}
        by_region = {name: law for name, law in laws.items() if name not in self.laws}
        return replace(self, laws={**self.laws, **by_tissue}, regions={**self.regions, **by_region})

    def replace_known(
        self, laws: Mapping[str, Law], limb_regions: Iterable[str] = ()
    ) -> "MaterialSet":
        """As `replace`, but leave out laws of tissues that only another set has."""
        known = {*self.laws, *limb_regions}
        return self.replace(known, **{name: laws[name] for name in laws if name in known})

    def material(self, tissue: str) -> str:
        """Key in `laws` of a tissue: its name, or "combined"."""
        shared = self.base == "combined" and tissue in ("muscle", "fascia")
        return "combined" if shared else tissue

    def tissue_laws(self) -> dict[str, Law]:
        """Law of each tissue, the socket among them."""
        return {tissue: self.laws[self.material(tissue)] for tissue in tissues.IN_SETS}

    def region_laws(self, limb_regions: Mapping[str, str]) -> dict[str, Law]:
        """Law of each region of a limb and of its socket, the region's own or its tissue's.

        Parameters
        ----------
        limb_regions : mapping of str to str
            Tissue of each region of the limb.

        Raises
        ------
        InputError
            When the limb lacks a region that has a law of its own.
        """
        for name in self.regions:
            if name not in limb_regions:
                raise self._unknown(name, limb_regions)
        of_tissue = self.tissue_laws()
        return {
            region: self.regions.get(region, of_tissue[tissue])
            for region, tissue in {**limb_regions, "socket": "socket"}.items()
        }

    def _unknown(self, name: str, regions: Iterable[str]) -> InputError:
        """Return the error about a name that is neither a tissue nor a region."""
        several = [*self.laws, *regions]
        hint = nearest(name, several)
        if not hint.startswith("did you mean"):
            hint = f"allowed: {', '.join(self.laws)}, or a region, e.g. {several[-1]}"
        return InputError(f"material set {self.name}: no tissue or region '{name}'; {hint}")


@cache
def _reference_regions() -> tuple[str, ...]:
    return tuple(Limb.reference().tissues)


def _check_choice(key: str, value: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise InputError(f"{key} is {value!r}; use one of {', '.join(allowed)}")
