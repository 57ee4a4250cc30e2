"""docs/reliability.md tells what the tests' tables give now."""

import reliability


def test_the_page_is_that_of_the_tables():
    """Else: `python3 tests/reliability.py` makes it again."""
    assert reliability.PAGE.read_text(encoding="utf-8") == reliability.page()
