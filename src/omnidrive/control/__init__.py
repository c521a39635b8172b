"""Controllers: each law a pure function, each controller a thin shell with its memory."""

from omnidrive.control.controller import Command, Controller, Status
from omnidrive.control.feedforward import FeedforwardController, FeedforwardGains

__all__ = ["Command", "Controller", "FeedforwardController", "FeedforwardGains", "Status"]
