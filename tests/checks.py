"""Checks of the verification, for tests that solve its problems on coarser meshes."""

from collections.abc import Iterable

from calfsocket.verification.report import Check


def failing(checks: Iterable[Check]) -> list[Check]:
    """Checks that do not keep their bar; empty where all do, and where there are any at all."""
    checks = list(checks)
    assert checks
    return [check for check in checks if not check.passes]
