"""docs/reliability.md has a row for every trial; each trial's own test compares what it gives."""

import re

import reliability


def test_the_page_has_the_rows_of_the_tables():
    """Else: `python3 tests/reliability.py` makes it again."""
    text = reliability.PAGE.read_text(encoding="utf-8")
    without_lines = re.sub(r"\| `` .* `` \|$", "| ``  `` |", text, flags=re.MULTILINE)
    assert without_lines == reliability.page(lambda subject, trial: "")
