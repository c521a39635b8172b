"""Collisions with obstacles of a map and with moving obstacles."""

from math import cos, hypot, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.maps import OccupancyGrid
from omnidrive.robot import named_robot
from omnidrive.simulation import MovingObstacle, MujocoPlant
from omnidrive.simulation.disturbances.disturbances import Disturbances, Payload
from omnidrive.simulation.mujoco.obstacle_boxes import ObstacleBoxes, merge_cells

SMALL = named_robot("small")
REST = BodyTwist(0.0, 0.0, 0.0)
cells = arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 9)))


@given(cells)
def test_boxes_cover_the_occupied_cells_once(occupied):
    covered = np.zeros(occupied.shape, int)
    for left, right, bottom, top in merge_cells(occupied):
        covered[bottom:top, left:right] += 1
    np.testing.assert_array_equal(covered, occupied)


def test_rectangle_is_one_box():
    occupied = np.zeros((20, 30), bool)
    occupied[4:15, 7:29] = True
    assert merge_cells(occupied).tolist() == [[7, 29, 4, 15]]


@given(
    cells, st.floats(-4, 4), st.booleans(), st.lists(st.tuples(*[st.floats(-3, 6)] * 2), min_size=1)
)
def test_distance_of_the_nearest_box_equals_the_clearance(occupied, yaw, walled, points):
    """For any sequence of points; the grid computes its clearance with another method."""
    grid = OccupancyGrid(occupied, 0.5, (0.7, -0.4), walled=walled, yaw=yaw)
    boxes, reach = ObstacleBoxes(grid), 1.0
    for point in points:
        clearance = max(0.0, float(grid.clearance(np.array([point]))[0]))
        near = boxes.nearest(*point, reach, 16)
        u, v = boxes.to_map_frame(*point)
        gaps = [
            hypot(max(left - u, u - right, 0.0), max(bottom - v, v - top, 0.0))
            for left, right, bottom, top in near
        ]
        assert gaps == sorted(gaps)
        if clearance < reach - 1e-9:
            assert gaps[0] == pytest.approx(clearance, abs=1e-9)
        elif clearance > reach + 1e-9:
            assert not gaps
        assert np.isfinite(near).all()


def block(yaw=0.0, *, walled=False):
    """Return a map of 10 m by 10 m with a block of 0.5 m by 0.2 m, away from W's origin."""
    occupied = np.zeros((200, 200), bool)
    occupied[95:105, 120:124] = True
    return OccupancyGrid(occupied, 0.05, (3.0, -2.0), walled=walled, yaw=yaw)


def velocity(angle, speed=0.5):
    return BodyTwist(speed * cos(angle), speed * sin(angle), 0.0)


@pytest.mark.parametrize("wheels", ["ball", "rollers"])
@pytest.mark.parametrize("yaw", [0.0, 0.7])
@pytest.mark.parametrize("angle", [0.1, 2.0, 4.4])
def test_obstacle_stops_the_robot(wheels, yaw, angle):
    grid = block(yaw)
    x, y = grid.centre(100, 122)
    plant = MujocoPlant(SMALL, wheels, obstacles=grid)
    plant.reset(Pose(x + cos(angle), y + sin(angle), 0.0))
    states = [plant.step(velocity(angle + pi), 0.1) for _ in range(25)]
    gaps = grid.clearance(np.array([s.pose[:2] for s in states])) - SMALL.body_radius
    first = next(k for k, s in enumerate(states) if s.collisions)
    assert gaps[:first].min() > -1.1e-3  # the collision is counted a step of 2 ms later
    assert gaps.min() > -5e-3  # the contact is elastic
    assert gaps[first:].min() == pytest.approx(0.0, abs=5e-3)
    assert states[-1].collisions >= 1


@pytest.mark.parametrize("wheels", ["ball", "rollers"])
@pytest.mark.parametrize("payload", [None, Payload(1.0, 0.0, 0.0)])
def test_robot_pressed_to_a_wall_has_friction(wheels, payload):
    """The commanded velocity points into the wall; friction there prevents sliding along it."""
    grid = OccupancyGrid(np.zeros((80, 80), bool), 0.1, walled=True)
    plant = MujocoPlant(SMALL, wheels, obstacles=grid)
    plant.reset(Pose(7.9 - SMALL.body_radius, 2.0, 0.0))
    plant.apply(Disturbances(payload=payload))
    states = [plant.step(BodyTwist(0.5, 0.3, 0.0), 0.1) for _ in range(30)]
    assert states[-1].collisions > 0
    assert abs(states[-1].pose.y - 2.0) < 0.1


def test_second_contact_is_a_second_collision():
    grid = block()
    x, y = grid.centre(100, 124)
    plant = MujocoPlant(SMALL, "ball", obstacles=grid)
    plant.reset(Pose(x + 0.6, y, 0.0))
    counts = [plant.step(velocity(0.0 if 15 <= k < 23 else pi), 0.1).collisions for k in range(40)]
    assert counts[14] == counts[25] == 1
    assert counts[-1] == 2
    assert plant.reset(Pose(x + 0.6, y, 0.0)).collisions == 0


