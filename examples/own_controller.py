"""A controller of one's own: any object with `reset` and `step` will do."""

from math import hypot

import omnidrive as od


class PureProportional:
    """Drive towards where the reference is now."""

    def reset(self, pose: od.Pose) -> None:
        """Forget nothing: there is no memory."""

    def step(self, t: float, pose: od.Pose, reference: od.Reference) -> od.Command:
        """Body twist of 3 1/s times the error."""
        target = reference.at(t).pose
        ahead = od.WorldTwist(
            3.0 * (target.x - pose.x), 3.0 * (target.y - pose.y), 3.0 * (target.yaw - pose.yaw)
        )
        return od.Command(od.to_body(ahead, pose.yaw))


goal = od.Pose(1.0, 0.5, 0.3)
robot = od.named_robot("small")
run = od.simulate(
    od.MujocoPlant(robot, "ball"),
    PureProportional(),
    od.Hold(goal, duration=5.0),
    start=od.Pose(0.0, 0.0, 0.0),
    dt=0.05,
)
left = hypot(run.pose[-1, 0] - goal.x, run.pose[-1, 1] - goal.y)
print(f"{run.outcome.value}; {left * 1e3:.2f} mm from the goal")
