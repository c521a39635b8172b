"""Logs from elsewhere: bounded by their size, and refused in one sentence."""

import warnings
from contextlib import suppress
from math import inf, nan
from random import Random

import numpy as np
import pytest

pytest.importorskip("mcap")

from mcap.writer import CompressionType, Writer

from omnidrive.control import WheelSpeeds
from omnidrive.deploy.drive_state import DriveState, StateChange
from omnidrive.deploy.identification_log import identification_log
from omnidrive.deploy.log import LoggedSample, read_log
from omnidrive.deploy.log import logged_drive as logged_drive_module
from omnidrive.deploy.log.log_file import EVENTS, SAMPLES, LogFile
from omnidrive.deploy.log.logged_event import (
    Continued,
    Dropped,
    Event,
    decode_event,
    encode_event,
)
from omnidrive.deploy.log.logged_sample import Segment, encode_sample
from omnidrive.deploy.log.record_reader import MAX_EXPANSION, read_records
from omnidrive.deploy.log_comparison import comparison_tables
from omnidrive.errors import InvalidLog, OmnidriveError
from omnidrive.geometry import BodyTwist, Pose
from tests.deploy.test_drive_log import logged


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """The log of a drive, as read."""
    path = tmp_path_factory.mktemp("drive") / "a.mcap"
    logged(path)
    return read_log(path)


def write(path, drive, samples, events=(), metadata=None):
    """Write a log with the description of another one."""
    file = LogFile(path, {**drive.metadata, **(metadata or {})}, drive.files)
    for item in (*drive.changes, *events):
        file.add(EVENTS, 1, encode_event(item, 0, 0))
    for k, sample in enumerate(samples):
        file.add(SAMPLES, k, encode_sample(sample))
    file.end({"last": "1"})
    return path


def shown(path):
    """Do with a log what the commands do."""
    log = read_log(path)
    for act in (log.run, log.timing, lambda: identification_log(log)):
        with suppress(InvalidLog):
            act()
    return comparison_tables([log, log], ["a", "b"])


def test_samples_out_of_order_are_refused(tmp_path, drive):
    samples = list(drive.samples())
    for k, wrong in enumerate((samples[::-1], samples[:9] + samples[5:], [samples[0]] * 3)):
        with pytest.raises(InvalidLog, match=r"sample \d+ is not after sample \d+"):
            shown(write(tmp_path / f"{k}.mcap", drive, wrong))
    late = [s._replace(t=-s.t) if s.step is not None else s for s in samples]
    with pytest.raises(InvalidLog, match=r"the time of sample \d+ is not after"):
        shown(write(tmp_path / "late.mcap", drive, late))


@pytest.mark.parametrize("wild", [nan, inf, -1.0, 1e300])
def test_times_of_motions_are_bounded(wild):
    """They give the number of samples of a replay."""
    for item in (Segment(0, Pose(0.0, 0.0, 0.0), wild, 0.0), Continued(0, wild, "a.csv")):
        with pytest.raises(InvalidLog, match="an event is malformed: a time of "):
            decode_event(encode_event(item, 0, 0))


def test_a_log_is_compared_with_itself_and_with_short_ones(tmp_path, drive):
    path = write(tmp_path / "a.mcap", drive, drive.samples())
    assert shown(path)
    driven = [s for s in drive.samples() if s.step is not None]
    with pytest.raises(InvalidLog, match="the controller did not drive the robot"):
        shown(write(tmp_path / "empty.mcap", drive, []))
    for count in (1, 2, 3):
        assert shown(write(tmp_path / f"{count}.mcap", drive, driven[:count]))


WILD = (nan, inf, -inf, 1e300, -1e300, 0.0, -1.0, 2.0**53)


def spoilt(rng, sample):
    """Return a sample with some wild number, or without a part."""
    wild = rng.choice(WILD)
    step = sample.step
    kind = rng.randrange(8)
    if kind == 0:
        return sample._replace(late=wild, busy=rng.choice(WILD))
    if kind == 1:
        return sample._replace(read=None, sent=None)
    if step is None:
        return sample
    if kind == 2:
        return sample._replace(t=wild)
    if kind == 3:
        state = step.state._replace(pose=Pose(wild, 0.0, wild), fix_age=wild)
        return sample._replace(step=step._replace(state=state, target=Pose(wild, wild, 0.0)))
    values = (
        BodyTwist(wild, wild, 1.0), WheelSpeeds((wild,) * 4), WheelSpeeds((1.0,) * 3),
        WheelSpeeds((1.0,) * 4),
    )  # fmt: skip
    command = step.command._replace(value=rng.choice(values))
    if kind == 4:
        command = step.command._replace(details=(wild,) * rng.randrange(4))
    return sample._replace(step=step._replace(command=command), sent=rng.choice(values))


