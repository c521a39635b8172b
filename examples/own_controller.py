"""A custom controller: any object with the methods `reset` and `step`."""

from math import hypot

import omnidrive as od


class PureProportional:
    """Proportional control towards the current reference pose."""

    def reset(self, state: od.State) -> None:
        """Do nothing: the controller has no state."""

    def step(self, t: float, state: od.State, reference: od.Reference) -> od.Command:
        """Return a body twist of 3 1/s times the pose error."""
        pose, target = state.pose, reference.at(t).pose
        velocity = od.WorldTwist(
            3.0 * (target.x - pose.x),
            3.0 * (target.y - pose.y),
            3.0 * od.wrap(target.yaw - pose.yaw),  # the shorter way round
        )
        return od.Command(od.to_body(velocity, pose.yaw))


goal = od.Pose(1.0, 0.5, 6.0)  # 6.0 rad is 0.28 rad clockwise of 0
robot = od.named_robot("small")
run = od.simulate(
    od.MujocoPlant(robot, "ball"),
    PureProportional(),
    od.Hold(goal, duration=5.0),
    start=od.Pose(0.0, 0.0, 0.0),
    dt=0.05,
)
distance = hypot(run.pose[-1, 0] - goal.x, run.pose[-1, 1] - goal.y)
print(f"{run.ending}; {distance * 1e3:.2f} mm from the goal, turned by {run.pose[-1, 2]:.2f} rad")
