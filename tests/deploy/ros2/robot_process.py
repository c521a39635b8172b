"""A robot in the graph for tests of drives: it does what a test says, also wrong things."""

import threading
import time
from contextlib import contextmanager

from omnidrive.deploy.ros2 import Ros2Robot, Ros2RobotSettings
from omnidrive.geometry import Pose
from omnidrive.robot import named_robot
from omnidrive.ros2 import Node, message_type
from omnidrive.ros2.planar_messages import set_pose, set_transform
from omnidrive.ros2.ros_time import stamp
from omnidrive.simulation import KinematicPlant

ROBOT = named_robot("mecanum")
ORIGIN = Pose(0.0, 0.0, 0.0)


@contextmanager
def running_robot(domain, *, start=ORIGIN, grid=None, **settings):
    """A simulated robot that moves in a thread."""
    options = {"domain": domain, "peers": ["localhost"], "distribution": "jazzy"}
    with Node("robot", **options) as node:
        robot = Ros2Robot(
            node,
            KinematicPlant(ROBOT),
            ROBOT,
            start,
            settings=Ros2RobotSettings(**settings),
            grid=grid,
        )
        ended = threading.Event()

        def move():
            while not ended.is_set():
                robot.run(0.2)

        thread = threading.Thread(target=move)
        thread.start()
        try:
            yield robot
        finally:
            ended.set()
            thread.join()


class Odometer:
    """Publishes the poses that a test gives."""

    def __init__(self, node):
        self.node = node
        self.odometry = node.publisher("/odom", "nav_msgs/msg/Odometry")
        self.transforms = node.publisher("/tf", "tf2_msgs/msg/TFMessage")
        self.localisation = node.publisher(
            "/amcl_pose", "geometry_msgs/msg/PoseWithCovarianceStamped"
        )

    def odom(self, x=0.0, y=0.0, yaw=0.0, age=0.0, parent="odom", child="base_link"):
        message = self.odometry.message()
        message.header.stamp = stamp(time.time() - age, "jazzy")
        message.header.frame_id, message.child_frame_id = parent, child
        set_pose(message.pose.pose, Pose(x, y, yaw))
        self.odometry.publish(message)

    def tf(self, parent, child, x=0.0, y=0.0, yaw=0.0, age=0.0):
        each = message_type("geometry_msgs/msg/TransformStamped")()
        each.header.stamp = stamp(time.time() - age, "jazzy")
        each.header.frame_id, each.child_frame_id = parent, child
        set_transform(each.transform, Pose(x, y, yaw))
        self.transforms.publish(self.transforms.message(transforms=[each]))

    def amcl(self, x, y, yaw, sigma=0.0, parent="map"):
        message = self.localisation.message()
        message.header.stamp = stamp(time.time(), "jazzy")
        message.header.frame_id = parent
        set_pose(message.pose.pose, Pose(x, y, yaw))
        message.pose.covariance[[0, 7, 35]] = sigma**2
        self.localisation.publish(message)
