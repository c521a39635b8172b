"""Environments for reinforcement learning: `gymnasium.make("omnidrive.gym:omnidrive/Tracking-v0")`.

Importing this registers them; it needs the extra `gymnasium`.
"""

from omnidrive.gym.registration import ENVIRONMENT
from omnidrive.gym.tracking import TrackingEnv

__all__ = ["ENVIRONMENT", "TrackingEnv"]
