"""The fuzzy markup language (FML) of IEEE 1855-2016."""

from omnidrive.fuzzy.files.fml.semantics import read_fml
from omnidrive.fuzzy.files.fml.writer import write_fml

__all__ = ["read_fml", "write_fml"]
