"""Matlab's ``.fis`` files: Mamdani and Sugeno systems of type 1 and interval type 2."""

from omnidrive.fuzzy.files.fis.semantics import read_fis
from omnidrive.fuzzy.files.fis.writer import write_fis

__all__ = ["read_fis", "write_fis"]
