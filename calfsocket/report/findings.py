"""What a report computes of a study once, for its tables, figures and answer."""

from dataclasses import dataclass, field
from functools import cached_property

import pandas as pd

from calfsocket.report.changes import relative_changes
from calfsocket.report.damage import DamageThresholds, damage
from calfsocket.report.variants import BASE, variants
from calfsocket.simulation.results import Results


@dataclass(frozen=True, eq=False)
class Findings:
    """A study's results and what follows from them."""

    study: Results
    thresholds: DamageThresholds = field(default_factory=DamageThresholds)

    @cached_property
    def results(self) -> Results:
        """The cases that are shown one by one: those of the base, where a study has variants."""
        return variants(self.study).get(BASE, self.study)

    @cached_property
    def changes(self) -> pd.DataFrame:
        """Relative changes from the Separate to the Combined set."""
        return relative_changes(self.results)

    @cached_property
    def damage(self) -> pd.DataFrame:
        """Strains against the damage thresholds."""
        return damage(self.results, self.thresholds)
