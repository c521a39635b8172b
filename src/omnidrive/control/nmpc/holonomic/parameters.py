"""Weights of the holonomic robot's NMPC."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from omnidrive.parameter import Bounds


class HolonomicParameters(NamedTuple):
    """Weights of the optimal control problem."""

    position_weight: Annotated[float, Bounds(0.0, 1e6, "1/m^2")] = 90.0
    """First two diagonal entries of Q."""
    heading_weight: Annotated[float, Bounds(0.0, 1e6, "1/rad^2")] = 40.0
    """Third diagonal entry of Q."""
    velocity_weight: Annotated[float, Bounds(1e-3, 1e4, "s^2/m^2")] = 1.0
    """First two diagonal entries of R."""
    yaw_rate_weight: Annotated[float, Bounds(1e-3, 1e4, "s^2/rad^2")] = 0.3
    """Third diagonal entry of R."""
    terminal_factor: Annotated[float, Bounds(0.0, 1e3, "1")] = 1.0
    """Terminal weight, as a multiple of the infinite-horizon cost to go without limits. With 1 and
    no active limit, the plan is that of an infinite horizon, however short the horizon is."""

    def state_weights(self, points: int, dt: float) -> np.ndarray:
        """Return the diagonals of Q_k for ``points`` states ``dt`` s apart; shape (points, 3).

        The terminal weight P solves the stationary Riccati equation of ``x + dt v``:
        ``P^2 dt^2 - q dt^2 P - q r = 0`` (Rawlings, Mayne & Diehl, 2017, section 1.3.4).
        """
        q = np.array([self.position_weight, self.position_weight, self.heading_weight])
        weights = np.tile(q, (points, 1))
        terminal = 0.5 * (q + np.sqrt(q * q + 4.0 * q * self.control_weights() / (dt * dt)))
        weights[-1] = self.terminal_factor * terminal
        return weights

    def with_gain_limit(self, gain: float, dt: float) -> HolonomicParameters:
        """Return weights of the states whose feedback gain is at most ``gain`` (1/s).

        The gain of an infinite horizon is ``K = P dt / (r + P dt^2)``, hence ``P = K r / (dt - K
        dt^2)``; and ``q = P^2 dt^2 / (P dt^2 + r)`` by the equation of :meth:`state_weights`.
        ``gain`` is less than 1 / ``dt``.
        """
        quadratic = gain / (dt - gain * dt * dt)  # over r
        ratio = quadratic**2 * dt * dt / (quadratic * dt * dt + 1.0)
        return self._replace(
            position_weight=min(self.position_weight, ratio * self.velocity_weight),
            heading_weight=min(self.heading_weight, ratio * self.yaw_rate_weight),
        )

    def control_weights(self) -> np.ndarray:
        """Return the diagonal of R."""
        return np.array([self.velocity_weight, self.velocity_weight, self.yaw_rate_weight])
