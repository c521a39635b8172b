"""Functions of :mod:`omnidrive.geometry.planar` that kernels can call, too.

They are the same functions; geometry itself does not import the compiler, which takes long.
"""

from omnidrive.compiled import compilable, inlined
from omnidrive.geometry.planar import move, to_body, to_world, twist_between, wrap

__all__ = ["move", "to_body", "to_world", "twist_between", "wrap", "wrap_angle"]

for _function in (wrap, to_body, to_world, move, twist_between):
    compilable(_function)

wrap_angle = inlined(wrap)
"""The function :func:`wrap` as a kernel that is inlined into its callers."""
