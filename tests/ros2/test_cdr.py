"""Bytes of messages: those of rosbags in both directions, and damaged ones."""

import random
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnidrive.errors import InvalidInput, InvalidMessage
from omnidrive.ros2 import decode, encode, interfaces, message_type
from tests.ros2.peer_types import STORES, from_peer, messages, to_peer, typestore

NAMES = sorted(interfaces())
VARIANTS = [
    (name, distribution)
    for distribution in STORES
    for name, each in interfaces(distribution).items()
    if distribution == "jazzy" or each != interfaces("jazzy").get(name)
]


def same_as_peer(data, name, distribution):
    """Bytes equal those of rosbags, and each side decodes those of the other."""
    store = typestore(distribution)
    message = data.draw(messages(name, distribution))
    raw = encode(message)
    assert raw == bytes(store.serialize_cdr(to_peer(message, store), name, little_endian=True))
    assert decode(raw, name, distribution) == message
    assert from_peer(store.deserialize_cdr(raw, name), name, distribution) == message
    swapped = bytes(store.serialize_cdr(to_peer(message, store), name, little_endian=False))
    assert decode(swapped, name, distribution) == message


@pytest.mark.parametrize(("name", "distribution"), VARIANTS)
@settings(max_examples=5)
@given(data=st.data())
def test_bytes_are_those_of_rosbags(name, distribution, data):
    same_as_peer(data, name, distribution)


@pytest.mark.long
@pytest.mark.parametrize(("name", "distribution"), VARIANTS)
@settings(max_examples=200)
@given(data=st.data())
def test_bytes_are_those_of_rosbags_at_length(name, distribution, data):
    same_as_peer(data, name, distribution)


def test_defaults_are_those_of_the_definitions():
    odometry = message_type("nav_msgs/msg/Odometry")()
    assert odometry.pose.pose.orientation.w == 1.0
    assert odometry.pose.covariance.shape == (36,)
    assert odometry.header.frame_id == ""
    assert decode(encode(odometry), "nav_msgs/msg/Odometry") == odometry


def sample(name, rng):
    """A message with texts and sequences, of any type."""
    cls = message_type(name)
    values = {}
    for field in cls.interface.fields:
        if "/" in field.type:
            one = [sample(field.type, rng) for _ in range(2)]
            values[field.name] = one[0] if field.kind == "single" else one
        elif field.type == "string":
            values[field.name] = "base" if field.kind == "single" else ["left", "", "right"]
        elif field.kind == "sequence":
            values[field.name] = np.array([rng.randrange(2) for _ in range(3)])
    return cls(**values)


def attack(seed, rounds):
    """Damaged bytes are refused or decoded, with bounded memory; a failure names the seed."""
    rng = random.Random(seed)
    for number in range(rounds):
        name = rng.choice(NAMES)
        raw = bytearray(encode(sample(name, rng)))
        for _ in range(rng.randrange(1, 5)):
            kind = rng.randrange(4)
            at = rng.randrange(len(raw)) if raw else 0
            if kind == 0:
                raw[at : at + 4] = rng.choice(
                    [b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\0"]
                )
            elif kind == 1:
                del raw[at:]
            elif kind == 2:
                raw[at : at + 1] = bytes([rng.randrange(256)])
            else:
                raw += rng.randbytes(rng.randrange(20))
        raw[:4] = b"\0\1\0\0" if rng.random() < 0.9 else raw[:4]
        tracemalloc.start()
        try:
            decode(bytes(raw), name)
        except InvalidMessage as error:
            assert "\n" not in str(error), (seed, number)  # noqa: PT017 - it may also be decoded
        except Exception as error:
            raise AssertionError(f"seed {seed}, round {number}, {name}") from error
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert most < 200_000 + 100 * len(raw), (seed, number, name)


def test_damaged_bytes_are_refused_with_bounded_memory():
    attack(seed=20, rounds=300)


@pytest.mark.long
def test_damaged_bytes_are_refused_with_bounded_memory_at_length():
    attack(seed=21, rounds=100_000)


@pytest.mark.parametrize(
    ("raw", "reason"),
    [
        (b"", "starts with"),
        (b"\0\1\0", "starts with"),
        (b"\0\3\0\0" + bytes(8), "starts with"),
        (b"\0\1\0\0" + bytes(7), "unpack"),
        (b"\0\1\0\0" + bytes(12), "4 bytes too many"),
    ],
)
def test_bytes_of_another_length_are_refused(raw, reason):
    with pytest.raises(InvalidMessage, match=reason):
        decode(raw, "builtin_interfaces/msg/Time")


def test_a_long_length_allocates_nothing():
    raw = b"\0\1\0\0" + bytes(8) + b"\1\0\0\0\0\0\0\0" + b"\xff\xff\xff\x7f"
    with pytest.raises(InvalidMessage, match="2147483647 with 0 bytes left"):
        decode(raw, "nav_msgs/msg/Path")


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("geometry_msgs/msg/Point", {"x": "far"}),
        ("builtin_interfaces/msg/Time", {"sec": 2**40}),
        ("builtin_interfaces/msg/Time", {"nanosec": -1}),
        ("std_msgs/msg/String", {"data": 3}),
        ("std_msgs/msg/String", {"data": "a\0b"}),
        ("geometry_msgs/msg/Twist", {"linear": (1.0, 2.0, 3.0)}),
        ("geometry_msgs/msg/PoseWithCovariance", {"covariance": np.zeros(35)}),
        ("nav_msgs/msg/OccupancyGrid", {"data": np.array([0.5])}),
        ("nav_msgs/msg/OccupancyGrid", {"data": np.array([200])}),
        ("rmw_dds_common/msg/NodeEntitiesInfo", {"node_name": "n" * 257}),
    ],
)
def test_values_of_another_type_are_refused(name, values):
    with pytest.raises(InvalidMessage, match="cannot be encoded"):
        encode(message_type(name)(**values))


@pytest.mark.parametrize("order", [">f8", "<f8"])
def test_arrays_are_encoded_by_their_values(order):
    """Not by their bytes in memory: byte order, strides and whole numbers make no difference."""
    values = np.arange(72.0)[::2]
    cls = message_type("geometry_msgs/msg/PoseWithCovariance")
    expected = encode(cls(covariance=list(values)))
    assert expected[60:] == values.astype("<f8").tobytes()
    for same in (values, values.astype(order), values.astype(int)):
        assert encode(cls(covariance=same)) == expected


def test_decoded_arrays_are_independent_of_the_bytes():
    scan = message_type("sensor_msgs/msg/LaserScan")(ranges=np.ones(3))
    raw = bytearray(encode(scan))
    decoded = decode(memoryview(raw), "sensor_msgs/msg/LaserScan")
    raw[4:] = bytes(len(raw) - 4)
    decoded.ranges *= 2.0
    np.testing.assert_array_equal(decoded.ranges, [2.0, 2.0, 2.0])


def test_an_unknown_type_is_refused_with_the_nearest():
    with pytest.raises(InvalidInput, match="did you mean 'geometry_msgs/msg/Twist'"):
        message_type("geometry_msgs/msg/Twsit")
