"""Checks of users' controllers, plants and state estimators against the laws of their interfaces.

They are plain functions for use in tests: each raises AssertionError with one line for every law
that is broken, and returns nothing if all hold.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
