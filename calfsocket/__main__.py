"""``python3 -m calfsocket``."""

import gc
import sys

from calfsocket.cli import main

if __name__ == "__main__":
    code = main()
    gc.freeze()  # at the end Python would look for garbage in all that is loaded, for 0.4 s
    sys.exit(code)
