"""Tuning of the parameters of controllers, with its gain on runs that the search has not seen."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
