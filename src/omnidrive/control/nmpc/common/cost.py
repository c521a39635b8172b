"""Quadratic tracking cost."""

from __future__ import annotations

from collections.abc import Sequence

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled


@compiled
def tracking_cost(  # noqa: PLR0917
    states: Float[Array, "points 3"],
    targets: Float[Array, "points 3"],
    state_weights: Float[Array, "points 3"],
    controls: Float[Array, "stages controls"],
    feedforward: Float[Array, "stages controls"],
    control_weights: Float[Array, " controls"] | Sequence[float],
) -> float:
    """Return ``sum |x_k - xref_k|^2_{Q_k} + sum |u_k - uref_k|^2_R``; all weights are diagonal."""
    total = 0.0
    for k in range(len(states)):
        for i in range(3):
            total += state_weights[k, i] * (states[k, i] - targets[k, i]) ** 2
    for k in range(len(controls)):
        for i in range(controls.shape[1]):
            total += control_weights[i] * (controls[k, i] - feedforward[k, i]) ** 2
    return total
