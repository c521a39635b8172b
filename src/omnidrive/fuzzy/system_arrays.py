"""Positions of a system's arrays within the packed arrays, and the workspace of an evaluation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.compiled.views import unsafe_matrix, unsafe_slice
from omnidrive.fuzzy.antecedents import Antecedents
from omnidrive.fuzzy.centre_of_sets import Centroids
from omnidrive.fuzzy.consequents import Consequents
from omnidrive.fuzzy.packed_arrays import PackedArrays, floats_of, integers_of
from omnidrive.fuzzy.sampled import Samples
from omnidrive.fuzzy.segments import Segments
from omnidrive.fuzzy.sets import FlatSets
from omnidrive.fuzzy.spikes import Spikes
from omnidrive.fuzzy.sugeno import FlatFunctions
from omnidrive.fuzzy.trapezoid_centroid import Trapezoids


class Options(NamedTuple):
    """How a system is evaluated, as integers."""

    method: int
    """Method of defuzzification."""
    uncertain: int
    """Whether the degrees have a lower and an upper bound: 1 in a type-2 or type-3 system, or 0."""
    algorithm: int
    """Algorithm of type reduction, index in :data:`~omnidrive.choices.ALGORITHMS`."""
    out_of_range: int
    """Policy for inputs out of range."""
    no_rule: int
    """Policy if no rule fires."""
    points: int
    """Columns of :attr:`Workspace.points`."""


class Header(NamedTuple):
    """Ranges, fallbacks and options of a packed system."""

    ranges: Float[Array, " range_ends"]
    """Low and high of each input."""
    fallbacks: Float[Array, " outputs"]
    """Value of each output if no rule fires."""
    level: float
    """Weight of this z-slice in a system of type 3; 1 otherwise."""
    options: Options


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


_SETS = len(Header._fields)
_ANTECEDENTS = _SETS + len(FlatSets._fields)
_CONSEQUENTS = _ANTECEDENTS + len(Antecedents._fields)
_SPIKES = _CONSEQUENTS + len(Consequents._fields)
_METHOD = _SPIKES + len(Spikes._fields)  # of the arrays that belong to the method
_LOWER_SEGMENTS = _METHOD + len(Segments._fields)
_TRAPEZOIDS = _LOWER_SEGMENTS + len(Segments._fields)


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
        header.ranges,
        header.fallbacks,
        np.array([header.level]),
        np.array(header.options),
        *sets,
        *antecedents,
        *consequents,
        *spikes,
        *(a for each in method_arrays for a in each),
    ]


@inlined
def header_in(p: PackedArrays) -> Header:
    """Return ranges, fallbacks and options of a packed system."""
    o = integers_of(p, 3)
    options = Options(o[0], o[1], o[2], o[3], o[4], o[5])
    return Header(floats_of(p, 0), floats_of(p, 1), floats_of(p, 2)[0], options)


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
    return Samples(floats_of(p, _METHOD), floats_of(p, _METHOD + 1))


@compiled
def segments_in(p: PackedArrays, of_lower: bool) -> Segments:
    """Return the segments of the outputs of a packed system, upper or lower ones."""
    begin = _LOWER_SEGMENTS if of_lower else _METHOD
    return Segments(
        integers_of(p, begin),
        floats_of(p, begin + 1),
        integers_of(p, begin + 2),
        integers_of(p, begin + 3),
        floats_of(p, begin + 4),
    )


@compiled
def trapezoids_in(p: PackedArrays) -> Trapezoids:
    """Return the trapezoids of the outputs of a packed system."""
    return Trapezoids(integers_of(p, _TRAPEZOIDS), floats_of(p, _TRAPEZOIDS + 1))


@compiled
def functions_in(p: PackedArrays) -> FlatFunctions:
    """Return the linear functions of the consequents of a packed system."""
    return FlatFunctions(floats_of(p, _METHOD))


@compiled
def centroids_in(p: PackedArrays) -> Centroids:
    """Return the centroids of the consequents of a packed system."""
    return Centroids(
        floats_of(p, _METHOD),
        integers_of(p, _METHOD + 1),
        floats_of(p, _METHOD + 2),
        integers_of(p, _METHOD + 3),
    )


@compiled
def _sizes(p: PackedArrays) -> tuple[int, int, int, int]:
    """Return the number of columns of each array of :class:`Workspace`."""
    sets, nodes = len(integers_of(p, _SETS + 4)), len(integers_of(p, _ANTECEDENTS + 3))
    rules, consequents = len(floats_of(p, _ANTECEDENTS + 4)), integers_of(p, _CONSEQUENTS + 1)[-1]
    return sets + nodes, rules, consequents, header_in(p).options.points


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
