"""What a robot's sensors tell of the truth, and what a controller sees of it."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
