"""What a report computes of a study once, for its tables, figures and sentences."""

from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pandas as pd
from shapely import Polygon, area, difference

from calfsocket.imaging.layer_thickness import LayerThickness
from calfsocket.materials.law import Law
from calfsocket.materials.liner import Liner
from calfsocket.materials.tissues import TISSUES
from calfsocket.materials.warnings import warnings
from calfsocket.meshes.frame import Frame
from calfsocket.meshes.levels import LimbLevels
from calfsocket.meshes.limb import Limb
from calfsocket.plotting import section
from calfsocket.plotting.raster import Window
from calfsocket.plotting.section import DeformedSection
from calfsocket.plotting.style import window_around
from calfsocket.postprocess.fields import SectionFields
from calfsocket.postprocess.quantities import SUMMARY_TISSUES
from calfsocket.report import inputs, names
from calfsocket.report.changes import relative_changes
from calfsocket.report.damage import DamageThresholds, damage, damage_after_stages
from calfsocket.report.names import SETS
from calfsocket.report.uncertain import Uncertainty
from calfsocket.report.variants import BASE, variants
from calfsocket.simulation.result import Result
from calfsocket.simulation.results import Key, Results

STIFF = 10.0
"""A tissue is a stiff sheet in another whose initial shear modulus is smaller by this factor."""

AREA_DIGITS = 2
"""Decimals of a share of area in %: two areas that agree in them are called equal."""


