"""Numbers in text: decimal notation only."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.files.number_text import parse_number


@given(value=st.floats(allow_nan=False, allow_infinity=False))
def test_every_float_is_read_as_written(value):
    assert parse_number(repr(value)) == value
    assert parse_number(f" {value:.3f}\t") == float(f"{value:.3f}")


@pytest.mark.parametrize(
    ("text", "value"),
    [("5", 5.0), ("+5.", 5.0), (".5", 0.5), ("-0.5e-3", -5e-4), ("007", 7.0), ("1E2", 100.0)],
)
def test_notations(text, value):
    assert parse_number(text) == value


@pytest.mark.parametrize(
    "text",
    [
        "", " ", ".", "+", "e5", "1e", "1_000", "1,5", "1 2", "0x10", "1:30", "inf", "-inf",
        "nan", "1e999", "٣", "５", "1.5.2", "--1", "1f", "1j", "5 m", "9" * 1000,
        "1" * 1_000_000 + "x",
    ],
)  # fmt: skip
def test_other_text_is_no_number(text):
    assert parse_number(text) is None


@given(text=st.text(max_size=12) | st.from_regex(r"[-+0-9._eEinfa ]{0,10}", fullmatch=True))
def test_result_is_that_of_float_or_none(text):
    number = parse_number(text)
    if number is not None:
        assert np.isfinite(number)
        assert number == float(text)
