"""Command line: one module per verb, without numerical code."""

from omnidrive.cli.main import main

__all__ = ["main"]
