"""The fuzzy control language (FCL) of IEC 61131-7, in the dialects of jFuzzyLogic and fuzzylite."""

from omnidrive.fuzzy.files.fcl.semantics import UnreadBlockWarning, read_fcl
from omnidrive.fuzzy.files.fcl.writer import write_fcl

__all__ = ["UnreadBlockWarning", "read_fcl", "write_fcl"]
