"""The element by itself: patch test, manufactured solutions, and a fascia strip that bends."""

from calfsocket.verification import bending, manufactured, patch_test
from calfsocket.verification.report import Section


def report() -> Section:
    """Run patch test, rates, and the elements that were not chosen."""
    convergences = manufactured.convergences()
    fine = bending.bending(bending.OURS, *bending.REFERENCE)
    errors = {name: bending.bending_errors(name, fine) for name in bending.ELEMENTS}
    texts = [_problem(module.__doc__ or "") for module in (patch_test, manufactured, bending)]
    return Section(
        "The element",
        "\n\n".join([__doc__ or "", *texts]),
        [*patch_test.checks(), *manufactured.checks(convergences), *bending.checks(errors)],
        [manufactured.figure(convergences), bending.figure(fine)],
    )


def _problem(text: str) -> str:
    """Text of a module without its first line, which is a heading there."""
    return text.partition("\n")[2].strip()
