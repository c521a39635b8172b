"""Positions of a system's arrays within the packed arrays, and the workspace of an evaluation."""

from __future__ import annotations

from typing import NamedTuple

from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.compiled.views import unsafe_matrix, unsafe_slice
from omnidrive.fuzzy.antecedents import Antecedents
from omnidrive.fuzzy.centre_of_sets import Centroids
from omnidrive.fuzzy.consequents import Consequents
from omnidrive.fuzzy.packed_arrays import PackedArrays, floats_of, integers_of
from omnidrive.fuzzy.sampled import Samples
from omnidrive.fuzzy.segments import Segments
from omnidrive.fuzzy.sets import FlatSets
from omnidrive.fuzzy.spikes import Spikes


class Header(NamedTuple):
    """Ranges, fallbacks and options of a packed system."""

    ranges: Float[Array, " range_ends"]
    """Low and high of each input."""
    fallbacks: Float[Array, " outputs"]
    """Value of each output if no rule fires."""
    levels: Float[Array, " 1"]
    """Weight of this z-slice in a system of type 3; 1 otherwise."""
    options: Int[Array, " 6"]
    """Integers at the positions :data:`METHOD` and its successors.

    Method of defuzzification, whether the system is uncertain, algorithm of type reduction, policy
    for inputs out of range, policy if no rule fires, columns of :attr:`Workspace.points`."""


class Workspace(NamedTuple):
    """Intermediate results of one evaluation: lower values in row 0, upper values in row 1."""

    degrees: Float[Array, "2 degrees"]
    """Degrees of the sets, then of the nodes of the antecedents."""
    strengths: Float[Array, "2 rules"]
    """Firing strengths of the rules."""
    heights: Float[Array, "2 consequents"]
    """Aggregated firing strengths of the consequents."""
    points: Float[Array, "2 points"]
    """Weights of the samples, or of the centroids, of one output."""


RANGES, FALLBACKS, LEVELS, OPTIONS = range(4)
_SETS = len(Header._fields)
_ANTECEDENTS = _SETS + len(FlatSets._fields)
_CONSEQUENTS = _ANTECEDENTS + len(Antecedents._fields)
_SPIKES = _CONSEQUENTS + len(Consequents._fields)
METHOD_ARRAYS = _SPIKES + len(Spikes._fields)
"""Number of the first array that belongs to the method of defuzzification."""
LOWER_SEGMENTS = METHOD_ARRAYS + len(Segments._fields)
TRAPEZOIDS = LOWER_SEGMENTS + len(Segments._fields)

METHOD, UNCERTAIN, ALGORITHM, INPUT_POLICY, NO_RULE_POLICY, POINT_COUNT = range(6)
"""Positions within :attr:`Header.options`."""


def arrays_of(
    header: Header,
    sets: FlatSets,
    antecedents: Antecedents,
    consequents: Consequents,
    spikes: Spikes,
    *method_arrays: tuple[Array, ...],
) -> list[Array]:
    """Return the arrays of a system in the order in which the kernels read them."""
    return [
        *header,
        *sets,
        *antecedents,
        *consequents,
        *spikes,
        *(a for each in method_arrays for a in each),
    ]


@compiled
def sets_in(p: PackedArrays) -> FlatSets:
    """Return the sets of a packed system."""
    return FlatSets(
        integers_of(p, _SETS),
        integers_of(p, _SETS + 1),
        floats_of(p, _SETS + 2),
        floats_of(p, _SETS + 3),
        integers_of(p, _SETS + 4),
        floats_of(p, _SETS + 5),
    )


@compiled
def antecedents_in(p: PackedArrays) -> Antecedents:
    """Return the antecedents of a packed system."""
    return Antecedents(
        integers_of(p, _ANTECEDENTS),
        integers_of(p, _ANTECEDENTS + 1),
        integers_of(p, _ANTECEDENTS + 2),
        integers_of(p, _ANTECEDENTS + 3),
        floats_of(p, _ANTECEDENTS + 4),
        integers_of(p, _ANTECEDENTS + 5),
    )


@compiled
def consequents_in(p: PackedArrays) -> Consequents:
    """Return the consequents of a packed system."""
    return Consequents(
        integers_of(p, _CONSEQUENTS),
        integers_of(p, _CONSEQUENTS + 1),
        integers_of(p, _CONSEQUENTS + 2),
        integers_of(p, _CONSEQUENTS + 3),
        integers_of(p, _CONSEQUENTS + 4),
    )


@compiled
def spikes_in(p: PackedArrays) -> Spikes:
    """Return the isolated points of the outputs of a packed system."""
    return Spikes(floats_of(p, _SPIKES), floats_of(p, _SPIKES + 1), integers_of(p, _SPIKES + 2))


@compiled
def samples_in(p: PackedArrays) -> Samples:
    """Return the samples of the outputs of a packed system."""
    return Samples(floats_of(p, METHOD_ARRAYS), floats_of(p, METHOD_ARRAYS + 1))


@compiled
def segments_in(p: PackedArrays, begin: int) -> Segments:
    """Return the segments of the outputs of a packed system, upper or lower ones."""
    return Segments(
        integers_of(p, begin),
        floats_of(p, begin + 1),
        integers_of(p, begin + 2),
        integers_of(p, begin + 3),
        floats_of(p, begin + 4),
    )


@compiled
def centroids_in(p: PackedArrays) -> Centroids:
    """Return the centroids of the consequents of a packed system."""
    return Centroids(
        floats_of(p, METHOD_ARRAYS),
        integers_of(p, METHOD_ARRAYS + 1),
        floats_of(p, METHOD_ARRAYS + 2),
        integers_of(p, METHOD_ARRAYS + 3),
    )


@compiled
def _sizes(p: PackedArrays) -> tuple[int, int, int, int]:
    """Return the number of columns of each array of :class:`Workspace`."""
    sets, nodes = len(integers_of(p, _SETS + 4)), len(integers_of(p, _ANTECEDENTS + 3))
    rules, consequents = len(floats_of(p, _ANTECEDENTS + 4)), integers_of(p, _CONSEQUENTS + 1)[-1]
    return sets + nodes, rules, consequents, integers_of(p, OPTIONS)[POINT_COUNT]


@compiled
def workspace_size(p: PackedArrays) -> int:
    """Return the number of floats that :func:`workspace_in` needs."""
    degrees, rules, consequents, points = _sizes(p)
    return 2 * (degrees + rules + consequents + points)


@compiled
def workspace_in(p: PackedArrays, buffer: Float[Array, " floats"]) -> Workspace:
    """Return a workspace within ``buffer``, which the caller must keep alive."""
    degrees, rules, consequents, points = _sizes(p)
    return Workspace(
        unsafe_matrix(buffer, 0, 2, degrees),
        unsafe_matrix(buffer, 2 * degrees, 2, rules),
        unsafe_matrix(buffer, 2 * (degrees + rules), 2, consequents),
        unsafe_matrix(buffer, 2 * (degrees + rules + consequents), 2, points),
    )


@compiled
def arguments_in(
    p: PackedArrays, buffer: Float[Array, " floats"], inputs: int, outputs: int
) -> tuple[Float[Array, " inputs"], Float[Array, "3 outputs"]]:
    """Return views for inputs and results within ``buffer``, behind the workspace."""
    begin = workspace_size(p)
    return unsafe_slice(buffer, begin, begin + inputs), unsafe_matrix(
        buffer, begin + inputs, 3, outputs
    )
