"""Gain, phase and delay margins of a closed loop, from its response to a small impulse."""

from __future__ import annotations

from math import inf, isfinite, nan
from typing import Literal, NamedTuple, get_args

import numpy as np
from jaxtyping import Complex, Float

from omnidrive.arrays import Array
from omnidrive.control import Controller
from omnidrive.control.controller import CommandValue
from omnidrive.errors import InvalidInput, kind_of, short_repr
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.parameter import Bounds, check_choice, check_number, check_sample_time, is_number
from omnidrive.reference import Reference
from omnidrive.simulation import Plant, PlantCapabilities, PlantState, simulate

LoopAxis = Literal["x", "y", "yaw"]
"""Component of the commanded body twist."""

_FREQUENCIES = 1 << 15
"""Least number of samples of the Fourier transform; a shorter response is padded with zeros."""
_PEAK_OF_INTEREST = 1e-3
"""Frequencies at which S is below this share of its peak, near 0 of a loop with an integrator, are
left out: |L| is beyond 1000 there, and the end of the response decides about its sign."""
_DECAYED = 1e-2
"""Largest value in the last tenth of a response that has decayed, over that of the response."""


class LoopMargins(NamedTuple):
    """Stability margins of the loop broken at one component of the command.

    Names and conventions are those of MATLAB's ``allmargin`` and of python-control's
    ``stability_margins``; of several crossings, the nearest to instability. Frequencies end at the
    Nyquist frequency.
    """

    stable: bool
    """Whether the closed loop is stable; otherwise all other values are NaN."""
    gain_margin: float
    """Factor above 1, at which the loop becomes unstable; infinite: there is none."""
    gain_reduction: float
    """Factor below 1, at which it becomes unstable; 0: there is none."""
    gain_frequency: float
    """Frequency of the phase crossover of ``gain_margin``, rad/s; NaN: there is none."""
    phase_margin: float
    """Least change of phase at a gain crossover that makes it unstable, deg; infinite: there is no
    gain crossover."""
    delay_margin: float
    """Largest additional delay, s: least phase margin over frequency of all gain crossovers;
    infinite: there is none. For delays that are no multiple of the sample time it is an
    approximation: between samples the command is constant."""
    delay_margin_samples: float
    """The same in sample times."""
    delay_frequency: float
    """Frequency of the gain crossover of ``delay_margin``, rad/s; NaN: there is none."""
    peak: float
    """Peak Ms of the sensitivity |S|: 1 / Ms is the least distance of L from -1."""
    nonlinearity: float = 0.0
    """Difference of the responses to a positive and a negative impulse, as a share of their sum
    (maxima); near 0, the loop is linear at this amplitude."""


def loop_margins(
    plant: Plant,
    controller: Controller,
    reference: Reference,
    *,
    dt: float,
    axis: LoopAxis = "x",
    at: float = 4.0,
    response: float = 20.0,
    amplitude: float = 1e-2,
) -> LoopMargins:
    """Measure the stability margins of a controller on a plant, of any kind, at one motion.

    The closed loop is simulated with and without an impulse, which is added to one sample of the
    command on its way to the plant. The differences of the executed commands, over the amplitude,
    are the impulse response of the sensitivity S(z) = 1 / (1 + L(z)) (Ljung, "System
    Identification", 1999, section 6.1), with L the loop transfer function broken there, all other
    loops being closed. So L = 1 / S - 1, from which the margins follow (Skogestad & Postlethwaite,
    "Multivariable Feedback Control", 2005, section 2.4). This linearises the loop, also of a
    controller without equations, about the motion at ``at``: a pose at rest, or a constant
    velocity.

    Args:
        plant: The simulated robot; the caller closes it.
        controller: The controller; it commands body twists, and ``reset`` starts it anew.
        reference: The motion, which begins at rest and lasts to ``at + response``, at least.
        dt: Sample time, s.
        axis: Component of the command.
        at: Time of the impulse, s.
        response: Time in which the response to the impulse decays, s.
        amplitude: Amplitude of the impulse, m/s or rad/s. Plants integrate in steps, so that the
            effect of rollers that reach the floor is not proportional to a very small one.

    Raises:
        InvalidInput: An argument is of another kind, the reference is too short, the response of a
            stable loop has not decayed at its end, the controller does not repeat its commands or
            commands no body twists.
        RunFailed: A simulation ends early.
    """
    check_choice("component of the command", axis, get_args(LoopAxis))
    _check_parts(plant, reference)
    _check_numbers(dt, at, response, amplitude)
    column = get_args(LoopAxis).index(axis)
    first, end = _samples(reference, dt, at, response)
    still, plus, minus = (
        _executed(plant, controller, reference, dt, _Impulse(first, column, size))[:end]
        for size in (0.0, amplitude, -amplitude)
    )
    if not np.array_equal(still[:first], plus[:first]):
        raise InvalidInput(
            "the controller does not repeat its commands in an equal run, so that the response to "
            "an impulse cannot be measured: let `reset` set everything that it keeps"
        )
    up, down = (plus - still)[first:] / amplitude, (still - minus)[first:] / amplitude
    impulse_response = 0.5 * (up + down)
    largest = np.abs(impulse_response).max()
    return margins_of_response(impulse_response, dt)._replace(
        nonlinearity=float(0.5 * np.abs(up - down).max() / largest)
    )


