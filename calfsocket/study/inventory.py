"""What run.json tells of the cases and of their laws."""

from collections.abc import Iterable
from typing import Any

from calfsocket.materials.material_set import BASE_SETS
from calfsocket.meshes.data import Limb
from calfsocket.simulation.case import Case, Settings, case_laws


def about(case: Case) -> dict[str, Any]:
    """Tell in a case's entry what it is."""
    return {
        "socket": case.socket,
        "material_set": case.material_set,
        "paper_set": case.paper_set,
        "changes": dict(case.changes),
    }


def laws_of_sets(
    cases: Iterable[Case], settings: Settings, limb: Limb
) -> dict[str, dict[str, dict[str, Any]]]:
    """Laws of the paper's sets and of those of the cases: set -> tissue or region -> law.

    A socket's own law is not among them: cases of one set may have several.
    """
    regions = {region.name for region in limb.regions}
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for case in (*(Case("", name) for name in BASE_SETS), *cases):
        if case.material_set in found:
            continue
        shared = case.settings or settings
        own = {name: law for name, law in shared.materials.items() if name in regions}
        found[case.material_set] = {
            name: law.model_dump(mode="json")
            for name, law in {**own, **case_laws(case, shared)}.items()
        }
    return found
