"""Variants of a study: what the paper's text leaves open, one choice changed at a time.

Not all combinations: each choice has a base value with a reason, six runs take minutes, and changes
from one base show which outcome depends on which choice. One combination is added: with the socket
held, the load goes through peaks, and there the stiffness of fascia matters most.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from calfsocket.simulation.case import Settings
from calfsocket.study.study import Study

VARIANTS_FOLDER, BASE = "variants", "base"


@dataclass(frozen=True)
class Variant:
    """A choice that differs from the base.

    Attributes
    ----------
    name : str
        Name of the folder.
    changes : dict
        `case.Settings`, those of `ContactParameters` among them -> value.
    """

    name: str
    changes: Mapping[str, Any]


IN_FILE = {"fric_coeff": "friction"}
"""Names that study files have for settings that are called otherwise here."""

VARIANTS = (
    Variant("socket-held", {"socket_support": "outer-fixed"}),
    Variant("fascia-c10-tables", {"fascia_c10": "tables"}),
    Variant("frictionless", {"fric_coeff": 0.0}),
    Variant("ogden-as-printed", {"ogden_form": "as-printed"}),
    Variant(
        "socket-held-and-fascia-c10-tables",
        {"socket_support": "outer-fixed", "fascia_c10": "tables"},
    ),
)


def studies(study: Study) -> list[Study]:
    """Give the study and its variants, each with a folder of its own in `VARIANTS_FOLDER`.

    A variant that changes nothing, because the study was asked for with that choice, is left out.
    """
    out = study.out / VARIANTS_FOLDER
    family = [replace(study, out=out / BASE)]
    for variant in VARIANTS:
        settings = _changed(study.settings, variant.changes)
        if settings != study.settings:
            family.append(
                replace(
                    study,
                    settings=settings,
                    out=out / variant.name,
                    origin=_origin(study.origin, variant.changes),
                )
            )
    return family


def _origin(origin: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Change the study file that a run.json holds as well, so that it repeats the variant."""
    if not origin:
        return {}
    content = origin["content"]
    model = {IN_FILE.get(key, key): value for key, value in changes.items()}
    return {**origin, "content": {**content, "model": {**content.get("model", {}), **model}}}


def _changed(settings: Settings, changes: Mapping[str, Any]) -> Settings:
    contact = {key: value for key, value in changes.items() if hasattr(settings.contact, key)}
    others = {key: value for key, value in changes.items() if key not in contact}
    return replace(settings, contact=replace(settings.contact, **contact), **others)
