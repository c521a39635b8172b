"""NMPC of the paper: a unicycle model, limits on the speed and the yaw rate."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