def _check_numbers(dt: float, at: float, response: float, amplitude: float) -> None:
    check_sample_time(dt)
    check_number("at", at, Bounds(0.0, 1e4, "s"))
    check_number("response", response, Bounds(10.0 * dt, 1e4, "s"))
    check_number("amplitude", amplitude, Bounds(1e-9, 1.0, "m/s or rad/s"))


def _check_parts(plant: object, reference: object) -> None:
    """Check plant and reference; a simulation checks the controller."""
    if not isinstance(plant, Plant):
        raise InvalidInput(f"the first argument is the plant, got {kind_of(plant)}")
    if not isinstance(reference, Reference):
        raise InvalidInput(f"the third argument is the reference, got {kind_of(reference)}")
    if not is_number(reference.duration) or not isfinite(reference.duration):
        raise InvalidInput(f"the duration of the reference is {short_repr(reference.duration)}")


def _samples(reference: Reference, dt: float, at: float, response: float) -> tuple[int, int]:
    """Return the sample of the impulse, and that at the end of its response."""
    first = round(at / dt)
    end = first + round(response / dt)
    if round(reference.duration / dt) < end:
        raise InvalidInput(
            f"the reference lasts {reference.duration:g} s: the impulse at {at:g} s and its "
            f"response of {response:g} s need {at + response:g} s"
        )
    return first, end


