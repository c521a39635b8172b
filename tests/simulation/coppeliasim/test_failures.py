"""Failures of the connection give one line, stop the robot and keep the log."""

import socket
import sys
import threading
from time import monotonic

import numpy as np
import pytest

from omnidrive.control import FeedforwardController
from omnidrive.errors import InvalidInput, InvalidScene, MissingExtra, PlantLost
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot import named_robot
from omnidrive.simulation import CoppeliaSimPlant, CoppeliaSimScene, Outcome, simulate
from omnidrive.testing.laws import Circle
from tests.simulation.coppeliasim.fake_scene import FIRST_JOINT, PAUSED, RUNNING, STOPPED, STOPPING
from tests.simulation.coppeliasim.fake_server import cbor, fake_server, free_port

SMALL = named_robot("small")
ORIGIN = Pose(0.0, 0.0, 0.0)
AHEAD = BodyTwist(0.5, 0.0, 0.0)


@pytest.fixture
def server():
    with fake_server(SMALL) as running:
        yield running


def plant_at(server, robot=SMALL, timeout=5.0, **options):
    scene = CoppeliaSimScene(port=server.port, timeout=timeout, **options)
    return CoppeliaSimPlant(robot, scene)


def is_stopped(server):
    return server.scene.state == STOPPED and not server.scene.targets.any()


def reply_to(name, raw):
    """Return a `mangle` that replaces the reply to one function."""
    return lambda request, reply: raw if request["func"] == name else cbor.dumps(reply)


def test_no_server_at_the_port():
    began = monotonic()
    with pytest.raises(PlantLost, match=r"no program listens at localhost:.*start CoppeliaSim"):
        CoppeliaSimPlant(SMALL, CoppeliaSimScene(port=free_port()))
    assert monotonic() - began < 5.0


def test_unknown_host():
    with pytest.raises(PlantLost, match=r"no program listens at no-such-host.invalid"):
        CoppeliaSimPlant(SMALL, CoppeliaSimScene(host="no-such-host.invalid", timeout=2.0))


def test_other_program_at_the_port():
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(PlantLost, match=r"did not reply within 0.5 s"):
            CoppeliaSimPlant(SMALL, CoppeliaSimScene(port=port, timeout=0.5))


def test_client_is_not_installed(monkeypatch):
    monkeypatch.setitem(sys.modules, "coppeliasim_zmqremoteapi_client", None)
    with pytest.raises(MissingExtra, match=r"pip install coppeliasim-zmqremoteapi-client"):
        CoppeliaSimPlant(SMALL)


@pytest.mark.parametrize(
    ("options", "fact"),
    [
        ({"model": "/robot"}, "no object '/robot'"),
        ({"body": "/omni/centre"}, "no object '/omni/centre'"),
        ({"joints": ("/omni/motor1", "/omni/motor2", "/omni/motor3", "/w")}, "no object '/w'"),
        ({"joints": ("/omni/motor1", "/omni/motor2", "/omni/motor3", "/Floor")}, "not a joint"),
    ],
)
def test_scene_without_the_robot_is_refused(server, options, fact):
    with pytest.raises(InvalidScene, match=fact):
        plant_at(server, **options)


def test_settings_for_another_robot_are_refused(server):
    with pytest.raises(InvalidInput, match="names 3 of 4 wheels of robot 'small'"):
        plant_at(server, joints=("/a", "/b", "/c"))
    with pytest.raises(InvalidInput, match=r"plant.signs names 1 of 4"):
        plant_at(server, signs=(1,))
    scene = CoppeliaSimScene(port=server.port)
    object.__setattr__(scene, "signs", (1, 1, 1, 2))  # without run-time type checks
    with pytest.raises(InvalidInput, match=r"plant\.signs are 1 or -1, got \(1, 1, 1, 2\)"):
        CoppeliaSimPlant(SMALL, scene)


@pytest.mark.parametrize(
    ("options", "fact"),
    [({"timeout": -1.0}, "timeout is -1 s, need 0.1 to 600 s"), ({"port": 0}, "port is 0, need 1")],
)
def test_settings_out_of_range_are_refused(options, fact):
    with pytest.raises(InvalidInput, match=fact):
        CoppeliaSimScene(**options)


def test_tilted_body_is_refused():
    with fake_server(SMALL, upright=False) as server, plant_at(server) as plant:
        with pytest.raises(InvalidScene, match=r"z axis of '/omni'.* does not point up"):
            plant.reset(ORIGIN)
        assert server.scene.state == STOPPED


def test_simulation_of_another_client_is_not_stopped(server):
    server.scene.startSimulation()
    with plant_at(server) as plant, pytest.raises(InvalidInput, match="this plant did not start"):
        plant.reset(ORIGIN)
    assert server.scene.state == RUNNING
    assert not server.called("stopSimulation")


