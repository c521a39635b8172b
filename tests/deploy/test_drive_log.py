"""The log of a drive: what is written comes back, bit for bit, and viewers read it."""

import os
import time
from threading import Event as Flag

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from omnidrive import PaperNoise, Pose
from omnidrive.control import Command, Pipeline, PipelineStep, Status, WheelSpeeds, WheelTorques
from omnidrive.deploy import DriveControls, MonotonicClock, SimulatedClock
from omnidrive.deploy.drive import drive
from omnidrive.deploy.drive_state import DriveState
from omnidrive.deploy.log import DriveLog, LoggedSample, read_log
from omnidrive.deploy.log.drive_log import DriveStart
from omnidrive.deploy.log.log_file import LogFile
from omnidrive.deploy.log.logged_sample import decode_sample, encode_sample
from omnidrive.deploy.remaining_reference import RemainingReference
from omnidrive.errors import CannotWrite, InvalidInput, InvalidLog, MissingExtra
from omnidrive.estimation import PoseFix, SensorReadings, State
from omnidrive.geometry import BodyTwist
from omnidrive.parameter import Bounds
from omnidrive.ros2 import decode
from tests.deploy.simulated_drive import DT, ROBOT, START, circle, controller, link

POINTS = {
    "/drive/estimate",
    "/drive/reference",
    "/drive/command",
    "/drive/sent",
    "/drive/fix",
    "/tf",
}


def logged(path, made=None, controls=None, reference=None, **options):
    """Drive on simulated time with a log; return the result and what was appended."""
    log, appended = DriveLog(path, **options), []
    add = DriveLog.add

    def noted(self, item):
        appended.append(item)
        add(self, item)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(DriveLog, "add", noted)
        result = drive(
            made or link(PaperNoise(np.random.default_rng(3))),
            Pipeline(controller()),
            reference or circle(2.0),
            rate=1.0 / DT,
            start=START,
            controls=controls,
            clock=SimulatedClock(),
            log=log,
        )
    return result, appended


def held_and_armed(controls):
    """Return a link that makes the user hold the robot, and arm it again."""
    made = link()
    reads = iter(range(10_000))

    def act(_, readings):
        k = next(reads)
        if k == 15:
            controls.hold()
        elif k == 30:
            controls.arm()
        return readings

    made.on_read.append(act)
    return made


def same(a, b):
    """Whether two samples have the same values, to the last bit."""
    if a.step is not None and a.step.state.covariance is not None:
        assert np.array_equal(a.step.state.covariance, b.step.state.covariance, equal_nan=True)
    return repr(a) == repr(b)


def test_every_number_comes_back(tmp_path):
    controls = DriveControls(arm=True)
    result, appended = logged(tmp_path / "a.mcap", held_and_armed(controls), controls)
    found = read_log(tmp_path / "a.mcap")
    samples = list(found.samples())
    written = [item for item in appended if isinstance(item, LoggedSample)]
    assert len(samples) == len(written) == found.sample_count == result.log.samples > 50
    assert all(map(same, samples, written))
    assert found.changes == result.changes
    assert len(found.segments) == 2
    assert found.segments[1].done == pytest.approx(0.75)
    assert found.complete
    assert (found.dropped, result.log.dropped, result.log.failure) == (0, 0, "")
    assert found.robot == ROBOT
    assert found.dt == DT


def test_table_of_a_log_is_that_of_the_drive(tmp_path):
    controls = DriveControls(arm=True)
    result, _ = logged(tmp_path / "a.mcap", held_and_armed(controls), controls)
    found = read_log(tmp_path / "a.mcap").run()
    for a, b in zip(found.columns, result.run.columns, strict=True):
        assert a.name == b.name
        assert a.unit == b.unit
        np.testing.assert_array_equal(a.values, b.values)
    assert found.ending == result.run.ending
    assert found.events == result.run.events
    assert read_log(tmp_path / "a.mcap").timing().summary() == result.timing.summary()


