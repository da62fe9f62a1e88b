"""``python -m lexisplat.ray`` is the command ``lexisplat-ray``."""

import sys

from ._command import main

sys.exit(main())
