"""Driving a robot in real time: delays over ROS 2."""

from __future__ import annotations

import deploy_ros2
from figures import publish


def main() -> None:
    publish("deploy", deploy_ros2.rows())


if __name__ == "__main__":
    main()
