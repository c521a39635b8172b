"""Functions of :mod:`omnidrive.geometry.planar` that kernels can call, too.

They are the same functions; geometry itself does not import the compiler, which takes long.
"""

from omnidrive.compiled import compilable
from omnidrive.geometry.planar import move, to_body, to_world, twist_between, wrap

__all__ = ["move", "to_body", "to_world", "twist_between", "wrap"]

for _function in (wrap, to_body, to_world, move, twist_between):
    compilable(_function)