def test_readings_of_a_log_give_its_commands(tmp_path):
    """The log holds what the pipeline received: repeated offline, it commands the same."""
    controls = DriveControls(arm=True)
    logged(tmp_path / "a.mcap", held_and_armed(controls), controls)
    found, pipeline = read_log(tmp_path / "a.mcap"), Pipeline(controller())
    segments, compared, tracked = list(found.segments), 0, circle(2.0)
    for sample in found.samples():
        if segments and segments[0].number == sample.number:
            segment = segments.pop(0)
            pipeline.reset(segment.pose)
            if segment.done:
                tracked = RemainingReference(circle(2.0), segment.done)
        if sample.step is None or sample.state is DriveState.STOPPED:
            continue
        step = pipeline.step(sample.t, sample.given, tracked, found.dt)
        assert repr(step.command.value) == repr(sample.step.command.value)
        compared += 1
    assert compared > 35


def test_other_decoder_finds_no_difference(tmp_path):
    """mcap-ros2-support decodes with the definitions in the file: every message, every field."""
    made = link(PaperNoise(np.random.default_rng(1)))

    def measured(_, readings):
        return readings._replace(
            wheel_angles=(0.1, 0.2, 0.3, 0.4), wheel_torques=(1.0, 2.0, 3.0, 4.0), yaw_rate=0.5
        )

    made.on_read.append(measured)
    logged(tmp_path / "a.mcap", made, files={"notes.txt": b"carpet"})
    topics = {}
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        assert {each.name for each in reader.iter_attachments()} == {"robot.yaml", "notes.txt"}
        for schema, channel, message, theirs in reader.iter_decoded_messages():
            ours = decode(message.data, schema.name)
            assert repr(plain(theirs)) == repr(ours.as_dict()), channel.topic
            topics.setdefault(channel.topic, []).append(ours)
    assert topics.keys() >= POINTS | {"/drive/wheels", "/drive/imu", "/drive/plan", "/rosout"}
    with AnyReader([tmp_path / "a.mcap"]) as bag:  # of rosbags; there is no metadata.yaml
        counts = {each.topic: each.msgcount for each in bag.connections}
    assert counts == {topic: len(found) for topic, found in topics.items()}
    samples = list(read_log(tmp_path / "a.mcap").samples())
    driven = [each for each in samples if each.step is not None]
    for sample, estimate, sent in zip(
        driven, topics["/drive/estimate"], topics["/drive/sent"], strict=True
    ):
        assert (estimate.pose.pose.position.x, estimate.pose.pose.position.y) == (
            sample.step.state.pose[:2]
        )
        twist = sent.twist
        assert (twist.linear.x, twist.linear.y, twist.angular.z) == tuple(sample.sent)
    assert topics["/drive/wheels"][0].position.tolist() == [0.1, 0.2, 0.3, 0.4]
    assert topics["/drive/wheels"][0].effort.tolist() == [1.0, 2.0, 3.0, 4.0]
    assert topics["/rosout"][-1].msg == "stopped: the reference ends"


def plain(value):
    """Return a message of mcap-ros2-support as dictionary."""
    if hasattr(value, "__slots__"):
        return {name: plain(getattr(value, name)) for name in value.__slots__}
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    return value.tolist() if hasattr(value, "tolist") else value


SPECIAL = (float("nan"), float("inf"), -float("inf"), -0.0, 5e-324, 1.7976931348623157e308)