def test_sample_time_must_be_a_multiple_of_the_time_step(server):
    with plant_at(server) as plant:
        plant.reset(ORIGIN)
        for dt in (0.12, 0.02):
            with pytest.raises(InvalidInput, match=rf"{dt} s is not a multiple .* 0.05 s"):
                plant.step(AHEAD, dt)
        plant.step(AHEAD, 0.15)
        assert server.scene.time == pytest.approx(0.15)


def test_robot_is_moved_only_while_the_simulation_is_stopped(server):
    home = server.scene.motion.pose
    with plant_at(server) as plant:
        plant.reset(Pose(1.0, 2.0, 3.0))
        plant.step(AHEAD, 0.1)
        plant.reset(Pose(2.0, 1.0, 0.0))
    assert [state for *_, state in server.scene.moves] == [STOPPED] * 3
    assert np.array(server.scene.motion.pose) == pytest.approx(home)
    assert server.scene.height == 0.05
    assert server.scene.finished == 2


@pytest.mark.parametrize("exception", [KeyboardInterrupt, RuntimeError])
def test_robot_is_stopped_after_any_exception(server, exception):
    def run():
        with plant_at(server) as plant:
            plant.reset(ORIGIN)
            plant.step(AHEAD, 0.1)
            assert server.scene.targets.any()
            raise exception

    with pytest.raises(exception):
        run()
    assert is_stopped(server)


def test_interrupted_call_stops_the_robot_through_a_new_client(server):
    """The old client is inside sim.step: its messages are taken for the outstanding reply."""
    plant = plant_at(server)
    plant.reset(ORIGIN)
    connection = plant._api._client.socket

    def interrupt():
        connection._deadline = -1.0
        raise KeyboardInterrupt

    connection.recv, step = interrupt, lambda: plant.step(AHEAD, 0.1)
    with pytest.raises(KeyboardInterrupt):
        step()
    assert is_stopped(server)
    assert len(server.greetings) == 2
    assert server.called("setJointTargetVelocity")[-1] == [FIRST_JOINT + 3, -0.0]


def drive(plant, duration=2.0):
    reference = Circle(duration=duration)
    start = reference.at(0.0).pose
    return simulate(plant, FeedforwardController(0.1), reference, start=start, dt=0.1)


def after(steps, action):
    """Return a hook that calls ``action`` after a number of requested steps."""
    count = 0

    def before(request):
        nonlocal count
        count += request["func"] == "sim.step"
        if count == steps:
            action()
            count += 1

    return before


def test_stopped_from_outside(server):
    def press_stop():
        server.scene.state = STOPPING

    server.before = after(11, press_stop)
    with plant_at(server) as plant:
        run = drive(plant)
    assert run.outcome is Outcome.PLANT_LOST
    assert "stopped or paused from outside at 0.5 s" in run.ending
    assert run.t == pytest.approx(np.arange(6) * 0.1)
    assert is_stopped(server)


def test_paused_from_outside(server):
    def press_pause():
        server.scene.state = PAUSED

    server.before = after(11, press_pause)
    with plant_at(server) as plant:
        run = drive(plant)
    assert run.outcome is Outcome.PLANT_LOST
    assert "its clock shows 0.5 s, not 0.6 s" in run.reason
    assert is_stopped(server)


def test_server_without_replies_during_a_run(server):
    server.before = after(11, lambda: setattr(server, "mangle", lambda request, reply: None))
    began = monotonic()
    with plant_at(server, timeout=0.5) as plant:
        run = drive(plant)
    assert monotonic() - began < 10.0
    assert run.outcome is Outcome.PLANT_LOST
    assert "did not reply within 0.5 s" in run.reason
    assert len(run.t) == 6


def test_simulator_that_never_finishes_a_step(server):
    """It always replies immediately that the step is not finished."""
    wait = cbor.dumps({"func": "_*wait*_", "args": []})
    server.before = after(11, lambda: setattr(server, "mangle", lambda request, reply: wait))
    with plant_at(server, timeout=0.5) as plant:
        run = drive(plant)
    assert run.outcome is Outcome.PLANT_LOST
    assert "did not reply within 0.5 s" in run.reason


def nested(depth):
    return b"\x81" * depth + b"\x00"


