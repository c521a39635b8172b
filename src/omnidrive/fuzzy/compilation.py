"""From a fuzzy system and the ways to evaluate it to the arrays that the kernels read."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.antecedents import antecedents_of
from omnidrive.fuzzy.centre_of_sets import centres_of
from omnidrive.fuzzy.consequents import consequents_of
from omnidrive.fuzzy.kernels import (
    AS_IS,
    CENTRE_OF_SETS,
    CLAMP,
    EXACT,
    REFUSE,
    SAMPLED,
    SUGENO,
)
from omnidrive.fuzzy.packed_arrays import Packed, pack
from omnidrive.fuzzy.sampled import samples_of
from omnidrive.fuzzy.segments import lines_of, why_not_exact
from omnidrive.fuzzy.sets import WHOLE, ZSlice, sets_of
from omnidrive.fuzzy.sugeno import functions_of
from omnidrive.fuzzy.system import ALGORITHMS, Algorithm, FuzzySystem
from omnidrive.fuzzy.system_arrays import Frame, parts
from omnidrive.fuzzy.trapezoid_centroid import strips_of

Centroid = Literal["exact", "matlab"]
Reduction = Literal["centroid", "cos"]
OutOfRange = Literal["clamp", "matlab", "raise"]
NoRule = Literal["default", "raise"]

_OUT_OF_RANGE = {"clamp": CLAMP, "matlab": AS_IS, "raise": REFUSE}
_NO_RULE = {"default": CLAMP, "raise": REFUSE}

MAX_SAMPLES, MAX_SLICES = 100_000, 1000


class Options(NamedTuple):
    """How a system is evaluated; see :class:`~omnidrive.fuzzy.inference.Inference`."""

    centroid: Centroid
    samples: int
    reduction: Reduction
    algorithm: Algorithm
    out_of_range: OutOfRange
    no_rule: NoRule
    slices: int


class Compiled(NamedTuple):
    """A system as the kernels read it: one plane, or several of a system of type 3."""

    numbers: Float[Array, " numbers"]
    integers: Int[Array, " integers"]
    planes: Int[Array, "planes 4"]
    """Where the numbers and the integers of each plane begin and end."""


def compile_system(system: FuzzySystem, options: Options) -> Compiled:
    """Arrays of a system.

    Raises:
        InvalidInput: The system cannot be evaluated in this way.
    """
    if options.centroid == "exact" and not system.is_sugeno and (why := why_not_exact(system)):
        raise InvalidInput(f"there is no exact centroid: {why}; ask for centroid matlab")
    if system.type > 1:
        for output in system.outputs:
            if output.defuzzifier not in {"centroid", "wtaver", "wtsum"}:
                raise InvalidInput(
                    f"output {output.name!r} of a type-{system.type} system is reduced to a "
                    f"centroid; {output.defuzzifier} is for type 1"
                )
    planes = slices(options.slices) if system.type == 3 else [WHOLE]
    packed = [_packed(system, options, plane) for plane in planes]
    ends = np.cumsum([[0, 0], *([len(p.numbers), len(p.integers)] for p in packed)], axis=0)
    return Compiled(
        np.concatenate([p.numbers for p in packed]),
        np.concatenate([p.integers for p in packed]),
        np.column_stack([ends[:-1, 0], ends[1:, 0], ends[:-1, 1], ends[1:, 1]]),
    )


def slices(count: int) -> list[ZSlice]:
    """Planes at ``count`` levels, through the upper and through the lower secondary functions.

    The levels are the middles of equal parts of [0, 1], so that the sum over them is the midpoint
    rule; its error falls at least with their number, and with its square where planes are smooth
    in their level.
    """
    levels = (np.arange(count) + 0.5) / count
    return [ZSlice(level, of_lower) for level in levels.tolist() for of_lower in (False, True)]


def _packed(system: FuzzySystem, options: Options, plane: ZSlice) -> Packed:
    consequents, shapes = consequents_of(system)
    rest: tuple[tuple[Array, ...], ...]
    if system.is_sugeno:
        method, rest = SUGENO, (functions_of(system, shapes),)
    elif options.reduction == "cos":
        samples = None if options.centroid == "exact" else options.samples
        method, rest = (
            CENTRE_OF_SETS,
            (centres_of(system, shapes, samples, plane),),
        )
    elif options.centroid == "exact":
        upper = lines_of(system, shapes, plane)
        lower = lines_of(system, shapes, plane, of_lower=True) if system.type > 1 else upper
        method, rest = EXACT, (upper, lower, strips_of(system, shapes))
    else:
        method, rest = SAMPLED, (samples_of(system, shapes, options.samples, plane),)
    frame = Frame(
        np.array([end for variable in system.inputs for end in (variable.low, variable.high)]),
        np.array([output.fallback for output in system.outputs]),
        np.array([plane.level if system.type == 3 else 1.0]),
        np.array(
            [
                method,
                system.type > 1,
                ALGORITHMS.index(options.algorithm),
                _OUT_OF_RANGE[options.out_of_range],
                _NO_RULE[options.no_rule],
                options.samples if method == SAMPLED else max(map(len, shapes)),
            ],
            dtype=np.int64,
        ),
    )
    sets = sets_of([variable.sets for variable in system.inputs], plane)
    return pack(parts(frame, sets, antecedents_of(system), consequents, *rest))
