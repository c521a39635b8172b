"""Lookup surface of a fuzzy system: multilinear interpolation with a measured error."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.inference import Inference

MAX_NODES = 5_000_000
"""Greatest number of grid nodes of a surface."""


class Deviation(NamedTuple):
    """Greatest difference found between a surface and its fuzzy system."""

    size: float
    """In the unit of the output."""
    output: str
    """Name of the output."""
    at: tuple[float, ...]
    """The inputs at which the difference was found."""


class LookupSurface:
    """Outputs of a fuzzy system by multilinear interpolation between the nodes of a grid.

    The error is measured at construction: at the centre of every cell, where linear interpolation
    of a smooth function has its greatest error, and at random points.

    Args:
        inference: The system; inputs beyond their ranges are clamped.
        nodes: Number of nodes along each input.
        rng: Generator of the random points; None: the same points every time.

    Attributes:
        errors: Greatest difference found for each output.

    Raises:
        InvalidInput: There are too many nodes, or fewer than two along an input.
    """

    def __init__(
        self, inference: Inference, *, nodes: int = 201, rng: np.random.Generator | None = None
    ) -> None:
        inputs = inference.system.inputs
        if nodes < 2 or nodes ** len(inputs) > MAX_NODES:
            raise InvalidInput(
                f"a surface of {len(inputs)} inputs needs 2 to "
                f"{int(MAX_NODES ** (1 / len(inputs)))} nodes along each, got {nodes}"
            )
        self.inference = inference
        self._low = np.array([variable.low for variable in inputs])
        self._high = np.array([variable.high for variable in inputs])
        self._step = np.array([(v.high - v.low) / (nodes - 1) for v in inputs])
        self._nodes = np.full(len(inputs), nodes)
        self._table = inference.batch(self._grid(np.zeros(1), nodes))[0]
        random = (rng or np.random.default_rng(0)).random((100_000, len(inputs)))
        points = np.concatenate(
            [
                self._grid(np.array([0.5]), nodes - 1),
                np.minimum(self._low + random * self._step * (nodes - 1), self._high),
            ]
        )
        self.errors = self._measured(points)

    def __call__(self, *inputs: float) -> Float[Array, " outputs"]:
        """Return the value of every output for one number per input.

        Raises:
            InvalidInput: An input is missing or not finite.
        """
        results: Array = self.batch(np.array([inputs], dtype=np.float64))[0]
        return results

    def batch(self, rows: Float[Array, "rows inputs"]) -> Float[Array, "rows outputs"]:
        """Return the value of every output for each row of inputs.

        Raises:
            InvalidInput: An input is missing or not finite.
        """
        rows = np.ascontiguousarray(rows, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != len(self._low):
            raise InvalidInput(f"needs {len(self._low)} inputs, got shape {rows.shape}")
        if not np.isfinite(rows).all():
            raise InvalidInput("every input must be finite")
        results: Array = interpolate(self._table, self._low, self._step, self._nodes, rows)
        return results

    def _grid(self, shift: Float[Array, " 1"], count: int) -> Float[Array, "points inputs"]:
        """Return grid points ``shift`` steps from the lower ends, with the step of the surface."""
        axes = [
            a + h * (np.arange(count) + shift) for a, h in zip(self._low, self._step, strict=True)
        ]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
        within: Array = np.minimum(points, self._high)  # rounding may exceed the upper end
        return within

    def _measured(self, points: Float[Array, "points inputs"]) -> tuple[Deviation, ...]:
        difference = np.abs(self.batch(points) - self.inference.batch(points)[0])
        worst = difference.argmax(axis=0)
        return tuple(
            Deviation(float(difference[k, o]), output.name, tuple(points[k].tolist()))
            for o, (k, output) in enumerate(
                zip(worst.tolist(), self.inference.system.outputs, strict=True)
            )
        )


@compiled
def interpolate(
    table: Float[Array, "nodes outputs"],
    low: Float[Array, " inputs"],
    step: Float[Array, " inputs"],
    nodes: Int[Array, " inputs"],
    rows: Float[Array, "rows inputs"],
) -> Float[Array, "rows outputs"]:
    """Return the multilinear interpolation between the corners of the cell of each row."""
    inputs, outputs = rows.shape[1], table.shape[1]
    results = np.zeros((len(rows), outputs))
    cell, fraction = np.empty(inputs, dtype=np.int64), np.empty(inputs)
    for r in range(len(rows)):
        for i in range(inputs):
            at = min(max((rows[r, i] - low[i]) / step[i], 0.0), nodes[i] - 1.0)
            cell[i] = min(int(at), nodes[i] - 2)
            fraction[i] = at - cell[i]
        for corner in range(1 << inputs):
            node, weight = 0, 1.0
            for i in range(inputs):
                beyond = (corner >> i) & 1
                node = node * nodes[i] + cell[i] + beyond
                weight *= fraction[i] if beyond else 1.0 - fraction[i]
            for o in range(outputs):
                results[r, o] += weight * table[node, o]
    return results
