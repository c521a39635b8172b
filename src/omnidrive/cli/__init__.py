"""The command line: one file per verb, no mathematics."""

from omnidrive.cli.main import main

__all__ = ["main"]
