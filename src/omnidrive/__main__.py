"""``python -m omnidrive`` is the command ``omnidrive``."""

from omnidrive.cli import main

main()
