"""A custom controller that commands wheel torques: computed-torque control."""

import numpy as np

import omnidrive as od


class ComputedTorque:
    """Inverse dynamics with feedback of pose and velocity errors in the world frame.

    With the desired acceleration ``a_ref + 2 w (v_ref - v) + w^2 (p_ref - p)`` errors decay as
    those of a critically damped oscillator (Siciliano et al., "Robotics", 2009, 8.5.2). The robot's
    inertia converts it into a wrench, and the least-norm torques with ``J^T torques = wrench``
    exert it.
    """

    frequency = 5.0  # rad/s
    dt = 0.02  # s

    def __init__(self, robot: od.Robot) -> None:
        jacobian = robot.chassis.jacobian
        wheels = robot.wheel.rotor_inertia * jacobian.T @ jacobian
        self.inertia = np.diag(robot.inertia) + wheels
        self.torques_per_wrench = np.linalg.pinv(jacobian.T)

    def reset(self, state: od.State) -> None:
        """Store the initial pose, from which the velocity is computed."""
        self.previous = np.array(state.pose)

    def step(self, t: float, state: od.State, reference: od.Reference) -> od.Command:
        """Return wheel torques for the errors in pose and velocity."""
        now, later = reference.window(t, 2, self.dt)
        pose = np.array(state.pose)
        velocity, self.previous = (pose - self.previous) / self.dt, pose
        error, rate = now[:3] - pose, now[3:] - velocity
        error[2] = od.wrap(error[2])
        feedforward = (later[3:] - now[3:]) / self.dt
        acceleration = feedforward + 2.0 * self.frequency * rate + self.frequency**2 * error
        body = od.to_body(od.WorldTwist(*acceleration.tolist()), state.pose.yaw)
        wrench = self.inertia @ np.array(body)
        return od.Command(od.WheelTorques(self.torques_per_wrench @ wrench))


robot = od.named_robot("small")
poses = np.array([[0.0, 0.0, 0.0], [0.4, 0.3, 0.4], [1.2, -0.3, 1.0], [1.6, 0.0, 1.2]])
reference = od.SampledReference.through(np.array([0.0, 2.0, 4.0, 6.0]), poses)
run = od.simulate(
    od.PlanarPlant(robot),
    ComputedTorque(robot),
    reference,
    start=reference.at(0.0).pose,
    dt=ComputedTorque.dt,
).raise_if_failed()
error = np.hypot(*(run.pose - run.target)[:, :2].T)
slips = np.mean(run.saturated & od.Saturation.FRICTION > 0)
print(f"error: mean {error.mean() * 1e3:.1f} mm, largest {error.max() * 1e3:.1f} mm")
print(
    f"largest torque {np.abs(run.wheel_torque).max():.2f} N m; wheels slip in {slips:.0%} of rows"
)
