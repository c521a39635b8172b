"""Fuzzy systems that tune gains: those of the paper's text and of its published code."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import isfinite, nan
from typing import Literal, get_args

from jaxtyping import Int

from omnidrive.arrays import Array
from omnidrive.choices import OutOfRange
from omnidrive.control.pid.fuzzy_options import FuzzyOptions
from omnidrive.control.pid.laws import GainChange
from omnidrive.control.pid.rules import paper_rules, published_rules
from omnidrive.fuzzy import Footprint, FuzzySystem, Inference, Secondary
from omnidrive.parameter import check_choice

Kind = Literal["t1", "t2", "t3"]
Preset = Literal["paper", "published-code"]

PAPER_FOOTPRINT = Footprint(scale=1.0, left=0.3)
"""Footprint of every set in the paper's text."""
PUBLISHED_INPUTS = Footprint(scale=0.7, left=0.2)
"""Footprint of the input sets in the published code."""
PUBLISHED_OUTPUTS = Footprint(scale=1.0, left=0.2)
"""Footprint of the output sets in the published code: Matlab's default."""

_PRESETS: dict[Preset, tuple[Callable[[], Int[Array, "7 7 3"]], Footprint, Footprint]] = {
    "paper": (paper_rules, PAPER_FOOTPRINT, PAPER_FOOTPRINT),
    "published-code": (published_rules, PUBLISHED_INPUTS, PUBLISHED_OUTPUTS),
}
"""Rule table and footprints of inputs and outputs, by preset."""

_PUBLISHED = FuzzyOptions()

SLICES = 5
"""Number of levels of the z-slices of type-3 sets.

Twice as many change no output by 1e-4, 1/2000 of its range."""


@lru_cache(maxsize=64)
def gain_inference(kind: Kind, preset: Preset, options: FuzzyOptions = _PUBLISHED) -> Inference:
    """Return the compiled fuzzy system of a preset.

    ``paper`` has the paper's table, exact centroids and, for types 2 and 3, centre-of-sets type
    reduction; ``published-code`` has the code's table and Matlab's centroid. The paper has no
    type 3: its sets are those of type 2 with the default secondary membership. A system in a file
    has the same options, but samples of the centroid where it has no closed form; one of type 1
    has the footprints of the preset for types 2 and 3.

    Inputs outside [-1, 1] are not changed, as in Matlab: no rule of the paper's sets fires there,
    so that the outputs are zero. A system in a file has its defaults where no rule fires: without
    any, the middles of its ranges. Inputs of a Sugeno system are clamped to [-1, 1], because
    its linear functions would exceed the greatest change of a gain beyond.

    Args:
        kind: ``t1``, ``t2`` or ``t3``.
        preset: The preset.
        options: Membership functions, footprints and rules that differ from the preset.

    Raises:
        InvalidInput: The kind or preset is unknown.
    """
    system = gain_system(kind, preset, options)
    beyond: OutOfRange = "clamp" if system.is_sugeno else "matlab"
    if preset == "published-code":
        return Inference(system, centroid="matlab", out_of_range=beyond, slices=SLICES)
    if kind == "t1":
        return Inference(system, out_of_range=beyond)
    return Inference(system, reduction="cos", out_of_range=beyond, slices=SLICES)


def gain_system(kind: Kind, preset: Preset, options: FuzzyOptions = _PUBLISHED) -> FuzzySystem:
    """Return the fuzzy system that :func:`gain_inference` compiles, of the same arguments.

    Raises:
        InvalidInput: The kind or preset is unknown.
    """
    check_choice("preset", preset, get_args(Preset))
    check_choice("kind of fuzzy system", kind, get_args(Kind))
    rules, inputs, outputs = _PRESETS[preset]
    system = options.system(rules())
    if kind != "t1" and system.type == 1:
        system = system.with_footprint(*options.footprints(inputs, outputs))
    return system.with_secondary(Secondary()) if kind == "t3" else system


def resolved_options(options: FuzzyOptions, preset: Preset) -> FuzzyOptions:
    """Return the options of a fuzzy system with all values, from those of a preset."""
    rules, inputs, outputs = _PRESETS[preset]
    return options.resolved(rules(), inputs, outputs)


@dataclass(frozen=True, eq=False, slots=True)
class FuzzyTuner:
    """A :data:`~omnidrive.control.pid.Tuner` that evaluates a fuzzy system.

    Attributes:
        inference: The compiled system; its outputs are the changes of kp, ki and kd.
    """

    inference: Inference

    def __call__(self, error: float, change: float) -> GainChange:
        """Return the changes; nan for inputs that are not finite, which fails the step."""
        if not (isfinite(error) and isfinite(change)):
            return nan, nan, nan
        kp, ki, kd = self.inference(error, change).tolist()
        return kp, ki, kd


def fuzzy_tuner(kind: Kind, preset: Preset, options: FuzzyOptions = _PUBLISHED) -> FuzzyTuner:
    """Return the tuner of a preset: from scaled error and change to the changes of kp, ki and kd.

    Inputs outside [-1, 1] have the effect stated there; those that are not finite give nan.
    Arguments are those of :func:`gain_inference`.

    Raises:
        InvalidInput: The kind or preset is unknown.
    """
    return FuzzyTuner(gain_inference(kind, preset, options))
