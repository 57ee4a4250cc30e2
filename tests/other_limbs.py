"""Limbs that are not the calf, as concentric rings, and hand-made studies of them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from calfsocket.materials.material_set import MaterialSet
from calfsocket.mechanics.stepping import LoadSteps
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.socket import NormalOffset
from calfsocket.postprocess.fields import SectionFields
from calfsocket.simulation.record import CaseRecord, StudyRecord, StudySource
from calfsocket.simulation.results import Key, Results
from calfsocket.study.document import ModelTable
from report_results import contact_on, result
from sections import annulus, section


@dataclass(frozen=True)
class Rings:
    """A limb of rings from the bone out: (region, tissue, outer radius in mm)."""

    title: str
    rings: tuple[tuple[str, str, float], ...]
    about: Mapping[str, Any] = field(default_factory=dict)
    hollow: float = 4.0

    @property
    def limb(self) -> Limb:
        """The limb as a file would have it."""
        radii = {"hollow": self.hollow} | {name: radius for name, _, radius in self.rings}
        inside = dict(zip((name for name, *_ in self.rings), radii, strict=False))
        return Limb.model_validate(
            {
                "title": self.title,
                "units": "mm, deg",
                "fixed_boundary": "hollow",
                "contact_boundary": self.rings[-1][0],
                "curves": {
                    name: {
                        "type": "ellipse",
                        "center": [0, 0],
                        "semi_axes": [radius, radius],
                        "angle_deg": 0,
                    }
                    for name, radius in radii.items()
                },
                "regions": [
                    {"name": name, "tissue": tissue, "outer": name, "holes": [inside[name]]}
                    for name, tissue, _ in self.rings
                ],
                **self.about,
            }
        )

    @property
    def radius(self) -> float:
        """Radius of the skin, mm."""
        return self.rings[-1][2]

    def fields(self, press: float, socket: float, n: int = 36) -> SectionFields:
        """Return a squeeze by `press` mm of the skin and stress in proportion, most at 30 degrees.

        `socket` is the socket's inner radius, mm.
        """
        points, cells, ring = annulus([self.hollow, *(radius for *_, radius in self.rings)], n)
        shell, shell_cells, _ = annulus([socket, socket + 4.0], n)
        regions = {i + 1: (name, tissue) for i, (name, tissue, _) in enumerate(self.rings)}
        regions[len(regions) + 1] = ("socket", "socket")

        def shape(x: np.ndarray) -> np.ndarray:
            angle = np.arctan2(x[..., 1], x[..., 0])
            return press * (1 + 0.5 * np.cos(angle - np.pi / 6))

        def squeeze(x: np.ndarray) -> np.ndarray:
            r = np.linalg.norm(x, axis=1)
            depth = np.clip(r - self.rings[0][2], 0, None) / (self.radius - self.rings[0][2])
            inside = r < self.radius + 0.01
            return -(np.where(inside, depth, 0) * shape(x) / r)[:, None] * x

        def stress(x: np.ndarray) -> np.ndarray:
            s = shape(x) * np.linalg.norm(x, axis=-1) / self.radius
            return np.stack([s, -s, 0 * s, 0.3 * s], -1)

        return section(
            np.vstack([points, shell]),
            np.vstack([cells, shell_cells + len(points)]),
            np.concatenate([ring + 1, np.full(len(shell_cells), len(regions))]),
            regions,
            squeeze,
            stress,
            pressure=lambda x: 0 * x[..., 0],
        )


THIGH = Rings(
    "Left thigh above the knee",
    (
        ("femur", "bone", 12.0),
        ("quadriceps", "muscle", 60.0),
        ("subcutaneous_fat", "fat", 70.0),
        ("skin", "skin", 72.0),
    ),
    {"side": "left", "seen_from": "above", "axes": {"+x": "medial", "+y": "anterior"}},
)
FOREARM = Rings(
    "right forearm with one bone",
    (
        ("radius", "bone", 9.0),
        ("flexors", "muscle", 30.0),
        ("vein", "vessel", 31.5),
        ("fat", "fat", 36.0),
        ("skin", "skin", 37.5),
    ),
    {"side": "right", "axes": {"+x": "lateral", "+y": "anterior"}},
)
STUMP = Rings(
    "A limb whose axes nobody wrote down",
    (
        ("shaft", "bone", 14.0),
        ("sleeve", "fascia", 16.0),
        ("padding", "fat", 44.0),
        ("dermis", "skin", 46.0),
    ),
)


def study_of(
    rings: Rings,
    cases: Mapping[Key, float],
    sets: Iterable[MaterialSet],
    folder: Path,
    gap: float = -1.0,
    failed: Mapping[Key, CaseRecord] | None = None,
    **model: Any,
) -> Results:
    """Return results of a limb in sockets; of each case how far it presses, mm.

    `gap` is by how much the sockets' inner radius is larger than the skin's, mm.
    """
    made = {}
    for (socket, name), press in cases.items():
        fields = rings.fields(press, rings.radius + gap)
        line = contact_on(fields, 10 * press, rings.radius)
        made[socket, name] = result((socket, name), fields, line)
    records = {key: each.record for key, each in made.items()} | dict(failed or {})
    sockets = dict.fromkeys(socket for socket, _ in records)
    run = StudyRecord(
        versions={"calfsocket": "0"},
        petsc_options={},
        ranks=1,
        study=StudySource(file="study.toml", content={}),
        settings={
            "model": ModelTable(size="coarse", **model).model_dump(),
            "steps": LoadSteps().model_dump(),
        },
        limb=rings.limb,
        sockets={name: NormalOffset(name=name, base=-gap) for name in sockets},
        laws={each.name: {**each.tissue_laws(), **each.regions} for each in sets},
        inputs={},
        finished=True,
        cases={record.name: record for record in records.values()},
    )
    return Results(folder, run, records, lambda record: made[record.key])