@pytest.mark.parametrize("walled", [False, True])
def test_border_of_a_walled_map_is_an_obstacle(walled):
    grid = OccupancyGrid(np.zeros((20, 20), bool), 0.1, walled=walled)
    plant = MujocoPlant(SMALL, "ball", obstacles=grid)
    plant.reset(Pose(1.0, 1.0, 0.0))
    state = [plant.step(velocity(0.3), 0.5) for _ in range(6)][-1]
    assert (state.pose.x < 2.0 - SMALL.body_radius + 5e-3) == walled
    assert (state.collisions > 0) == walled


@pytest.mark.parametrize("wheels", ["ball", "rollers"])
def test_distant_obstacles_do_not_change_the_motion(wheels):
    alone, with_map = MujocoPlant(SMALL, wheels), MujocoPlant(SMALL, wheels, obstacles=block())
    start = Pose(8.4, 2.9, 0.3)
    before = [plant.reset(start) for plant in (alone, with_map)]
    after = [plant.step(BodyTwist(0.0, 0.2, 0.4), 0.5) for plant in (alone, with_map)]
    assert repr(before[0]) == repr(before[1])
    assert repr(after[0]) == repr(after[1])


def test_robot_placed_inside_an_obstacle_can_leave():
    occupied = np.zeros((100, 100), bool)
    occupied[:, :50] = True
    grid = OccupancyGrid(occupied, 0.1, walled=False)
    plant = MujocoPlant(SMALL, "ball", obstacles=grid)
    plant.reset(Pose(4.9, 5.0, 0.0))
    at_rest = plant.step(REST, 1.0)
    assert at_rest.collisions == 1
    assert at_rest.pose.x == pytest.approx(4.9, abs=1e-4)
    left = [plant.step(velocity(0.0), 0.1) for _ in range(15)][-1]
    assert left.pose.x > 5.0 + SMALL.body_radius
    back = [plant.step(velocity(pi), 0.1) for _ in range(15)][-1]
    assert back.collisions == 2
    assert back.pose.x == pytest.approx(5.0 + SMALL.body_radius, abs=5e-3)


def test_moving_obstacle_follows_its_path():
    disc = MovingObstacle(0.3, (1.0, 2.0, 4.0), ((0.0, 0.0), (1.0, 0.0), (1.0, 4.0)))
    assert [disc.position(t) for t in (0.0, 1.0, 1.25, 2.0, 3.0, 4.0, 9.0)] == [
        (0.0, 0.0), (0.0, 0.0), (0.25, 0.0), (1.0, 0.0), (1.0, 2.0), (1.0, 4.0), (1.0, 4.0),
    ]  # fmt: skip
    looped = MovingObstacle(0.3, (0.0, 1.0, 2.0), ((0.0, 0.0), (1.0, 0.0), (0.0, 0.0)), loop=True)
    assert looped.position(2.5) == looped.position(0.5) == (0.5, 0.0)
    assert MovingObstacle(0.3, (0.0,), ((2.0, 1.0),), loop=True).position(7.0) == (2.0, 1.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0, (0.0,), ((0.0, 0.0),)), "radius must be positive, got 0"),
        ((float("nan"), (0.0,), ((0.0, 0.0),)), "radius must be positive, got nan"),
        ((0.1, (0.0, 1.0), ((0.0, 0.0),)), "2 times and 1 points"),
        ((0.1, (), ()), "0 times and 0 points"),
        ((0.1, (0.0, 0.0), ((0.0, 0.0), (1.0, 0.0))), "times must increase"),
        ((0.1, (-1.0,), ((0.0, 0.0),)), "from 0 s or later"),
        ((0.1, (0.0,), ((0.0, float("inf")),)), "must be finite"),
    ],
)
def test_invalid_path_is_refused(arguments, message):
    with pytest.raises(InvalidInput, match=message):
        MovingObstacle(*arguments)


@pytest.mark.parametrize("wheels", ["ball", "rollers"])
def test_moving_obstacle_pushes_the_robot(wheels):
    disc = MovingObstacle(0.2, (0.5, 2.5), ((1.0, 0.0), (0.0, 0.0)))
    plant = MujocoPlant(SMALL, wheels, moving=[disc])
    plant.reset(Pose(0.0, 0.0, 0.0))
    assert plant.step(REST, 0.9).collisions == 0
    state = [plant.step(REST, 0.2) for _ in range(10)][-1]
    assert state.collisions >= 1
    assert hypot(state.pose.x, state.pose.y) > 0.2 + SMALL.body_radius - 0.02
    again = plant.reset(Pose(0.0, 0.0, 0.0))
    assert again.collisions == 0
    assert plant.data.mocap_pos[0, :2].tolist() == [1.0, 0.0]


def test_too_many_moving_obstacles_are_refused():
    disc = MovingObstacle(0.2, (0.0,), ((3.0, 0.0),))
    with pytest.raises(InvalidInput, match="33 moving obstacles, need at most 32"):
        MujocoPlant(SMALL, "ball", moving=[disc] * 33)
