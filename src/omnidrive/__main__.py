"""``python -m omnidrive`` is the command ``omnidrive``."""

import os
import sys

from omnidrive_command import main

_PLACE = os.path.dirname(os.path.dirname(__file__))

# `python -m` puts the working folder first, where modules may replace those of Python
if not sys.flags.safe_path and sys.path[0] in {"", os.getcwd()} and os.getcwd() != _PLACE:
    del sys.path[0]

main()
