"""The element by itself: patch test, manufactured solutions, and a fascia strip that bends."""

from calfsocket.verification import bending, manufactured, patch_test
from calfsocket.verification.report import Section


def report() -> Section:
    """Run patch test, rates, and the elements that were not chosen."""
    convergences = manufactured.convergences()
    fine = bending.bending(bending.OURS, bending.REFERENCE)
    errors = {name: bending.bending_errors(name, fine) for name in bending.ELEMENTS}
    return Section(
        [*patch_test.checks(), *manufactured.checks(convergences), *bending.checks(errors)],
        {
            "element_rates": manufactured.figure(convergences),
            "element_bending": bending.figure(fine),
        },
    )
