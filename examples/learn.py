"""Learn to track in the gymnasium environment: two gains, found by trying (extra `gymnasium`)."""

import gymnasium
import numpy as np

env = gymnasium.make("omnidrive.gym:omnidrive/Tracking-v0", plant="kinematic", robot="small")
limits = env.get_wrapper_attr("max_twist")


def score(gains: np.ndarray) -> float:
    """Sum of rewards of one run that follows the reference's twist and corrects errors."""
    seen, _ = env.reset(seed=1)
    total, over = 0.0, False
    while not over:
        error = seen[:3] * [1.0, 1.0, np.pi]  # m, m, rad, in the robot's frame
        seen, reward, lost, ended, _ = env.step(
            seen[6:9] + error * [gains[0], gains[0], gains[1]] / limits
        )
        total, over = total + float(reward), lost or ended
    return total


rng = np.random.default_rng(1)
best = np.zeros(2)
before = most = score(best)
for _ in range(20):
    trial = np.abs(best + rng.normal(size=2))
    result = score(trial)
    if result > most:
        best, most = trial, result
print(f"reward {before:.4f} without feedback, {most:.4f} with gains {best.round(2)} 1/s")
