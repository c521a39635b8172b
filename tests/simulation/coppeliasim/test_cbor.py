"""Validation of CBOR messages."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.simulation.coppeliasim.cbor import is_harmless
from tests.examples import examples
from tests.simulation.coppeliasim.fake_server import cbor

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats() | st.text()
    | st.binary(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=20,
)  # fmt: skip


def depth(value):
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return 1 + max(map(depth, inner), default=0)


@examples(200)
@given(VALUES.filter(lambda value: depth(value) < 12), st.data())
def test_encoded_values_are_harmless_and_other_lengths_are_not(value, data):
    raw = cbor.dumps(value)
    assert is_harmless(raw)
    assert not is_harmless(raw + b"\0")
    assert not is_harmless(raw[: data.draw(st.integers(0, len(raw) - 1))])


@examples(300)
@given(st.binary(max_size=40))
def test_harmless_bytes_are_read_to_their_end(raw):
    if is_harmless(raw):
        assert not is_harmless(raw + b"\0")
        assert not is_harmless(raw[:-1])


@pytest.mark.parametrize(
    ("text", "expected"),
    [  # examples of RFC 8949, appendix A and, not well-formed, appendix F
        ("00", True), ("1bffffffffffffffff", True), ("f97e00", True), ("fb3ff199999999999a", True),
        ("c249010000000000000000", False), ("d74401020304", False), ("6449455446", True),
        ("a201020304", True), ("826161a161626163", True), ("5f42010243030405ff", True),
        ("9f018202039f0405ffff", True), ("bf61610161629f0203ffff", True), ("a0", True),
        ("", False), ("18", False), ("1901", False), ("41", False), ("61", False), ("81", False),
        ("a1", False), ("a20102", False), ("5f4100", False), ("9f", False), ("9f01", False),
        ("1c", False), ("3d", False), ("5e", False), ("7c", False), ("fe", False), ("ff", False),
        ("81ff", False), ("8200ff", False), ("a1ff", False), ("c0", False), ("1f", False),
        ("df", False), ("3f", False),
    ],
)  # fmt: skip
def test_examples_of_the_standard(text, expected):
    assert is_harmless(bytes.fromhex(text)) is expected


def test_depth_length_and_number_of_items_are_bounded():
    assert is_harmless(b"\x99\xc3\x4f" + b"\x80" * 49_999)
    assert not is_harmless(b"\x99\xc3\x50" + b"\x80" * 50_000)
    assert is_harmless(b"\x81" * 60 + b"\0")
    assert not is_harmless(b"\x81" * 1000 + b"\0")
    assert not is_harmless(b"\x9b" + bytes(7) + b"\xff" + bytes(100))
