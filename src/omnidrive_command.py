"""Entry point of the command `omnidrive`.

It stands outside the package, whose import takes a second in which Ctrl-C should end quietly.
"""

import sys
from importlib import import_module


def main() -> None:
    """Import the command line and run it."""
    try:
        cli = import_module("omnidrive.cli")
    except KeyboardInterrupt:
        sys.exit(130)
    cli.main()