@pytest.mark.parametrize(
    ("raw", "fact"),
    [
        (b"", "is not CoppeliaSim's remote API"),
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", "is not CoppeliaSim's remote API"),
        (cbor.dumps([1, 2]), "is not CoppeliaSim's remote API"),
        (cbor.dumps({"ret": 7}), "another version"),
        (nested(1_000_000), "is not CoppeliaSim's remote API"),
        (b"\x9b" + b"\xff" * 8, "is not CoppeliaSim's remote API"),
        (b"\xa1\x63ret\x9a\x7f\xff\xff\xff", "is not CoppeliaSim's remote API"),
        (b"\xa1\x63ret\x81\x62\xff\xff", "is not CoppeliaSim's remote API"),
        (cbor.dumps({"success": True, "ret": []}), "another version of its remote API"),
        (cbor.dumps({"success": False, "error": "new\none"}), r"another version.*: new\\none"),
        (cbor.dumps({"func": "exit", "args": []}), "requests a call of 'exit', which is refused"),
        (cbor.dumps({"err": "No such\nfunction"}), r"refuses require: No such\\nfunction"),
        (bytes(2**20 + 1), "it sends 1048577 bytes, more than 1048576"),
        (b"\xa1\x63ret\x81\xc2\x41\x01", "is not CoppeliaSim's remote API"),
    ],
    ids=["empty", "http", "list", "no-list", "nested", "endless", "longer", "not-text", "version-1",
         "mismatch", "call", "refusal", "huge", "tag"],
)  # fmt: skip
def test_invalid_reply_is_refused(server, raw, fact):
    server.mangle = reply_to("zmqRemoteApi.require", raw)
    with pytest.raises(PlantLost, match=fact) as refusal:
        plant_at(server, timeout=1.0)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 400


@pytest.mark.parametrize(
    ("function", "value", "fact"),
    [
        ("getObjectPose", [1.0, 2.0], "getObjectPose, need 7 numbers"),
        ("getObjectPose", "here", "getObjectPose, need 7 numbers"),
        ("getObjectVelocity", [1.0, 2.0], "two vectors for sim.getObjectVelocity"),
        ("getSimulationTime", None, "getSimulationTime, need a number"),
        ("getJointForce", True, "getJointForce, need a number"),
        ("getJointForce", 2**60, "getJointForce, need a number"),
        ("getJointForce", 2**70, "is not CoppeliaSim's remote API"),
        ("getSimulationTime", float("nan"), "stopped or paused .* its clock shows nan s"),
    ],
)
def test_reply_of_wrong_type_ends_the_run(server, function, value, fact):
    with plant_at(server) as plant:
        plant.reset(ORIGIN)
        reply = {"ret": [] if value is None else [value]}
        server.mangle = reply_to(f"sim.{function}", cbor.dumps(reply))
        with pytest.raises(PlantLost, match=fact):
            plant.step(AHEAD, 0.1)
        assert is_stopped(server)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_pose_that_is_not_finite_ends_the_run(server, value):
    with plant_at(server) as plant:
        invalid = cbor.dumps({"ret": [[value] * 7]})
        server.before = after(
            11, lambda: setattr(server, "mangle", reply_to("sim.getObjectPose", invalid))
        )
        run = drive(plant)
    assert run.outcome is Outcome.PLANT_FAILED
    assert is_stopped(server)


def test_missing_function_is_reported(server):
    server.mangle = reply_to(
        "zmqRemoteApi.info", cbor.dumps({"ret": [{"getObject": {"func": {}}}]})
    )
    with pytest.raises(PlantLost, match=r"has no sim.getObjectPose: is it too old"):
        plant_at(server, interface="signals")


def test_request_to_a_busy_server_is_repeated(server):
    """A callback of another client is running."""
    busy, requests = cbor.dumps({"func": "_*repeat*_", "args": []}), []

    def mangle(request, reply):
        requests.append(request["func"])
        return busy if len(requests) in {3, 4} else cbor.dumps(reply)

    server.mangle = mangle
    with plant_at(server) as plant:
        plant.reset(ORIGIN)
    assert requests[2:5] == ["sim.getObject"] * 3


@pytest.mark.parametrize("reply", [float("nan"), float("inf"), -1, 2**60, None, "15"])
def test_invalid_handle_is_refused(server, reply):
    server.mangle = reply_to("sim.getObject", cbor.dumps({"ret": [reply]}))
    with pytest.raises((InvalidScene, PlantLost), match=r"no object '/omni'|need a number"):
        plant_at(server)


def test_close_releases_threads_and_globals(server):
    """The plant can be used again after close."""
    main, before = vars(sys.modules["__main__"]), threading.active_count()
    names = set(main)
    plant = plant_at(server)
    for _ in range(2):
        plant.reset(ORIGIN)
        plant.step(AHEAD, 0.1)
        plant.close()
        plant.close()
    assert set(main) == names
    assert threading.active_count() == before
    assert is_stopped(server)


def test_first_request_names_version_2(server):
    with plant_at(server):
        pass
    (greeting,) = server.greetings
    assert greeting["func"] == "zmqRemoteApi.require"
    assert greeting["args"] == ["sim"]
    assert greeting["ver"] == 2
    assert greeting["lang"] == "python"
