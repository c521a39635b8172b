"""Colours, dashes and markers of the controllers in figures and the report."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from omnidrive.evaluation.study_logs import StudyLogs


class ThemeColour(NamedTuple):
    """A colour as ``#rrggbb``, one variant per background."""

    light: str
    """Variant for a white background."""
    dark: str
    """Variant for a black background."""


class ControllerStyle(NamedTuple):
    """Appearance of one controller; it is the same in all figures and charts of a study."""

    colour: ThemeColour
    dash: tuple[float, ...]
    """Lengths of dashes and gaps, in line widths; empty: a solid line."""
    marker: str
    """Marker of matplotlib."""


# Okabe & Ito, "Color universal design", 2008: distinguishable with colour blindness. On black,
# type 3 is redder than in their palette, to differ from type 1; the PID baseline is grey.
_TYPES = {
    "pid": ThemeColour("#595959", "#d9d9d9"),
    "fuzzy_t1": ThemeColour("#e69f00", "#e69f00"),
    "fuzzy_t2": ThemeColour("#0072b2", "#56b4e9"),
    "fuzzy_t3": ThemeColour("#d55e00", "#e0503c"),
    "unicycle-nmpc": ThemeColour("#cc79a7", "#e39ac3"),
    "feedforward": ThemeColour("#882255", "#c46ba0"),
    "holonomic-nmpc": ThemeColour("#009e73", "#1fc998"),
}
# P. Tol, "Colour schemes", SRON/EPS/TN/09-002, 2021: the schemes muted and light
_FURTHER = (
    ThemeColour("#56b4e9", "#9ad7fb"),
    ThemeColour("#8c7a00", "#f0e442"),
    ThemeColour("#332288", "#8f86e8"),
    ThemeColour("#8c564b", "#d0a08f"),
    ThemeColour("#44aa99", "#7fe0d0"),
    ThemeColour("#aa4499", "#f08fe0"),
)

_DASHES = (
    (),
    (5.0, 1.6),
    (1.4, 1.2),
    (6.0, 1.5, 1.4, 1.5),
    (3.0, 1.2),
    (8.0, 1.5, 1.4, 1.5, 1.4, 1.5),
)
_MARKERS = "os^Dv*Xph"

# sections of viridis, without its ends that are too close to the background
_RAMPS = ThemeColour("#440154 #3b528b #21918c #5ec962", "#9a7be0 #5f9be6 #2fc0ae #c4e65a")


def controller_styles(logs: StudyLogs) -> dict[str, ControllerStyle]:
    """Return the style of every controller of a study, by its label; see :func:`styles_of`."""
    return styles_of({label: logs.type_of(label) for label in logs.controllers})


def styles_of(types: Mapping[str, str]) -> dict[str, ControllerStyle]:
    """Return the style of every controller, by its label.

    The first controller of a built-in type has the colour of the type. All others have the colours
    of one sequence, in the order of the study; those of types that the study does not contain
    follow. When the colours are used up they repeat with other dashes and markers.

    Args:
        types: Name of the type of each controller by its label, in the order of the study.
    """
    first = {kind: label for label, kind in reversed(list(types.items()))}
    own = {first[kind]: colour for kind, colour in _TYPES.items() if kind in first}
    free = [*_FURTHER, *(colour for kind, colour in _TYPES.items() if kind not in first)]
    others = [label for label in types if label not in own]
    taken = own | {label: free[k % len(free)] for k, label in enumerate(others)}
    return {
        label: ControllerStyle(taken[label], _DASHES[k % len(_DASHES)], _MARKERS[k % len(_MARKERS)])
        for k, label in enumerate(types)
    }


def horizon_styles(count: int) -> tuple[ControllerStyle, ...]:
    """Return the styles of ``count`` horizons, from the shortest to the longest."""
    positions = [k / max(count - 1, 1) for k in range(count)]
    light, dark = ([_interpolate(ramp.split(), p) for p in positions] for ramp in _RAMPS)
    return tuple(
        ControllerStyle(ThemeColour(*pair), _DASHES[k % len(_DASHES)], _MARKERS[k % len(_MARKERS)])
        for k, pair in enumerate(zip(light, dark, strict=True))
    )


def _interpolate(ramp: list[str], position: float) -> str:
    """Return the colour at ``position`` in [0, 1] of a ramp, interpolated linearly in sRGB."""
    k = min(int(position * (len(ramp) - 1)), len(ramp) - 2)
    share = position * (len(ramp) - 1) - k
    low, high = ([int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in (ramp[k], ramp[k + 1]))
    return "#" + "".join(
        f"{round(a + share * (b - a)):02x}" for a, b in zip(low, high, strict=True)
    )
