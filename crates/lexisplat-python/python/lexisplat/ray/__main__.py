"""``python -m lexisplat.ray`` is the command ``lexisplat-ray``."""

import sys

from ._command import main

if __name__ == "__main__":
    sys.exit(main())