def margins_of_response(s: Float[Array, " samples"], dt: float) -> LoopMargins:
    """Return the stability margins of a loop from the impulse response of its sensitivity.

    Args:
        s: The impulse response; it begins with the sample of the impulse.
        dt: Sample time, s.

    Raises:
        InvalidInput: It decays, but has not decayed at its end.
    """
    size, tenth = np.abs(s), max(len(s) // 10, 1)
    late = size[-tenth:].max()
    if not np.isfinite(late) or late >= size[:tenth].max():
        return LoopMargins(False, *(nan,) * 9)
    if late > _DECAYED * size.max():
        raise InvalidInput(
            f"the response to the impulse is {100.0 * late / size.max():.2g} % of its maximum "
            f"after {len(s) * dt:g} s: give it more time to decay"
        )
    sensitivity = np.fft.rfft(s, 2 * max(_FREQUENCIES, len(s)))
    magnitude = np.abs(sensitivity)
    peak = float(magnitude.max())
    kept = magnitude > _PEAK_OF_INTEREST * peak
    frequency = np.linspace(0.0, np.pi / dt, len(sensitivity))[kept]
    loop = 1.0 / sensitivity[kept] - 1.0
    phase_margins, crossovers = _gain_crossovers(loop, frequency)
    gains, gain_frequencies = _phase_crossovers(loop, frequency)
    higher, lower = gains > 1.0, gains < 1.0
    nearest = _first_of(gains[higher], gain_frequencies[higher])
    delays = np.where(phase_margins > 0.0, phase_margins, phase_margins + 2.0 * np.pi) / crossovers
    delay, delay_frequency = _first_of(delays, crossovers)
    return LoopMargins(
        stable=True,
        gain_margin=nearest[0],
        gain_reduction=float(gains[lower].max(initial=0.0)),
        gain_frequency=nearest[1],
        phase_margin=float(np.degrees(np.abs(phase_margins).min(initial=inf))),
        delay_margin=delay,
        delay_margin_samples=delay / dt,
        delay_frequency=delay_frequency,
        peak=peak,
    )


def _gain_crossovers(
    loop: Complex[Array, " n"], frequency: Float[Array, " n"]
) -> tuple[Float[Array, " m"], Float[Array, " m"]]:
    """Return phase margin, rad, within (-pi, pi], and frequency, rad/s, of each with |L| = 1."""
    level = np.abs(loop) - 1.0
    at = np.flatnonzero(level[:-1] * level[1:] < 0.0)
    share = level[at] / (level[at] - level[at + 1])
    crossing = loop[at] + share * (loop[at + 1] - loop[at])
    return np.angle(-crossing), frequency[at] + share * (frequency[at + 1] - frequency[at])


def _phase_crossovers(
    loop: Complex[Array, " n"], frequency: Float[Array, " n"]
) -> tuple[Float[Array, " m"], Float[Array, " m"]]:
    """Return 1 / |L| and frequency, rad/s, of each crossing of the negative real axis.

    L is real at the Nyquist frequency, the last one.
    """
    at = np.flatnonzero((loop.imag[:-1] * loop.imag[1:] < 0.0) & (loop.real[:-1] < 0.0))
    share = loop.imag[at] / (loop.imag[at] - loop.imag[at + 1])
    crossing = loop.real[at] + share * (loop.real[at + 1] - loop.real[at])
    where = frequency[at] + share * (frequency[at + 1] - frequency[at])
    if len(loop) and loop.real[-1] < 0.0:
        crossing, where = np.append(crossing, loop.real[-1]), np.append(where, frequency[-1])
    return -1.0 / crossing, where


def _first_of(values: Float[Array, " m"], frequencies: Float[Array, " m"]) -> tuple[float, float]:
    """Return the least value and its frequency; infinite and NaN if there is none."""
    if not len(values):
        return inf, nan
    k = int(values.argmin())
    return float(values[k]), float(frequencies[k])


class _Impulse(NamedTuple):
    """An addition to one component of the command of one sample."""

    sample: int
    column: int
    amplitude: float


def _executed(
    plant: Plant, controller: Controller, reference: Reference, dt: float, impulse: _Impulse
) -> Float[Array, " rows"]:
    """Return one component of the commands that the plant executes in a run with an impulse."""
    start = reference.at(0.0).pose
    run = simulate(_ImpulsePlant(plant, impulse), controller, reference, start=start, dt=dt)
    commands = run.raise_if_failed().command[:-1, impulse.column].copy()
    if not np.isfinite(commands).all():
        raise InvalidInput("the loop is broken at a commanded body twist: this one commands wheels")
    commands[impulse.sample] += impulse.amplitude
    return commands


class _ImpulsePlant:
    """A plant that executes its commands with an impulse."""

    def __init__(self, plant: Plant, impulse: _Impulse) -> None:
        self._plant, self._impulse, self._step = plant, impulse, 0

    @property
    def capabilities(self) -> PlantCapabilities:
        """What the plant supports."""
        return self._plant.capabilities

    def reset(self, pose: Pose) -> PlantState:
        """Start a run at a pose."""
        self._step = 0
        return self._plant.reset(pose)

    def step(self, command: CommandValue, dt: float) -> PlantState:
        """Execute a command for ``dt`` seconds, with the impulse in its sample."""
        if self._step == self._impulse.sample and isinstance(command, BodyTwist):
            twist = list(command)
            twist[self._impulse.column] += self._impulse.amplitude
            command = BodyTwist(*twist)
        self._step += 1
        return self._plant.step(command, dt)

    def close(self) -> None:
        """Do nothing: the caller closes the plant."""
