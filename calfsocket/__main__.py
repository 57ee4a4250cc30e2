"""``python3 -m calfsocket``."""

import sys

from calfsocket.cli import main

if __name__ == "__main__":
    sys.exit(main())
