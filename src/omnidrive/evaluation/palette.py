"""Display names and colours of the controllers in figures, tables and the report."""

from __future__ import annotations

from typing import NamedTuple
from zlib import crc32


class ThemeColour(NamedTuple):
    """A colour as ``#rrggbb``, one variant per background."""

    light: str
    """Variant for a white background."""
    dark: str
    """Variant for a black background."""


# Okabe & Ito, "Color universal design", 2008: distinguishable with colour blindness. On black,
# type 3 is redder than in their palette, to differ from type 1; the PID baseline is grey.
_CONTROLLERS = {
    "pid": ("PID", "PID", ThemeColour("#595959", "#d9d9d9")),
    "fuzzy_t1": ("Type-1 fuzzy PID", "T1", ThemeColour("#e69f00", "#e69f00")),
    "fuzzy_t2": ("Interval type-2 fuzzy PID", "IT2", ThemeColour("#0072b2", "#56b4e9")),
    "fuzzy_t3": ("Interval type-3 fuzzy PID", "IT3", ThemeColour("#d55e00", "#e0503c")),
    "unicycle-nmpc": ("Unicycle NMPC", "U-NMPC", ThemeColour("#cc79a7", "#e39ac3")),
    "feedforward": ("Feedforward", "FF", ThemeColour("#882255", "#c46ba0")),
    "holonomic-nmpc": ("Holonomic NMPC", "H-NMPC", ThemeColour("#009e73", "#1fc998")),
}
_SPARE = (
    ThemeColour("#8c564b", "#c49c94"),
    ThemeColour("#9c8f00", "#f0e442"),
    ThemeColour("#56b4e9", "#9ad7fb"),
)

# sections of viridis, without its ends that are too close to the background
_RAMPS = ThemeColour("#440154 #3b528b #21918c #5ec962", "#9a7be0 #5f9be6 #2fc0ae #c4e65a")


def controller_label(controller: str) -> str:
    """Return the display name of a controller; an unknown controller keeps its name."""
    return _CONTROLLERS[controller][0] if controller in _CONTROLLERS else controller


def controller_short(controller: str) -> str:
    """Return the abbreviated display name of a controller."""
    return _CONTROLLERS[controller][1] if controller in _CONTROLLERS else controller


def controller_colour(controller: str) -> ThemeColour:
    """Return the colour of a controller; it does not depend on the other controllers."""
    if controller in _CONTROLLERS:
        return _CONTROLLERS[controller][2]
    return _SPARE[crc32(controller.encode()) % len(_SPARE)]


def horizon_colours(count: int) -> tuple[ThemeColour, ...]:
    """Return the colours of ``count`` horizons, from the shortest to the longest."""
    positions = [k / max(count - 1, 1) for k in range(count)]
    light, dark = ([_interpolate(ramp.split(), p) for p in positions] for ramp in _RAMPS)
    return tuple(ThemeColour(*pair) for pair in zip(light, dark, strict=True))


def _interpolate(ramp: list[str], position: float) -> str:
    """Return the colour at ``position`` in [0, 1] of a ramp, interpolated linearly in sRGB."""
    k = min(int(position * (len(ramp) - 1)), len(ramp) - 2)
    share = position * (len(ramp) - 1) - k
    low, high = ([int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in (ramp[k], ramp[k + 1]))
    return "#" + "".join(
        f"{round(a + share * (b - a)):02x}" for a, b in zip(low, high, strict=True)
    )
