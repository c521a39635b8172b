"""Logs of killed processes, and damaged and hostile logs."""

import struct
import subprocess
import sys
import time
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import zstandard
from lz4 import frame as lz4
from mcap.data_stream import RecordBuilder
from mcap.records import Attachment, Channel, Chunk, Header, Message, Metadata, Schema

from omnidrive.deploy.log import read_log
from omnidrive.deploy.log.record_reader import MAX_RECORD
from omnidrive.errors import InvalidLog, InvalidRobot, OmnidriveError
from tests.deploy.logging_process import RATE
from tests.deploy.simulated_drive import circle, link
from tests.deploy.test_drive_log import logged
from tests.memory import allocates_at_most

MAGIC = b"\x89MCAP0\r\n"
MAX_LOST = 0.5  # s


@cache
def valid():
    """Return the bytes of a short log in several chunks, and its number of samples."""
    with TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setattr("omnidrive.deploy.log.drive_log._FLUSH_PERIOD", 0.0)
        patch.setattr("omnidrive.deploy.log.drive_log._PLAN_POSES", 5)
        result, _ = logged(Path(folder) / "a.mcap", link(), reference=circle(0.5))
        return (Path(folder) / "a.mcap").read_bytes(), result.log.samples


def read(path, content):
    """Read all of a log with these bytes; return its number of samples."""
    path.write_bytes(content)
    found = read_log(path)
    assert sum(1 for _ in found.samples()) == found.sample_count
    found.timing()
    if found.has_steps:
        assert len(found.run().t) <= found.sample_count
    assert len(found.robot.mounts) > 2
    return found


def outcome(path, content):
    """Return the log with these bytes, or the error that its reader raises."""
    try:
        return read(path, content)
    except (InvalidLog, InvalidRobot) as error:
        return error


