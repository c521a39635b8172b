"""Visualization of runs: in a window during the simulation, or as a film afterwards."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
