"""Styles of controllers with arbitrary labels, and of horizons."""

import re
from dataclasses import replace

import pytest

from omnidrive.evaluation.palette import controller_styles, horizon_styles
from omnidrive.evaluation.study_logs import ControllerType
from tests.evaluation.recorded import labelled as relabelled

KNOWN = (
    "pid",
    "fuzzy_t1",
    "fuzzy_t2",
    "fuzzy_t3",
    "unicycle-nmpc",
    "feedforward",
    "holonomic-nmpc",
)


def labelled(study, labels, types=None):
    """Return a study with one run per label."""
    runs = tuple(relabelled(study.runs[0], controller=label) for label in labels)
    kinds = {label: ControllerType(name, "", "") for label, name in (types or {}).items()}
    return replace(study, runs=runs, types=kinds)


def luminance(colour):
    """Relative luminance of WCAG 2.2."""
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return sum(w * c for w, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def test_known_type_keeps_its_colour_under_any_label(study):
    built_in = controller_styles(labelled(study, KNOWN))
    mine = controller_styles(labelled(study, ("mine", "ours"), {"mine": "pid", "ours": "fuzzy_t3"}))
    assert mine["mine"].colour == built_in["pid"].colour
    assert mine["ours"].colour == built_in["fuzzy_t3"].colour


def test_second_controller_of_a_type_has_another_colour(study):
    labels = ("slow", "fast", "fuzzy_t1", "other")
    types = {"slow": "holonomic-nmpc", "fast": "holonomic-nmpc", "other": "lab:Lqr"}
    styles = controller_styles(labelled(study, labels, types))
    assert (
        styles["slow"].colour == controller_styles(labelled(study, KNOWN))["holonomic-nmpc"].colour
    )
    assert len({style.colour for style in styles.values()}) == 4
    assert styles == controller_styles(labelled(study, labels, types))


@pytest.mark.parametrize("count", [1, 7, 13])
def test_up_to_13_labels_have_distinct_colours(study, count):
    styles = controller_styles(labelled(study, [f"gain {k}" for k in range(count)]))
    for background in ("light", "dark"):
        assert len({getattr(s.colour, background) for s in styles.values()}) == count


def test_any_number_of_labels_has_distinct_styles(study):
    styles = controller_styles(labelled(study, [f"gain {k}" for k in range(50)]))
    assert len(set(styles.values())) == 50


def test_colours_are_visible_on_their_background(study):
    styles = controller_styles(labelled(study, [*KNOWN, *(f"gain {k}" for k in range(6))]))
    for style in styles.values():
        assert (1.05) / (luminance(style.colour.light) + 0.05) > 1.9
        assert (luminance(style.colour.dark) + 0.05) / 0.05 > 4.5


@pytest.mark.parametrize("count", [1, 2, 6, 9])
def test_horizons_have_distinct_colours(count):
    colours = [style.colour for style in horizon_styles(count)]
    assert len(set(colours)) == count
    assert all(re.fullmatch("#[0-9a-f]{6}", variant) for colour in colours for variant in colour)