@pytest.mark.long
@pytest.mark.parametrize("count", [30])
def test_kill_loses_at_most_half_a_second(count, tmp_path):
    """The driving process is killed at random moments: what it wrote is readable."""
    rng = np.random.default_rng(count)
    for k in range(count):
        path = tmp_path / f"{k}.mcap"
        command = [sys.executable, "-m", "tests.deploy.logging_process", str(path)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert process.stdout.readline().startswith("ready")
        while not (path.exists() and path.stat().st_size > 20_000):
            time.sleep(0.01)
        time.sleep(rng.uniform(0.2, 1.5))
        process.kill()
        killed = time.monotonic()
        process.wait()
        process.stdout.close()
        found = read_log(path)
        assert not found.complete
        samples = list(found.samples())
        last = max(each.read.stamp for each in samples if each.read is not None)
        assert killed - last + 1.0 / RATE >= 0.0
        assert killed - last <= MAX_LOST, (count, k)
        late = [each for each in samples if each.late > 0.1]  # of a busy computer
        assert len(samples) >= samples[-1].number - 100 * len(late) - 5
        assert found.run().ending.endswith("the log ends before the drive")


def positions(rng, count):
    """Return sorted positions in the valid log."""
    return sorted(rng.choice(len(valid()[0]), count, replace=False).tolist())


AMOUNTS = [pytest.param(15, id="some"), pytest.param(3000, id="many", marks=pytest.mark.long)]


@pytest.mark.parametrize("count", AMOUNTS)
def test_log_that_is_cut_anywhere_is_read_up_to_there(count, tmp_path):
    content, samples = valid()
    before, begun = 0, False
    for at in positions(np.random.default_rng(7), count):
        found = outcome(tmp_path / "a.mcap", content[:at])
        if isinstance(found, OmnidriveError):
            assert not begun, (at, found)
            assert "is not" in str(found) or "no robot.yaml" in str(found), (at, found)
            continue
        begun = True
        assert before <= found.sample_count <= samples, at
        before = found.sample_count
    assert before > 0.8 * samples


@pytest.mark.parametrize("count", AMOUNTS)
def test_damaged_logs_are_named(count, tmp_path):
    """Some bytes are others: an error of one line, or an effect that does no harm."""
    rng = np.random.default_rng(8)
    content, samples = valid()
    refused = 0
    for at in positions(rng, count):
        damaged = bytearray(content)
        damaged[at] ^= 1 << int(rng.integers(8))
        found = outcome(tmp_path / "a.mcap", bytes(damaged))
        if isinstance(found, OmnidriveError):
            assert "\n" not in str(found), at
            refused += 1
        else:
            assert found.sample_count <= samples, at
    assert 0.2 * count < refused < count


def records(*parts):
    out = RecordBuilder()
    for each in parts:
        each.write(out)
    return out.end()


ABOUT = Metadata("omnidrive.drive", {"format": "omnidrive-drive-log-1", "dt": "0.1", "drive": "1"})


def chunked(data, compression, size, packed):
    chunk = Chunk(compression, packed, 0, 0, 0, size)
    return MAGIC + records(Header("ros2", ""), ABOUT, chunk)


def bomb(size):
    """Return a log whose chunk of a few kB holds 1 GB, as the size in it says or denies."""
    data = zstandard.ZstdCompressor(level=1).compressobj()
    packed = b"".join(data.compress(bytes(1 << 20)) for _ in range(1 << 10)) + data.flush()
    return chunked(b"", "zstd", size, packed)


def lz4_bomb(size):
    context = lz4.LZ4FrameCompressor()
    packed = context.begin()
    packed += b"".join(context.compress(bytes(1 << 20)) for _ in range(256)) + context.flush()
    return chunked(b"", "lz4", size, packed)


def announced(size):
    """Return a chunk whose frame announces 2^60 bytes."""
    packed = b"\x28\xb5\x2f\xfd\xe0" + struct.pack("<Q", 1 << 60) + b"\x01\x00\x00"
    return chunked(b"", "zstd", size, packed)


def messages(topic, encoding, schema, data):
    parts = (
        Schema(1, b"", "ros2msg", schema),
        Channel(1, topic, encoding, {}, 1),
        Message(1, 0, data, 0, 0),
    )
    inner = records(*parts)
    return chunked(inner, "", len(inner), inner)


HOSTILE = {
    "bomb": (lambda: bomb(1 << 20), "does not hold"),
    "large bomb": (lambda: bomb(1 << 30), "at most"),
    "lz4 bomb": (lambda: lz4_bomb(1 << 20), "does not hold"),
    "announced": (lambda: announced(100), "damaged chunk|does not hold"),
    "huge record": (lambda: MAGIC + struct.pack("<BQ", 1, 1 << 62), "a record of 4611686"),
    "huge text": (
        lambda: MAGIC + struct.pack("<BQI", 1, 8, 0xFFFFFFFF) + bytes(4),
        "is not the log of a drive|damaged header",
    ),
    "other compression": (lambda: chunked(b"", "snappy", 4, b"abcd"), "compressed by snappy"),
    "other encoding": (
        lambda: messages("/drive/samples", "json", "x", b"{}"),
        "have the encoding json, need cdr",
    ),
    "other sample": (
        lambda: messages("/drive/samples", "cdr", "std_msgs/msg/Float64MultiArray", b"\0\1\0\0xx"),
        "a sample is malformed",
    ),
    "other event": (
        lambda: messages("/drive/events", "cdr", "x", b"\0\1\0\0\xff\xff\xff\xff" * 3),
        "an event is malformed",
    ),
    "attached damage": (
        lambda: (
            MAGIC
            + records(Header("ros2", ""), ABOUT)
            + records(Attachment(0, 0, "a", "b", b"data")).replace(b"data", b"date")
        ),
        "damaged attachment",
    ),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_logs_are_refused_with_little_memory(name, tmp_path):
    make, message = HOSTILE[name]
    content = make()
    with allocates_at_most(3 * MAX_RECORD), pytest.raises(InvalidLog, match=message):
        read(tmp_path / "a.mcap", content)
