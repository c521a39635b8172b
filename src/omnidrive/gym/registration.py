"""What gymnasium knows of omnidrive."""

from __future__ import annotations

from omnidrive.errors import MissingExtra

try:
    import gymnasium
except ModuleNotFoundError:
    raise MissingExtra(
        "omnidrive.gym needs the extra gymnasium: pip install 'omnidrive[gymnasium]'"
    ) from None

ENVIRONMENT = "omnidrive/Tracking-v0"
"""The name of :class:`~omnidrive.gym.TrackingEnv`."""

if ENVIRONMENT not in gymnasium.registry:
    gymnasium.register(ENVIRONMENT, entry_point="omnidrive.gym.tracking:TrackingEnv")
