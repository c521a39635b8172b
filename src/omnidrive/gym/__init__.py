"""Environments for reinforcement learning: `gymnasium.make("omnidrive.gym:omnidrive/Tracking-v0")`.

Importing this package registers them; it needs the extra `gymnasium`.
"""

from omnidrive.errors import MissingExtra

try:
    import gymnasium
except ModuleNotFoundError:
    raise MissingExtra(
        "omnidrive.gym needs gymnasium, which is not installed: pip install gymnasium"
    ) from None

from omnidrive.gym.tracking import TrackingEnv

__all__ = ["ENVIRONMENT", "TrackingEnv"]

ENVIRONMENT = "omnidrive/Tracking-v0"
"""Name of :class:`~omnidrive.gym.TrackingEnv` in gymnasium's registry."""

if ENVIRONMENT not in gymnasium.registry:
    gymnasium.register(ENVIRONMENT, entry_point="omnidrive.gym.tracking:TrackingEnv")
