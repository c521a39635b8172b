"""Messages both ways between two processes: none lost, memory flat."""

import sys
from pathlib import Path

import pytest

from tests.ros2.peer_process import new_domain

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import deploy_ros2


def run(count, growth):
    """``count`` round trips; each answer is the next one; memory grows by at most MB."""
    with deploy_ros2.channel(new_domain()) as (to, peer):
        result = deploy_ros2.traffic(to, peer, count)
    assert result.lost == 0
    assert result.growth < growth


def test_no_message_is_lost():
    run(2000, growth=20.0)


@pytest.mark.long
def test_no_message_of_a_million_is_lost():
    run(1_000_000, growth=5.0)