def random_sample(rng):
    """Return a sample with any of its parts, and numbers that are hard to write as text."""

    def numbers(count):
        special = rng.random(count) < 0.2
        values = np.where(special, rng.choice(SPECIAL, count), rng.normal(size=count) * 1e5)
        return tuple(values.tolist())

    def readings():
        fixes = [
            PoseFix(a, Pose(x, y, yaw), b, c)
            for a, x, y, yaw, b, c in (numbers(6) for _ in range(rng.integers(3)))
        ]
        wheels = [numbers(rng.integers(5)) for _ in range(2)]
        return SensorReadings(*numbers(1), *wheels, rng.choice([None, *numbers(1)]), tuple(fixes))

    def command():
        wheels = numbers(rng.integers(5))
        return (BodyTwist(*numbers(3)), WheelSpeeds(wheels), WheelTorques(wheels))[rng.integers(3)]

    twist = BodyTwist(*numbers(3)) if rng.random() < 0.5 else None
    covariance = np.reshape(numbers(9), (3, 3)) if rng.random() < 0.5 else None
    state = State(*numbers(1), Pose(*numbers(3)), twist, covariance, *numbers(1))
    parts = [None, "reference", "estimator", "supervisor", "controller"]
    computed = Command(command(), Status(int(rng.integers(3))), numbers(rng.integers(4)))
    failed = parts[rng.integers(5)]
    step = PipelineStep(state, Pose(*numbers(3)), computed, *numbers(1), failed)
    state_of_drive = list(DriveState)[rng.integers(5)]
    sample = LoggedSample(int(rng.integers(2**52)), state_of_drive, *numbers(2))
    if rng.random() < 0.8:
        sample = sample._replace(read=readings())
    if rng.random() < 0.7:
        sample = sample._replace(t=numbers(1)[0], given=readings(), step=step)
    return sample._replace(sent=command()) if rng.random() < 0.7 else sample


def test_any_sample_comes_back():
    rng = np.random.default_rng(20)
    for _ in range(100):
        sample = random_sample(rng)
        assert same(decode_sample(encode_sample(sample)), sample), sample


def test_reasons_and_notices_come_back(tmp_path):
    """A part that fails: the sample has its reason, and the log its end."""
    made = link()

    class Failing:
        def reset(self, state):
            self.count = 0

        def step(self, t, state, reference):
            self.count += 1
            if self.count > 8:
                raise ArithmeticError("singular\0matrix")
            return Command(BodyTwist(0.1, 0.0, 0.0))

    result = drive(
        made, Pipeline(Failing()), circle(2.0), rate=1.0 / DT, start=START,
        clock=SimulatedClock(), log=tmp_path / "a.mcap",
    )  # fmt: skip
    found = read_log(tmp_path / "a.mcap")
    *_, last = found.samples()
    assert last.step.failed == "controller"
    assert "ArithmeticError: singular" in last.step.command.message
    assert found.changes == result.changes
    assert found.run().ending == result.run.ending
    assert found.complete


def test_rotated_log_is_one(tmp_path, monkeypatch):
    monkeypatch.setattr("omnidrive.deploy.log.drive_log._FLUSH_PERIOD", 0.0)
    monkeypatch.setattr("omnidrive.deploy.log.drive_log._SIZES", Bounds(1.0, 1e9))
    monkeypatch.setattr("omnidrive.deploy.log.drive_log._PLAN_POSES", 10)
    result, appended = logged(tmp_path / "a.mcap", max_bytes=20_000.0)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == [path.name for path in result.log.paths]
    assert len(names) > 2
    assert names[0] == "a-0000.mcap"
    found = read_log(tmp_path / "a-0000.mcap")
    assert len(found.paths) == len(names)
    written = [item for item in appended if isinstance(item, LoggedSample)]
    assert all(map(same, list(found.samples()), written))
    assert found.complete
    assert found.changes == result.changes
    (tmp_path / names[-1]).unlink()
    assert not read_log(tmp_path / "a-0000.mcap").complete
    later = read_log(tmp_path / names[1])
    assert later.robot == ROBOT
    assert 0 < later.sample_count < found.sample_count


def start_of(clock):
    return DriveStart(link(), Pipeline(controller()), circle(2.0), DT, clock)


