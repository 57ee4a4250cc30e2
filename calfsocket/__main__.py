"""``python3 -m calfsocket``."""

import gc
import sys

gc.set_threshold(100_000)  # imports make much and no garbage: an eighth of their time

from calfsocket.cli import main  # noqa: E402

if __name__ == "__main__":
    sys.exit(main())
