"""Tables of numbers in text."""

import pytest

from omnidrive.files.number_table import split_cells


def test_messages_about_quotes_are_printable():
    """Python's message holds the separator, here a tab."""
    with pytest.raises(ValueError, match="expected after") as caught:
        split_cells('"a"b\tc', "\t")
    assert str(caught.value).isprintable()