def check_spoilt(tmp_path, drive, seeds):
    samples = list(drive.samples())[:25]
    for seed in seeds:
        rng = Random(seed)
        changed = [spoilt(rng, s) if rng.random() < 0.1 else s for s in samples]
        extra = [
            Segment(rng.choice((-5, 0, 9, 10**18)), Pose(0.0, nan, 0.0), rng.choice(WILD), 0.0),
            Event(rng.choice(WILD), "x\ny"),
            StateChange(rng.choice(WILD), DriveState.HOLDING, "\x1b[2J"),
            Dropped(rng.choice((0, -7, 10**30))),
        ]
        events = [each for each in extra if rng.random() < 0.2]
        metadata = {"dt": rng.choice(("nan", "1e-300", "0", "", "x"))} if seed % 20 == 0 else None
        path = write(tmp_path / "a.mcap", drive, changed, events, metadata)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            refusals = []
            try:
                shown(path)
            except OmnidriveError as error:
                refusals.append(str(error))
        assert all(map(str.isprintable, refusals)), seed


def test_spoilt_samples_are_shown_or_refused(tmp_path, drive):
    check_spoilt(tmp_path, drive, range(8))


@pytest.mark.long
def test_many_spoilt_samples_are_shown_or_refused(tmp_path, drive):
    check_spoilt(tmp_path, drive, range(1000))


def foreign(path, compression=CompressionType.NONE, chunk_size=1 << 26):
    """Return a writer of a log with the metadata of a drive only."""
    writer = Writer(str(path), compression=compression, chunk_size=chunk_size)
    writer.start(profile="ros2")
    return writer


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
def test_chunks_that_expand_too_much_are_refused(tmp_path, compression):
    writer = foreign(tmp_path / "a.mcap", compression)
    channel = writer.register_channel("/x", "cdr", 0)
    writer.add_message(channel, 0, bytes(20_000_000), 0)
    writer.finish()
    assert (tmp_path / "a.mcap").stat().st_size < 100_000
    with pytest.raises(InvalidLog, match=rf"expands from .* bytes, at most {MAX_EXPANSION} times"):
        list(read_records(tmp_path / "a.mcap"))


def test_chunks_of_a_robot_at_rest_expand_much_less(tmp_path):
    """The most uniform log that a drive writes: nothing but its times changes."""
    found = LogFile(tmp_path / "a.mcap", {}, {})
    for k in range(1000):
        found.add(
            SAMPLES, 20_000_000 * k, encode_sample(LoggedSample(k, DriveState.IDLE, 0.0, 0.0))
        )
    found.end({})
    size = (tmp_path / "a.mcap").stat().st_size
    content = sum(len(r.data) for r in read_records(tmp_path / "a.mcap") if hasattr(r, "channel"))
    assert content < MAX_EXPANSION / 4 * size


def test_records_of_the_kind_zero_end_the_reading(tmp_path):
    writer = foreign(tmp_path / "a.mcap")
    channel = writer.register_channel("/x", "cdr", 0)
    for k in range(9):
        writer.add_message(channel, k, b"", k)
    writer.finish()
    content = (tmp_path / "a.mcap").read_bytes()
    head = b"\x05" + (22).to_bytes(8, "little")
    assert content.count(head) == 9
    (tmp_path / "a.mcap").write_bytes(content.replace(head, bytes(9), 1))
    with pytest.raises(InvalidLog, match=r"invalid kind 0|checksum"):
        list(read_records(tmp_path / "a.mcap"))


@pytest.mark.parametrize("same", [True, False])
def test_attachments_are_counted_once(tmp_path, monkeypatch, drive, same):
    """The work is proportional to the number of records: no sum over all files for each."""
    summed = []

    def counted(numbers, *start):
        numbers = list(numbers)
        summed.append(len(numbers))
        return sum(numbers, *start)

    monkeypatch.setattr(logged_drive_module, "sum", counted, raising=False)
    monkeypatch.setattr(logged_drive_module, "_MAX_FILES", 100)
    path = tmp_path / "a.mcap"
    writer = foreign(path)
    writer.add_metadata("omnidrive.drive", dict(drive.metadata))
    for k in range(500):
        writer.add_attachment(0, 0, "x" if same else f"x{k}", "", b"1")
    channel = writer.register_channel("/x", "cdr", 0)
    for k in range(2000):
        writer.add_message(channel, k, b"", k)
    writer.finish()
    if same:
        assert read_log(path).sample_count == 0
    else:
        with pytest.raises(InvalidLog, match="more than 100 files"):
            read_log(path)
    assert sum(summed) < 5000


def test_too_many_samples_are_not_kept(tmp_path, monkeypatch, drive):
    monkeypatch.setattr(logged_drive_module, "MAX_SAMPLES", 10)
    path = write(tmp_path / "a.mcap", drive, drive.samples())
    with pytest.raises(InvalidLog, match="samples, at most 10"):
        read_log(path).run()


def test_a_truncated_log_is_read_up_to_its_last_chunk(tmp_path, drive):
    path = write(tmp_path / "a.mcap", drive, drive.samples())
    content = path.read_bytes()
    for length in np.linspace(0, len(content) - 1, 20).astype(int).tolist():
        path.write_bytes(content[:length])
        try:
            assert read_log(path).sample_count <= drive.sample_count
        except InvalidLog:
            assert length < len(content) / 2
