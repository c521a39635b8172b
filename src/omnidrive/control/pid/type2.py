"""Interval type-2 inference: as type-1, but every set is uncertain within a footprint."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.compiled import compiled
from omnidrive.control.pid.centroid import cut_union
from omnidrive.control.pid.firing import memberships, strongest, summed
from omnidrive.control.pid.sets import INPUT_SETS, OUTPUT_SETS, Footprint, lagged, sampled
from omnidrive.control.pid.type1 import SAMPLES, GainChange
from omnidrive.control.pid.type_reduction import karnik_mendel, set_centroids

Array = np.ndarray


class CentreOfSetsType2(NamedTuple):
    """Interval type-2 inference (min), reduced by centre of sets."""

    rules: Int[Array, "7 7 3"]
    input_sets: Float[Array, "7 3"]
    lower_input_sets: Float[Array, "7 3"]
    lower_scale: float
    centroids: Float[Array, "2 7"]
    """Least and greatest centroid of each output set; both rows ascend."""

    @staticmethod
    def of(rules: Int[Array, "7 7 3"], inputs: Footprint, outputs: Footprint) -> CentreOfSetsType2:
        """System of the paper's sets under the given rules and footprints."""
        centroids = np.ascontiguousarray(set_centroids(OUTPUT_SETS, outputs).T)
        lower = lagged(INPUT_SETS, inputs)
        return CentreOfSetsType2(rules, INPUT_SETS, lower, inputs.scale, centroids)


class CentroidType2(NamedTuple):
    """Interval type-2 inference (min, max), reduced by the centroid of the sampled conclusion."""

    rules: Int[Array, "7 7 3"]
    input_sets: Float[Array, "7 3"]
    lower_input_sets: Float[Array, "7 3"]
    lower_scale: float
    at: Float[Array, " samples"]
    lower_degrees: Float[Array, "7 samples"]
    upper_degrees: Float[Array, "7 samples"]

    @staticmethod
    def of(rules: Int[Array, "7 7 3"], inputs: Footprint, outputs: Footprint) -> CentroidType2:
        """System of the paper's sets under the given rules and footprints."""
        return CentroidType2(
            rules,
            INPUT_SETS,
            lagged(INPUT_SETS, inputs),
            inputs.scale,
            SAMPLES,
            sampled(lagged(OUTPUT_SETS, outputs), SAMPLES, outputs.scale),
            sampled(OUTPUT_SETS, SAMPLES, 1.0),
        )


@compiled
def centre_of_sets_type2(
    system: CentreOfSetsType2, error: float, change: float
) -> tuple[GainChange, GainChange]:
    """Least and greatest changes of the gains for a scaled error and its scaled change.

    Each rule weighs the centroid interval of its consequent with its firing interval (Mendel,
    "Uncertain Rule-Based Fuzzy Systems", 2nd ed. 2017, centre-of-sets type reduction). An input
    outside [-1, 1] fires no rule, and the changes are then the middle of their range, 0.
    """
    lower = summed(
        memberships(error, system.lower_input_sets, system.lower_scale),
        memberships(change, system.lower_input_sets, system.lower_scale),
        system.rules,
    )
    upper = summed(
        memberships(error, system.input_sets, 1.0),
        memberships(change, system.input_sets, 1.0),
        system.rules,
    )
    least, greatest = np.zeros(3), np.zeros(3)
    for gain in range(3):
        if upper[gain].max() > 0.0:
            least[gain] = karnik_mendel(system.centroids[0], lower[gain], upper[gain])[0]
            greatest[gain] = karnik_mendel(system.centroids[1], lower[gain], upper[gain])[1]
    return (least[0], least[1], least[2]), (greatest[0], greatest[1], greatest[2])


@compiled
def centroid_type2(
    system: CentroidType2, error: float, change: float
) -> tuple[GainChange, GainChange]:
    """As :func:`centre_of_sets_type2`, reduced to the centroids of the sampled conclusion.

    The conclusion lies between the union of the lower output sets cut at the lower firing
    strengths and that of the upper ones cut at the upper strengths: Matlab's inference.
    """
    lower = strongest(
        memberships(error, system.lower_input_sets, system.lower_scale),
        memberships(change, system.lower_input_sets, system.lower_scale),
        system.rules,
    )
    upper = strongest(
        memberships(error, system.input_sets, 1.0),
        memberships(change, system.input_sets, 1.0),
        system.rules,
    )
    least, greatest = np.zeros(3), np.zeros(3)
    for gain in range(3):
        degrees = cut_union(upper[gain], system.upper_degrees)
        if degrees.max() > 0.0:
            least[gain], greatest[gain] = karnik_mendel(
                system.at, cut_union(lower[gain], system.lower_degrees), degrees
            )
    return (least[0], least[1], least[2]), (greatest[0], greatest[1], greatest[2])
