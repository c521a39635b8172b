"""Where each array of a packed system stands, and what room its evaluation needs."""

from __future__ import annotations

from typing import NamedTuple

from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.fuzzy.antecedents import Antecedents
from omnidrive.fuzzy.centre_of_sets import Centres
from omnidrive.fuzzy.consequents import Consequents
from omnidrive.fuzzy.packed_arrays import Packed, integers_of, numbers_of
from omnidrive.fuzzy.sampled import Samples
from omnidrive.fuzzy.segments import Lines
from omnidrive.fuzzy.sets import Sets
from omnidrive.fuzzy.unsafe_views import part, table


class Frame(NamedTuple):
    """What surrounds the inference proper."""

    ranges: Float[Array, " range_ends"]
    """Low and high of each input."""
    fallbacks: Float[Array, " outputs"]
    """Value of each output where no rule fires."""
    levels: Float[Array, " 1"]
    """Weight of this plane in a system of type 3; 1 otherwise."""
    switches: Int[Array, " 6"]
    """How conclusions are found, whether the system is uncertain, the algorithm of type reduction,
    what happens to inputs out of range, where no rule fires, and :attr:`Room.points`' length."""


class Room(NamedTuple):
    """Where a system notes what it finds on the way: lower values, then upper ones."""

    degrees: Float[Array, "2 degrees"]
    """Of sets and of nodes."""
    strengths: Float[Array, "2 rules"]
    heights: Float[Array, "2 shapes"]
    """Strength with which each shape is concluded."""
    points: Float[Array, "2 points"]
    """Weights of the samples, or of the centroids, of one output."""


RANGES, FALLBACKS, LEVELS, SWITCHES = range(4)
_SETS, _CONDITIONS, _CONCLUSIONS, REST = 4, 10, 16, 21
"""Where the arrays of :class:`Frame`, :class:`Sets` and so on stand in a packed system."""

HOW, UNCERTAIN, ALGORITHM, BEYOND, SILENT, POINTS = range(6)
"""The switches, in their order."""


def parts(
    frame: Frame,
    sets: Sets,
    antecedents: Antecedents,
    consequents: Consequents,
    *rest: tuple[Array, ...],
) -> list[Array]:
    """The arrays of a system in the order in which the kernels unpack them."""
    return [*frame, *sets, *antecedents, *consequents, *(a for each in rest for a in each)]


@compiled
def sets_in(p: Packed) -> Sets:
    """The sets of a packed system."""
    return Sets(
        integers_of(p, _SETS),
        integers_of(p, _SETS + 1),
        numbers_of(p, _SETS + 2),
        numbers_of(p, _SETS + 3),
        integers_of(p, _SETS + 4),
        numbers_of(p, _SETS + 5),
    )


@compiled
def antecedents_in(p: Packed) -> Antecedents:
    """The conditions of its rules."""
    return Antecedents(
        integers_of(p, _CONDITIONS),
        integers_of(p, _CONDITIONS + 1),
        integers_of(p, _CONDITIONS + 2),
        integers_of(p, _CONDITIONS + 3),
        numbers_of(p, _CONDITIONS + 4),
        integers_of(p, _CONDITIONS + 5),
    )


@compiled
def consequents_in(p: Packed) -> Consequents:
    """Their conclusions."""
    return Consequents(
        integers_of(p, _CONCLUSIONS),
        integers_of(p, _CONCLUSIONS + 1),
        integers_of(p, _CONCLUSIONS + 2),
        integers_of(p, _CONCLUSIONS + 3),
        integers_of(p, _CONCLUSIONS + 4),
    )


@compiled
def samples_in(p: Packed) -> Samples:
    """Its outputs, on samples."""
    return Samples(numbers_of(p, REST), numbers_of(p, REST + 1))


@compiled
def lines_in(p: Packed, begin: int) -> Lines:
    """Its outputs, cut into lines; there may be two such, for upper and lower functions."""
    return Lines(
        integers_of(p, begin),
        numbers_of(p, begin + 1),
        integers_of(p, begin + 2),
        integers_of(p, begin + 3),
        numbers_of(p, begin + 4),
    )


@compiled
def centres_in(p: Packed) -> Centres:
    """The centroids of its conclusions."""
    return Centres(
        numbers_of(p, REST),
        integers_of(p, REST + 1),
        numbers_of(p, REST + 2),
        integers_of(p, REST + 3),
    )


@compiled
def _sizes(p: Packed) -> tuple[int, int, int, int]:
    """Columns of the tables of :class:`Room`."""
    sets, nodes = len(integers_of(p, _SETS + 4)), len(integers_of(p, _CONDITIONS + 3))
    rules, shapes = len(numbers_of(p, _CONDITIONS + 4)), integers_of(p, _CONCLUSIONS + 1)[-1]
    return sets + nodes, rules, shapes, integers_of(p, SWITCHES)[POINTS]


@compiled
def room_size(p: Packed) -> int:
    """How many numbers :func:`room_in` needs."""
    degrees, rules, shapes, points = _sizes(p)
    return 2 * (degrees + rules + shapes + points)


@compiled
def room_in(p: Packed, space: Float[Array, " numbers"]) -> Room:
    """Room for one evaluation of a system at a time; the caller must keep ``space``."""
    degrees, rules, shapes, points = _sizes(p)
    return Room(
        table(space, 0, 2, degrees),
        table(space, 2 * degrees, 2, rules),
        table(space, 2 * (degrees + rules), 2, shapes),
        table(space, 2 * (degrees + rules + shapes), 2, points),
    )


@compiled
def ends_in(
    p: Packed, space: Float[Array, " numbers"], inputs: int, outputs: int
) -> tuple[Float[Array, " inputs"], Float[Array, "3 outputs"]]:
    """Place for inputs and for outputs in ``space``, after what :func:`room_in` takes."""
    begin = room_size(p)
    return part(space, begin, begin + inputs), table(space, begin + inputs, 3, outputs)
