"""Nonlinear model predictive control: a problem, solvers for it, and the controller around them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
