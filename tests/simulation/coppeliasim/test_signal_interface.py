"""Interface by the signals of the scene that the paper's author published."""

import numpy as np
import pytest

from omnidrive.errors import InvalidInput, InvalidScene, PlantLost
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot import named_robot
from omnidrive.simulation import CoppeliaSimPlant, CoppeliaSimScene
from tests.laws import test_plants as laws
from tests.simulation.coppeliasim.fake_server import fake_server

PAPER = named_robot("paper")


def plant_at(server, robot=PAPER):
    return CoppeliaSimPlant(
        robot, CoppeliaSimScene(port=server.port, timeout=5.0, interface="signals")
    )


def authors_matrix(arm):
    """Return the author's matrix of motor speeds per body twist; `arm` is bodyDiameter / 2."""
    s = 0.7071
    return np.array([[-s, s, -arm], [s, s, -arm], [s, -s, -arm], [-s, -s, -arm]]) * (2.0 / 0.1)


@pytest.fixture
def server():
    with fake_server(PAPER, signals=True) as running:
        yield running


def test_starts_at_the_given_pose(server):
    with plant_at(server) as plant:
        start = Pose(1.0, -2.0, 4.0)
        assert np.array(plant.reset(start).pose) == pytest.approx(start, abs=1e-6)  # 32-bit floats


@pytest.mark.parametrize("twist", laws.TWISTS)
def test_mean_velocity_equals_the_command(server, twist):
    with plant_at(server) as plant:
        states = laws.drive(plant, Pose(0.0, 0.0, 0.0), twist, 40)
    velocity = np.subtract(states[-1].pose, states[9].pose) / 3.0
    assert velocity == pytest.approx(np.array(twist), abs=5e-4)


@pytest.mark.parametrize("twist", [*laws.TWISTS, BodyTwist(0.3, -0.2, 0.7)])
def test_motor_commands_equal_those_of_the_authors_matrix(server, twist):
    """With the correct distance of the wheels, 0.7071 m; the author uses 0.5 m."""
    with plant_at(server) as plant:
        plant.reset(Pose(0.0, 0.0, 0.0))
        plant.step(twist, 0.1)
        name, packed = server.called("setBufferSignal")[-1]
        assert name == "omni_reqVelocities0"
        expected = authors_matrix(PAPER.effective_radius) @ np.array(twist)
        assert np.frombuffer(packed, "<f4") == pytest.approx(expected, rel=1e-4, abs=1e-4)


def test_assumed_effective_radius_gives_the_authors_commands(server):
    with plant_at(server, named_robot("paper", assumed_effective_radius=0.5)) as plant:
        plant.reset(Pose(0.0, 0.0, 0.0))
        plant.step(BodyTwist(0.1, 0.2, 0.3), 0.1)
        _, packed = server.called("setBufferSignal")[-1]
        expected = authors_matrix(0.5) @ np.array([0.1, 0.2, 0.3])
        assert np.frombuffer(packed, "<f4") == pytest.approx(expected, rel=1e-4, abs=1e-4)


def test_yaw_is_continuous_over_whole_turns(server):
    with plant_at(server) as plant:
        states = laws.drive(plant, Pose(0.0, 0.0, 3.0), BodyTwist(0.0, 0.0, 3.0), 30)
    yaw = np.array([s.pose.yaw for s in states])
    assert (np.diff(yaw) > 0.0).all()
    assert yaw[-1] == pytest.approx(3.0 + 9.0, abs=0.3)


def test_signal_frame_differs_from_the_body_frame(server):
    """The script reports the pose of a point beside the body's origin, rotated by pi."""
    write_signals = server.scene._write_signals

    def write_other_pose():
        write_signals()
        x, y, yaw = server.scene.motion.pose
        reported = [x + 0.1 * np.cos(yaw), y + 0.1 * np.sin(yaw), yaw + np.pi]
        server.scene.signal["omni_pose0"] = np.array(reported, "<f4").tobytes()

    server.scene._write_signals = write_other_pose
    with plant_at(server) as plant:
        start = Pose(1.0, -2.0, 0.7)
        assert np.array(plant.reset(start).pose) == pytest.approx(start, abs=1e-6)
        state = plant.step(BodyTwist(0.0, 0.0, 0.0), 0.1)
        assert np.array(state.pose) == pytest.approx(start, abs=1e-4)
        states = [plant.step(BodyTwist(0.0, 0.0, 0.5), 0.1) for _ in range(20)]
        rates = np.subtract(states[-1].pose, states[-2].pose) / 0.1
        yaw = states[-1].pose.yaw
        turned = np.array([np.cos(yaw) * rates[0] + np.sin(yaw) * rates[1],
                           np.cos(yaw) * rates[1] - np.sin(yaw) * rates[0]])  # fmt: skip
        assert np.array(states[-1].twist[:2]) == pytest.approx(turned, abs=5e-3)
        assert abs(turned[1]) > 0.04


def test_scene_without_signals_is_refused():
    with fake_server(PAPER) as server, plant_at(server) as plant:
        with pytest.raises(InvalidScene, match="does not set the signal 'omni_bodyDiameter0'"):
            plant.reset(Pose(0.0, 0.0, 0.0))
        assert server.scene.state == 0


def test_scene_of_another_robot_is_refused(server):
    fact = r"is 1 m, but robot 'small' needs 0\.35"
    with (
        plant_at(server, named_robot("small")) as plant,
        pytest.raises(InvalidScene, match=fact),
    ):
        plant.reset(Pose(0.0, 0.0, 0.0))


@pytest.mark.parametrize("value", [b"short", 3.0, "x"])
def test_invalid_pose_signal_ends_the_run(server, value):
    write_signals = server.scene._write_signals
    with plant_at(server) as plant:
        plant.reset(Pose(0.0, 0.0, 0.0))
        server.scene._write_signals = lambda: (
            write_signals(),
            server.scene.signal.update(omni_pose0=value),
        )
        with pytest.raises(PlantLost, match="omni_pose0"):
            plant.step(BodyTwist(0.1, 0.0, 0.0), 0.1)
        assert server.scene.state == 0


def test_other_number_of_wheels_is_refused(server):
    with pytest.raises(InvalidInput, match="for the paper's four wheels"):
        plant_at(server, named_robot("kiwi"))
