"""Compilation of a fuzzy system and its inference options to the arrays of the kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.choices import ALGORITHMS, Algorithm, Centroid, NoRule, OutOfRange, Reduction
from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.antecedents import antecedents_of
from omnidrive.fuzzy.centre_of_sets import centroids_of
from omnidrive.fuzzy.consequents import consequents_of
from omnidrive.fuzzy.kernels import (
    AS_IS,
    CENTRE_OF_SETS,
    CLAMP,
    EXACT,
    RAISE,
    SAMPLED,
    SUGENO,
)
from omnidrive.fuzzy.packed_arrays import PackedArrays, pack
from omnidrive.fuzzy.sampled import samples_of
from omnidrive.fuzzy.segments import reason_not_exact, segments_of
from omnidrive.fuzzy.sets import FULL_FOOTPRINT, ZSlice, flatten_sets
from omnidrive.fuzzy.spikes import NO_SPIKES, spikes_of
from omnidrive.fuzzy.sugeno import flatten_functions
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.system_arrays import Header, Options, arrays_of
from omnidrive.fuzzy.trapezoid_centroid import trapezoids_of

_OUT_OF_RANGE = {"clamp": CLAMP, "matlab": AS_IS, "raise": RAISE}
_NO_RULE = {"default": CLAMP, "raise": RAISE}

MAX_SAMPLES, MAX_SLICES = 100_000, 1000


class InferenceOptions(NamedTuple):
    """How a system is evaluated; see :class:`~omnidrive.fuzzy.inference.Inference`."""

    centroid: Centroid
    samples: int
    reduction: Reduction
    algorithm: Algorithm
    out_of_range: OutOfRange
    no_rule: NoRule
    slices: int


class CompiledSystem(NamedTuple):
    """Arrays of a system: of one slice, or of all z-slices of a type-3 system."""

    floats: Float[Array, " floats"]
    integers: Int[Array, " integers"]
    slices: Int[Array, "slices 4"]
    """Begin and end of the floats, begin and end of the integers of each slice."""


def compile_system(system: FuzzySystem, options: InferenceOptions) -> CompiledSystem:
    """Return the arrays of a system.

    Raises:
        InvalidInput: The options do not apply to the system.
    """
    if options.centroid == "exact" and not system.is_sugeno and (why := reason_not_exact(system)):
        raise InvalidInput(
            f"there is no exact centroid: {why}; use --centroid matlab, in Python centroid='matlab'"
        )
    if system.type > 1:
        for output in system.outputs:
            if output.defuzzifier not in {"centroid", "wtaver", "wtsum"}:
                raise InvalidInput(
                    f"output {output.name!r} of a type-{system.type} system has only a "
                    f"centroid; the defuzzifier {output.defuzzifier} is for type 1"
                )
    slices = z_slices(options.slices) if system.type == 3 else [FULL_FOOTPRINT]
    packed = [_pack_slice(system, options, z_slice) for z_slice in slices]
    ends = np.cumsum([[0, 0], *([len(p.floats), len(p.integers)] for p in packed)], axis=0)
    return CompiledSystem(
        np.concatenate([p.floats for p in packed]),
        np.concatenate([p.integers for p in packed]),
        np.column_stack([ends[:-1, 0], ends[1:, 0], ends[:-1, 1], ends[1:, 1]]),
    )


def z_slices(count: int) -> list[ZSlice]:
    """Return z-slices at ``count`` levels, of the upper and of the lower secondary functions.

    The levels are the middles of equal parts of [0, 1], so that the sum over them is the midpoint
    rule. Its error decreases at least linearly with their number, and quadratically if the slices
    are smooth in their level.
    """
    levels = (np.arange(count) + 0.5) / count
    return [ZSlice(level, of_lower) for level in levels.tolist() for of_lower in (False, True)]


def _pack_slice(system: FuzzySystem, options: InferenceOptions, z_slice: ZSlice) -> PackedArrays:
    flat_consequents, consequents = consequents_of(system)
    arrays: tuple[tuple[Array, ...], ...]
    spikes = NO_SPIKES if system.is_sugeno else spikes_of(system, consequents, z_slice)
    if system.is_sugeno:
        method, arrays = SUGENO, (flatten_functions(system, consequents),)
    elif options.reduction == "cos":
        samples = None if options.centroid == "exact" else options.samples
        method = CENTRE_OF_SETS
        arrays = (centroids_of(system, consequents, samples, spikes, z_slice),)
    elif options.centroid == "exact":
        upper = segments_of(system, consequents, z_slice)
        lower = (
            segments_of(system, consequents, z_slice, of_lower=True) if system.type > 1 else upper
        )
        method, arrays = EXACT, (upper, lower, trapezoids_of(system, consequents))
    else:
        method, arrays = SAMPLED, (samples_of(system, consequents, options.samples, z_slice),)
    header = Header(
        np.array([end for variable in system.inputs for end in (variable.low, variable.high)]),
        np.array([output.fallback for output in system.outputs]),
        z_slice.level if system.type == 3 else 1.0,
        Options(
            method,
            int(system.type > 1),
            ALGORITHMS.index(options.algorithm),
            _OUT_OF_RANGE[options.out_of_range],
            _NO_RULE[options.no_rule],
            options.samples if method == SAMPLED else max(map(len, consequents)),
        ),
    )
    sets = flatten_sets([variable.sets for variable in system.inputs], z_slice)
    return pack(arrays_of(header, sets, antecedents_of(system), flat_consequents, spikes, *arrays))
