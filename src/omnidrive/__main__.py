"""``python -m omnidrive`` is the command ``omnidrive``."""

from omnidrive_command import main

main()
