"""Tune two feedback gains in the gymnasium environment by random search (extra `gymnasium`)."""

import gymnasium
import numpy as np

env = gymnasium.make("omnidrive.gym:omnidrive/Tracking-v0", plant="kinematic", robot="small")
limits = env.get_wrapper_attr("max_twist")


def score(gains: np.ndarray) -> float:
    """Return the total reward of one run with velocity feedforward and proportional feedback."""
    observation, _ = env.reset(seed=1)
    total, done = 0.0, False
    while not done:
        error = observation[:3] * [1.0, 1.0, np.pi]  # m, m, rad, in B
        observation, reward, terminated, truncated, _ = env.step(
            observation[6:9] + error * [gains[0], gains[0], gains[1]] / limits
        )
        total, done = total + float(reward), terminated or truncated
    return total


rng = np.random.default_rng(1)
best = np.zeros(2)
initial = highest = score(best)
for _ in range(20):
    trial = np.abs(best + rng.normal(size=2))
    result = score(trial)
    if result > highest:
        best, highest = trial, result
print(f"reward {initial:.4f} without feedback, {highest:.4f} with gains {best.round(2)} 1/s")