def test_loop_never_waits_for_the_file(tmp_path, monkeypatch):
    """The disk stands still: samples are dropped and counted, in the log and in its summary."""
    stands, add, capacity = Flag(), LogFile.add, 40
    monkeypatch.setattr("omnidrive.deploy.log.drive_log._CAPACITY", capacity)

    def slow(self, *arguments):
        stands.wait(20.0)
        add(self, *arguments)

    monkeypatch.setattr(LogFile, "add", slow)
    log = DriveLog(tmp_path / "a.mcap")
    log.open(start_of(MonotonicClock()))
    log.begin(0.0)
    count = capacity + 500
    began = time.monotonic()
    for k in range(count):
        log.add(LoggedSample(k, DriveState.RUNNING, 0.0, 0.0))
    assert time.monotonic() - began < 5.0
    stands.set()
    summary = log.close()
    found = read_log(tmp_path / "a.mcap")
    assert summary.dropped >= 490
    assert summary.samples + summary.dropped == count
    assert found.dropped == summary.dropped
    assert found.sample_count == summary.samples


def test_full_disk_ends_the_log_and_not_the_drive(tmp_path, caplog, monkeypatch):
    """A limit of the file size, which the system enforces as it does a full disk."""
    resource = pytest.importorskip("resource")
    monkeypatch.setattr("omnidrive.deploy.log.drive_log._FLUSH_PERIOD", 0.0)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, before[1]))
    try:
        result, appended = logged(tmp_path / "a.mcap", reference=circle(6.0))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert result.finished
    assert "File too large" in result.log.failure
    assert sum("the log of the drive ends early" in text for text in caplog.messages) == 1
    written = [item for item in appended if isinstance(item, LoggedSample)]
    assert result.log.samples + result.log.dropped == len(written)
    assert (tmp_path / "a.mcap").stat().st_size <= 60_000
    assert (tmp_path / "a.mcap").read_bytes().endswith(b"\x89MCAP0\r\n")
    found = read_log(tmp_path / "a.mcap")
    assert not found.complete
    assert 10 < found.sample_count == result.log.samples < len(written)
    assert all(map(same, found.samples(), written))
    with (tmp_path / "a.mcap").open("rb") as file:
        assert sum(1 for _ in make_reader(file).iter_messages()) > 0


def test_logs_that_cannot_be_written_are_refused_before_the_drive(tmp_path, monkeypatch):
    made = link()
    with pytest.raises(InvalidInput, match=r"suffix of the log of a drive is \.mcap"):
        DriveLog(tmp_path / "a.csv")
    with pytest.raises(InvalidInput, match="max_bytes"):
        DriveLog(tmp_path / "a.mcap", max_bytes=10.0)
    with pytest.raises(InvalidInput, match="max_time"):
        DriveLog(tmp_path / "a.mcap", max_time=0.0)
    with pytest.raises(CannotWrite, match="No such file"):
        logged(tmp_path / "missing" / "a.mcap", made)
    log = DriveLog(tmp_path / "b.mcap")
    log.open(start_of(SimulatedClock()))
    log.close()
    with pytest.raises(InvalidInput, match="one drive"):
        log.open(start_of(SimulatedClock()))
    monkeypatch.setitem(__import__("sys").modules, "mcap.writer", None)
    with pytest.raises(MissingExtra, match="pip install mcap"):
        logged(tmp_path / "a.mcap", made)
    assert not made.sent


def test_other_files_are_no_logs(tmp_path):
    for name, content, message in (
        ("a.mcap", b"", "is not an MCAP file"),
        ("b.mcap", b"\x89MCAP0\r\n", "is not the log of a drive"),
        ("c.mcap", b"PK\x03\x04" + bytes(100), "is not an MCAP file"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InvalidLog, match=message):
            read_log(tmp_path / name)
    with pytest.raises(InvalidLog, match="cannot read the log"):
        read_log(tmp_path / "missing.mcap")
    os.mkfifo(tmp_path / "pipe.mcap")
    with pytest.raises(InvalidLog, match="a pipe"):
        read_log(tmp_path / "pipe.mcap")
