"""Controllers: each law a pure function, each controller a thin shell with its memory."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
