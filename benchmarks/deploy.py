"""Driving a robot in real time: the loop, and delays over ROS 2.

Usage: deploy.py [--quick] [--slow S] [--fast S] [loop] [ros2]; 15 minutes without options.
"""

from __future__ import annotations

import argparse

import deploy_loop
import deploy_ros2
from figures import publish

QUICK_MESSAGES = 100_000


def main() -> None:
    """Measure, and print and write the table."""
    parser = argparse.ArgumentParser(description="Measure the real-time loop and ROS 2.")
    parser.add_argument("parts", nargs="*", choices=[[], "loop", "ros2"], metavar="loop|ros2")
    parser.add_argument("--quick", action="store_true", help="20 s per drive")
    parser.add_argument("--slow", type=float, metavar="S", help="seconds at 100 Hz")
    parser.add_argument("--fast", type=float, metavar="S", help="seconds at 500 Hz")
    options = parser.parse_args()
    durations = deploy_loop.QUICK if options.quick else deploy_loop.Durations()
    given = {name: getattr(options, name) for name in ("slow", "fast")}
    durations = durations._replace(**{name: each for name, each in given.items() if each})
    found: list[dict[str, object]] = []
    if "loop" in options.parts or not options.parts:
        found += deploy_loop.rows(durations)
    if "ros2" in options.parts or not options.parts:
        count = QUICK_MESSAGES if options.quick else deploy_ros2.MESSAGES
        found += deploy_ros2.rows(count)
    publish("deploy", found)


if __name__ == "__main__":
    main()
