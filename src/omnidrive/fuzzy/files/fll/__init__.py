"""The fuzzylite language (FLL) of fuzzylite 5 to 8."""

from omnidrive.fuzzy.files.fll.semantics import read_fll
from omnidrive.fuzzy.files.fll.writer import write_fll

__all__ = ["read_fll", "write_fll"]
