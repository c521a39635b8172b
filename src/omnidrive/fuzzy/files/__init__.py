"""Files of fuzzy systems: Matlab's .fis, fuzzylite's .fll, FCL (IEC 61131-7), FML (IEEE 1855)."""

from omnidrive.fuzzy.files.fcl import UnreadBlockWarning
from omnidrive.fuzzy.files.format import GapWarning, SigmaWarning, load, save

__all__ = ["GapWarning", "SigmaWarning", "UnreadBlockWarning", "load", "save"]
