"""Robots in a graph of ROS 2: simulated ones, and drives along paths and to goals."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
