"""How strongly each rule fires, gathered by the set that it calls for."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from omnidrive.compiled import compiled
from omnidrive.control.pid.sets import membership

Array = np.ndarray


@compiled
def memberships(x: float, sets: Float[Array, "sets 3"], scale: float) -> Float[Array, " sets"]:
    """Degree to which ``x`` belongs to each set, times ``scale``."""
    degrees = np.empty(len(sets))
    for k in range(len(sets)):
        degrees[k] = scale * membership(x, sets[k, 0], sets[k, 1], sets[k, 2])
    return degrees


@compiled
def strongest(
    of_error: Float[Array, " sets"],
    of_change: Float[Array, " sets"],
    rules: Int[Array, "sets sets gains"],
) -> Float[Array, "gains sets"]:
    """Height at which each output set is cut: the strongest rule that calls for it.

    Max-min composition (Mamdani & Assilian 1975): a rule fires at the lesser of its memberships.
    """
    heights = np.zeros((rules.shape[2], len(of_error)))
    for i in range(len(of_error)):
        for j in range(len(of_change)):
            strength = min(of_error[i], of_change[j])
            if strength > 0.0:
                for gain in range(rules.shape[2]):
                    k = rules[i, j, gain]
                    heights[gain, k] = max(heights[gain, k], strength)
    return heights


@compiled
def summed(
    of_error: Float[Array, " sets"],
    of_change: Float[Array, " sets"],
    rules: Int[Array, "sets sets gains"],
) -> Float[Array, "gains sets"]:
    """Weight of each output set: the sum over the rules that call for it.

    Rules with one consequent have one centroid, so a weighted mean over rules may add up their
    weights first.
    """
    weights = np.zeros((rules.shape[2], len(of_error)))
    for i in range(len(of_error)):
        for j in range(len(of_change)):
            strength = min(of_error[i], of_change[j])
            if strength > 0.0:
                for gain in range(rules.shape[2]):
                    weights[gain, rules[i, j, gain]] += strength
    return weights