@dataclass(frozen=True, eq=False)
class Findings:
    """A study's results and what follows from them."""

    study: Results
    thresholds: DamageThresholds = field(default_factory=DamageThresholds)
    _sections: dict[Key, DeformedSection] = field(default_factory=dict, init=False)

    @cached_property
    def results(self) -> Results:
        """The cases that are shown one by one: of variants or a design, those of the base."""
        if self.uncertainty:
            return self.study.select({}) or self.study
        return variants(self.study).get(BASE, self.study)

    @property
    def judged(self) -> Results:
        """The cases whose checks are told one by one: all but those of a design."""
        return self.results if self.uncertainty else self.study

    @cached_property
    def uncertainty(self) -> Uncertainty | None:
        """What uncertain inputs do to the results, where the study has any."""
        return Uncertainty.of(self.study)

    @cached_property
    def changes(self) -> pd.DataFrame:
        """Relative changes from the Separate to the Combined set."""
        return relative_changes(self.results, self.soft_tissues)

    @cached_property
    def damage(self) -> pd.DataFrame:
        """Strains against the damage thresholds."""
        return damage(self.results, self.thresholds)

    @cached_property
    def damage_after_stages(self) -> pd.DataFrame:
        """The same at the end of each stage of loading."""
        return damage_after_stages(self.results, self.thresholds)

    # --- what it draws

    @cached_property
    def window(self) -> Window:
        """What drawings of the deformed section show: the same piece in every case."""
        return window_around(*(each.fields.deformed for each in self.results.values()), margin_mm=2)

    def section(self, result: Result) -> DeformedSection:
        """Return the deformed section of a case, for all drawings of it."""
        key = result.record.key
        if key not in self._sections:
            self._sections[key] = DeformedSection(result.fields)
        return self._sections[key]

    # --- the limb

    @property
    def fields(self) -> SectionFields:
        """Fields of the first case, for what is the same in all."""
        return next(iter(self.results.values())).fields

    @property
    def _every_section(self) -> list[SectionFields]:
        """Fields of a case for each section: levels of a limb may differ in their tissues."""
        if self.levels is None:
            return [self.fields]
        found = {record.level: key for key, record in self.results.records.items()}
        return [self.results[key].fields for key in found.values()]

    @property
    def levels(self) -> LimbLevels | None:
        """The limb, where it has many levels."""
        return self.study.run.levels if self.study.run else None

    @cached_property
    def limb(self) -> Limb | None:
        """The section of the first case; None where single results were saved without a study."""
        run = self.study.run
        if run is None:
            return None
        found = inputs.settings(self.results)
        thickness = LayerThickness(**{key: found.get(key) for key in LayerThickness.model_fields})
        if run.limb is not None:
            return thickness.of(run.limb)
        place = next(iter(self.results.records.values())).level
        levels = self.levels.levels if self.levels else ()
        return thickness.of(next(each.limb for each in levels if place and each.name == place.name))

    @property
    def frame(self) -> Frame:
        """Where lateral and anterior lie."""
        return self.limb.frame if self.limb else next(iter(self.results.records.values())).frame

    @cached_property
    def tissues(self) -> tuple[str, ...]:
        """Tissues of the section."""
        return tuple(
            name
            for name in TISSUES
            if any(len(fields.cells_of(name)) for fields in self._every_section)
        )

    @property
    def soft_tissues(self) -> tuple[str, ...]:
        """Tissues of the section of which the summary has rows."""
        return tuple(name for name in SUMMARY_TISSUES if name in self.tissues)

    @property
    def fixed_region(self) -> str:
        """Region within which the limb is fixed; empty where that is not known or one."""
        limbs = self.levels.limbs if self.levels else filter(None, [self.limb])
        found = {
            each.name
            for limb in limbs
            for each in limb.regions
            if limb.fixed_boundary in each.holes
        }
        return found.pop() if len(found) == 1 else ""

    # --- its sockets

    @property
    def liner(self) -> Liner | None:
        """The liner of the cases that are shown one by one."""
        table = self.study.run.settings.get("liner") if self.study.run else None
        laws = inputs.laws(self.results) if table else {}
        law = next((of["liner"] for of in laws.values() if "liner" in of), None)
        return Liner(**table, law=law) if table and law else None

    @property
    def socket_titles(self) -> dict[str, str]:
        """Name of each socket, with its title where it has one."""
        known = self.study.run.sockets if self.study.run else {}
        titles = {name: getattr(known.get(name), "title", "") for name in self.results.sockets}
        return {name: f"{name}, {title}" if title else name for name, title in titles.items()}

    @property
    def own_walls(self) -> dict[str, list[str]]:
        """Numbers of their own that walls of sockets have, in words."""
        known = self.study.run.sockets if self.study.run else {}
        own = {name: known[name].elasticity() for name in self.results.sockets if name in known}
        units = {"e": " MPa", "nu": ""}
        return {
            name: [f"{key} {value:.6g}{units[key]}" for key, value in numbers.items()]
            for name, numbers in own.items()
            if numbers
        }

    @cached_property
    def areas(self) -> pd.DataFrame:
        """What each socket takes of the limb's area, %.

        `lost` is by how much less it encloses than the limb, `overlap` the share that lies in its
        wall before contact.
        """
        fields = {socket: result.fields for (socket, _), result in self.results.items()}
        rows = [_areas(each) for each in fields.values()]
        return pd.DataFrame(rows, [*fields], ["lost", "overlap"]).round(AREA_DIGITS)

    @property
    def not_smaller(self) -> list[str]:
        """Sockets that do not enclose less area than the limb."""
        return [*self.areas.index[self.areas.lost <= 0]]

    # --- its material sets

    @cached_property
    def laws(self) -> dict[str, dict[str, Law]]:
        """Laws of what the section has, by tissue or region, in each material set."""
        regions = {name for each in self._every_section for name in each.region_names.values()}
        present = {*self.tissues, *regions, "socket"}
        known = inputs.laws(self.results)
        return {
            name: {key: law for key, law in known[name].items() if key in present}
            for name in self.results.material_sets
            if name in known
        }

    @cached_property
    def doubts(self) -> list[str]:
        """What makes one doubt a law: material set, tissue or region, and why."""
        return [
            f"{names.material_set(name)} set, {names.region(key)}: {text}"
            for name, laws in self.laws.items()
            for key, law in laws.items()
            for text in warnings(law)
        ]

    @cached_property
    def shared_laws(self) -> dict[str, list[list[str]]]:
        """Groups of soft tissues that have one law, in each material set."""
        return {
            name: [
                [tissue for tissue in self.soft_tissues if laws[tissue] == law]
                for law, n in Counter(laws[tissue] for tissue in self.soft_tissues).items()
                if n > 1
            ]
            for name, laws in self.laws.items()
        }

    @property
    def merged(self) -> bool:
        """Whether muscle and fascia have one law in the Combined set, and only there."""
        pair = {"muscle", "fascia"}
        return [
            any(pair <= {*group} for group in self.shared_laws.get(name, [])) for name in SETS
        ] == [False, True]

    @property
    def own_laws(self) -> list[str]:
        """Regions that have a law of their own in some material set."""
        named = dict.fromkeys(name for laws in self.laws.values() for name in laws)
        return [name for name in named if name not in TISSUES]

    @property
    def stiff_fascia(self) -> bool:
        """Whether fascia is a stiff sheet in soft muscle, in some material set."""
        return {"fascia", "muscle"} <= {*self.tissues} and any(
            laws["fascia"].initial_shear_modulus > STIFF * laws["muscle"].initial_shear_modulus
            for laws in self.laws.values()
        )


def _areas(fields: SectionFields) -> tuple[float, float]:
    paths = (section.boundary(fields.cells[body], fields.points) for body in fields.bodies)
    limb, socket = ([Polygon(np.asarray(ring)) for ring in each.to_polygons()] for each in paths)
    outline, cavity = max(limb, key=area), min(socket, key=area)
    outside = area(difference(outline, cavity))
    return 100 * (1 - area(cavity) / area(outline)), 100 * outside / area(outline)
