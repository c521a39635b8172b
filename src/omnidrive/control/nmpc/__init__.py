"""Nonlinear model predictive control: a problem, solvers for it, and the controller around them."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
