"""Type-1 inference: from an error and its change to the changes of the gains kp, ki and kd."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.compiled import compiled
from omnidrive.control.pid.centroid import cut_union, exact_centroid, sampled_centroid
from omnidrive.control.pid.firing import memberships, strongest
from omnidrive.control.pid.sets import INPUT_SETS, OUTPUT_SETS, sampled

Array = np.ndarray

GainChange = tuple[float, float, float]
"""Changes of kp, ki and kd that a fuzzy system calls for, each in the range of its output sets."""

SAMPLES = np.linspace(OUTPUT_SETS[0, 0], OUTPUT_SETS[-1, 2], 101)
"""Where Matlab samples an output."""


class ExactType1(NamedTuple):
    """Mamdani inference (min, max) with the exact centroid."""

    rules: Int[Array, "7 7 3"]
    input_sets: Float[Array, "7 3"]
    output_sets: Float[Array, "7 3"]

    @staticmethod
    def of(rules: Int[Array, "7 7 3"]) -> ExactType1:
        """System of the paper's sets under the given rules."""
        return ExactType1(rules, INPUT_SETS, OUTPUT_SETS)


class SampledType1(NamedTuple):
    """Mamdani inference (min, max) with Matlab's centroid."""

    rules: Int[Array, "7 7 3"]
    input_sets: Float[Array, "7 3"]
    at: Float[Array, " samples"]
    degrees: Float[Array, "7 samples"]

    @staticmethod
    def of(rules: Int[Array, "7 7 3"]) -> SampledType1:
        """System of the paper's sets under the given rules."""
        return SampledType1(rules, INPUT_SETS, SAMPLES, sampled(OUTPUT_SETS, SAMPLES, 1.0))


@compiled
def exact_type1(system: ExactType1, error: float, change: float) -> GainChange:
    """Changes of the gains for a scaled error and its scaled change.

    An input outside [-1, 1] fires no rule, and the changes are then the middle of their range, 0.
    """
    heights = strongest(
        memberships(error, system.input_sets, 1.0),
        memberships(change, system.input_sets, 1.0),
        system.rules,
    )
    return (
        exact_centroid(heights[0], system.output_sets),
        exact_centroid(heights[1], system.output_sets),
        exact_centroid(heights[2], system.output_sets),
    )


@compiled
def sampled_type1(system: SampledType1, error: float, change: float) -> GainChange:
    """As :func:`exact_type1`, up to 1.5e-3 away from it: Matlab's numbers."""
    heights = strongest(
        memberships(error, system.input_sets, 1.0),
        memberships(change, system.input_sets, 1.0),
        system.rules,
    )
    return (
        sampled_centroid(system.at, cut_union(heights[0], system.degrees)),
        sampled_centroid(system.at, cut_union(heights[1], system.degrees)),
        sampled_centroid(system.at, cut_union(heights[2], system.degrees)),
    )
