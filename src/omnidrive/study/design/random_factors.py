"""Random factors of a study: settings of a scenario that are drawn once per repetition."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidStudy, one_line, short_repr, suggestion
from omnidrive.scenario.scenario_path import Keys
from omnidrive.study.design.axes import (
    Label,
    check_plain,
    check_scale,
    factor_name,
    is_finite_number,
    label_of,
    numbered,
)

Method = Literal["sobol", "latin-hypercube", "independent"]
"""Methods of sampling."""

MAX_DIMENSIONS = 200
"""Largest number of random numbers of one sample."""

_BLOCK = 1024  # samples that are drawn together; a power of two
_STREAM, _SEEDS = 2**31, 2**31 + 1  # keys of the seed sequences of samples and of repetitions
_RANGE = ("low", "high", "scale")
_FORMS = "need {low: 8, high: 12}, {times: {low: 0.7, high: 1.4}} or {choices: [...]}"


class Sample(NamedTuple):
    """Value of a factor in one repetition."""

    value: Any
    label: Label
    """The value in tables."""


@dataclass(frozen=True, eq=False, slots=True)
class RandomFactor:
    """A setting of the scenario and its distribution.

    Attributes:
        path: Dotted path into the scenario.
        keys: The same as keys.
        source: The distribution as in the study file.
        low: Lower ends of its numbers; one number, or those of a list.
        high: Upper ends.
        log: Whether the logarithm of each number is uniformly distributed, instead of the number.
        choices: Values with equal probabilities; empty: a range.
        labels: The choices in tables; those of different values differ.
        relative: Whether the numbers are multiples of the setting in the scenario.
    """

    path: str
    keys: Keys
    source: Any
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()
    log: bool = False
    choices: tuple[Any, ...] = ()
    labels: tuple[Label, ...] = ()
    relative: bool = False

    @property
    def name(self) -> str:
        """Name of the factor in tables."""
        return factor_name(self.path, relative=self.relative)

    @property
    def distribution(self) -> str:
        """The distribution in words, such as ``0.7 to 1.4``; numbers in the unit of the setting."""
        if self.choices:
            return f"one of {', '.join(map(str, self.labels))}"
        ranges = [f"{low:g} to {high:g}" for low, high in zip(self.low, self.high, strict=True)]
        return ", ".join(ranges) + (", uniform in the logarithm" if self.log else "")

    @property
    def dimensions(self) -> int:
        """Number of random numbers of one value."""
        return 1 if self.choices else len(self.low)

    def sample(self, uniforms: Float[Array, " dimensions"]) -> Sample:
        """Return the value for random numbers of [0, 1)."""
        if self.choices:
            index = int(uniforms[0] * len(self.choices))
            return Sample(self.choices[index], self.labels[index])
        value = self._between(uniforms)
        return Sample(value, label_of(value))

    @property
    def ends(self) -> tuple[Any, Any]:
        """Both ends of a range."""
        return self._between(np.zeros(self.dimensions)), self._between(np.ones(self.dimensions))

    def _between(self, uniforms: Float[Array, " dimensions"]) -> Any:
        """Return the value of a range for random numbers of [0, 1]."""
        low, high = np.array(self.low), np.array(self.high)
        drawn = low * (high / low) ** uniforms if self.log else low + (high - low) * uniforms
        numbers = np.clip(drawn, low, high).tolist()
        return numbers if isinstance(_range(self.source).get("low"), list) else numbers[0]


@dataclass(frozen=True, eq=False, slots=True)
class RandomFactors:
    """Joint distribution of the random factors of a study; the factors are independent.

    Attributes:
        factors: The factors.
        method: `sobol`: scrambled Sobol sequence (Owen 1998), which fills the space evenly;
            `latin-hypercube`: each factor is stratified over all repetitions (McKay et al. 1979);
            `independent`: independent samples.
    """

    factors: tuple[RandomFactor, ...] = ()
    method: Method = "sobol"

    @property
    def is_extendable(self) -> bool:
        """Whether further repetitions leave the samples of the present ones as they are."""
        return self.method != "latin-hypercube" or not self.factors

    def sample(self, repetition: int, repetitions: int, seed: int) -> list[Sample]:
        """Return the value of each factor.

        Args:
            repetition: Index of the repetition, from 0.
            repetitions: Number of repetitions.
            seed: Seed of the study.
        """
        if not self.factors:
            return []
        dimensions = sum(each.dimensions for each in self.factors)
        if self.method == "latin-hypercube":
            row = _latin_hypercube(dimensions, repetitions, seed)[repetition]
        elif self.method == "sobol":
            row = _sobol(dimensions, seed, repetition // _BLOCK)[repetition % _BLOCK]
        else:
            row = _generator(seed, _STREAM, repetition).random(dimensions)
        values, first = [], 0
        for factor in self.factors:
            values.append(factor.sample(row[first : first + factor.dimensions]))
            first += factor.dimensions
        return values


def repetition_seed(seed: int, repetition: int) -> int:
    """Return the seed of a repetition; that of the first one is the seed of the scenario."""
    if repetition == 0:
        return seed
    sequence = np.random.SeedSequence(seed, spawn_key=(_SEEDS, repetition))
    return int(sequence.generate_state(1, np.uint64)[0] >> 11)


def _generator(seed: int, *key: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


@lru_cache(maxsize=8)
def _sobol(dimensions: int, seed: int, block: int) -> Float[Array, "samples dimensions"]:
    """Return a block of points of the scrambled Sobol sequence of a seed."""
    from scipy.stats import qmc  # noqa: PLC0415 - takes half a second

    sampler = qmc.Sobol(dimensions, scramble=True, seed=_generator(seed, _STREAM))
    if block:
        sampler.fast_forward(block * _BLOCK)
    points: Float[Array, "samples dimensions"] = sampler.random(_BLOCK)
    return points


@lru_cache(maxsize=8)
def _latin_hypercube(
    dimensions: int, samples: int, seed: int
) -> Float[Array, "samples dimensions"]:
    from scipy.stats import qmc  # noqa: PLC0415 - takes half a second

    sampler = qmc.LatinHypercube(dimensions, seed=_generator(seed, _STREAM))
    points: Float[Array, "samples dimensions"] = sampler.random(samples)
    return points


def parse_factor(path: str, keys: Keys, source: Any) -> RandomFactor:
    """Return the factor that the value of a key of ``random.factors`` describes.

    Raises:
        InvalidStudy: It has another form, or a range is empty.
    """
    if not isinstance(source, dict):
        raise InvalidStudy(f"{_FORMS}, got {short_repr(source)}")
    if source.keys() == {"choices"}:
        choices = source["choices"]
        if not isinstance(choices, list) or not choices:
            raise InvalidStudy(f"choices: needs a list of values, got {short_repr(choices)}")
        check_plain(choices)
        labels = numbered(choices, list(map(label_of, choices)))
        return RandomFactor(path, keys, source, choices=tuple(choices), labels=labels)
    relative = source.keys() == {"times"}
    inner = _range(source)
    odd = [str(key) for key in inner if key not in _RANGE]
    if odd:
        hint = suggestion(odd[0], (*_RANGE, "times", "choices"))
        raise InvalidStudy(f"unknown key '{one_line(odd[0], 60)}'{hint}")
    low, high = (_numbers(inner.get(key)) for key in ("low", "high"))
    if not low or not high or len(low) != len(high):
        raise InvalidStudy(f"{_FORMS}, with two numbers or two lists of numbers of one length")
    for a, b in zip(low, high, strict=True):
        if not a <= b:
            raise InvalidStudy(f"low is {a:g}, larger than high, {b:g}")
    log = check_scale(inner.get("scale", "linear"), min(low)) == "log"
    return RandomFactor(path, keys, source, low, high, log, relative=relative)


def _range(source: dict[Any, Any]) -> dict[Any, Any]:
    inner = source.get("times", source)
    return inner if isinstance(inner, dict) else {}


def _numbers(value: Any) -> tuple[float, ...]:
    """Return the numbers of one end of a range; empty for another value."""
    values = value if isinstance(value, list) else [value]
    return tuple(map(float, values)) if values and all(map(is_finite_number, values)) else ()
