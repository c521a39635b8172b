"""Likelihoods of the hypotheses on the drive, and the choice between them.

Multiple-model estimation (Magill, "Optimal adaptive estimation of sampled stochastic processes",
IEEE Trans. Autom. Control 10, 1965), with forgetting.
"""

from __future__ import annotations

from math import inf, log
from typing import Any

from omnidrive.compiled import compiled
from omnidrive.estimation.drive.identification_state import HYPOTHESES, KNOWN, forgetting_pace
from omnidrive.estimation.drive_estimate import DriveSettings

_CAUTION = 4.0
"""Factor of the variances over the mean square of the innovations, because innovations that no
hypothesis explains are not independent of each other."""
SLIP_CAUTION = 30.0
"""Factor of the variances with all wheels at the friction limit, in addition: a wrong friction
lasts for the whole slip, so that its innovations are not independent of each other either."""
_LARGEST_EVIDENCE = 12.0
"""Largest square of an innovation over its variance in a likelihood."""
_CHANGE, _CHANGE_IN_APPROACH, _CHANGE_UNCONFIRMED, _CHANGE_TO_KNOWN = 10.0, 4.0, 1.0, 4.0
"""Logarithm of the likelihood ratio above which another hypothesis is chosen; in an approach,
which lasts for a few samples only, instead of the known drive; instead of a hypothesis that was
never far better than all others; and above which the known drive is, the likeliest one before any
sample."""
_UNEXPLAINED = 4.0
"""Least mean square of the innovations of a sample over their variances, of all hypotheses, above
which the disturbance has changed at once."""
_LARGEST_DISTURBANCE = 1.0
"""Largest standard deviation of a disturbance that changes at once, m/s and rad/s."""
_MAX_LEAD = 15.0
"""Largest difference between the logarithms of the largest likelihood and of another one: a
hypothesis that was wrong for long may become right."""
_LIKELIHOOD_MEMORY = 5.0
"""Time constant with which the likelihoods are forgotten, s."""


@compiled
def variance_scale(excess: float) -> float:
    """Return the factor of the variances for the least mean square of the innovations."""
    return max(1.0, _CAUTION * excess)


@compiled
def compare(state: Any, dt: float, excess: float) -> None:
    """Update the likelihoods of the delays by the latest innovations.

    Old evidence is forgotten faster where another hypothesis explains the motion better. The
    variance that wheel slip adds is that of the hypothesis with most slip: it is an upper bound, so
    that its logarithm must not decide. The caution with slip concerns the parameters only: no floor
    makes a robot respond later. Where no hypothesis explains a sample, all variances of this sample
    are larger in proportion; and far above them, the disturbance has changed at once, which must
    not be evidence for parameters.

    Args:
        state: Hypotheses and the chosen one; changed in place.
        dt: Time since the last sample, s.
        excess: Least mean square of the innovations over their variance.
    """
    hypotheses = state.hypotheses
    pace = forgetting_pace(hypotheses[state.chosen].mean_square / max(excess, 1.0))
    scale = variance_scale(excess)
    for h in hypotheses:
        h.log_likelihood *= max(1.0 - dt * pace / _LIKELIHOOD_MEMORY, 0.0)
    shared, least = state.work.variance, inf
    for a in range(3):
        shared[a] = 0.0
        for h in hypotheses:
            slips = SLIP_CAUTION * h.saturation
            shared[a] = max(shared[a], scale / (scale + slips) * h.innovation.variance[a])
    for h in hypotheses:
        mean = 0.0
        for a in range(3):
            total = shared[a] + h.innovation.by_parameters[a]
            mean += h.innovation.value[a] ** 2 / (3.0 * total)
        least = min(least, mean)
    for h in hypotheses:
        for a in range(3):
            total = shared[a] + h.innovation.by_parameters[a]
            square = h.innovation.value[a] ** 2 / (max(least, 1.0) * total)
            h.log_likelihood -= 0.5 * (min(square, _LARGEST_EVIDENCE) + log(total / shared[a]))
    best = -inf
    for h in hypotheses:
        best = max(best, h.log_likelihood)
    for h in hypotheses:
        h.log_likelihood = max(h.log_likelihood, best - _MAX_LEAD)
    if least > _UNEXPLAINED:
        _forget_disturbances(hypotheses, dt)


@compiled
def _forget_disturbances(hypotheses: Any, dt: float) -> None:
    """Let the variances of the disturbances explain the least innovations in a sample of ``dt`` s.

    They are the same ones for all hypotheses, so that none explains later samples the better.
    """
    for a in range(3):
        least = inf
        for h in hypotheses:
            least = min(least, (h.innovation.value[a] / dt) ** 2)
        for h in hypotheses:
            p = h.state_covariance[a]
            p[2, 2] = max(p[2, 2], min(least, _LARGEST_DISTURBANCE**2))


@compiled
def choose(settings: DriveSettings, state: Any, approaches: bool) -> None:
    """Choose the hypothesis that explains the motion far better than the present one, if any does.

    Another hypothesis that was chosen by a small lead over the next one is left as easily.
    """
    chosen, hypotheses = state.chosen, state.hypotheses
    margin = _CHANGE
    if chosen == KNOWN and approaches:
        margin = _CHANGE_IN_APPROACH
    elif chosen != KNOWN and not state.is_confirmed:
        margin = _CHANGE_UNCONFIRMED
    best = hypotheses[chosen].log_likelihood + margin
    for k in range(HYPOTHESES):
        h = hypotheses[k]
        if h.log_likelihood > best and h.delay <= settings.max_delay:
            state.chosen, best = k, h.log_likelihood
    least = hypotheses[chosen].log_likelihood + _CHANGE_TO_KNOWN
    if state.chosen == chosen and hypotheses[KNOWN].log_likelihood > least:
        state.chosen = KNOWN
    if state.chosen != chosen:
        state.is_confirmed = 0
    others = -inf
    for k in range(HYPOTHESES):
        if k != state.chosen:
            others = max(others, hypotheses[k].log_likelihood)
    if hypotheses[state.chosen].log_likelihood > others + _CHANGE:
        state.is_confirmed = 1
