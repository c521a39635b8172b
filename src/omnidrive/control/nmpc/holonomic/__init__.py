"""NMPC of robots that move in any direction, within what their wheels can do."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
