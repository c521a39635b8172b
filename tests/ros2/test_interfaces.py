"""Definitions of interfaces and their hashes: those of rosbags."""

import pytest
from rosbags.typesys import get_types_from_msg, get_typestore

from omnidrive.ros2 import definition_text, interfaces, type_hash
from omnidrive.ros2.type_hash import distribution_of, distributions_with
from tests.ros2.peer_types import STORES, typestore


@pytest.mark.parametrize("distribution", STORES)
def test_hashes_are_those_of_rosbags(distribution):
    store = typestore(distribution)
    for name in interfaces(distribution):
        assert type_hash(name, distribution) == store.hash_rihs01(name)


def test_the_hash_of_the_graph_is_that_of_ros_nodes():
    """rosbags has another one: it takes char for a type of its own, which is uint8 in IDL."""
    announced = "RIHS01_91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e"
    name = "rmw_dds_common/msg/ParticipantEntitiesInfo"
    assert [each for each in STORES if type_hash(name, each) == announced] == list(STORES)[1:]


@pytest.mark.parametrize("distribution", STORES)
def test_definitions_are_those_of_rosbags(distribution):
    """A text of ours, parsed by rosbags, gives the fields that rosbags has from the source."""
    known = get_typestore(STORES[distribution]).fielddefs
    own = sorted(interfaces(distribution).keys() & known.keys() - {"rmw_dds_common/msg/Gid"})
    assert len(own) > 45
    for name in own:
        parsed = get_types_from_msg(definition_text(name, distribution), name)
        assert plain(parsed[name][1]) == plain(known[name][1]), name


def plain(fields):
    return [(name, repr(kind)) for name, kind in fields if not name.startswith("structure_")]


def test_distributions_differ_where_ros_does():
    assert interfaces("humble")["rmw_dds_common/msg/Gid"].fields[0].length == 24
    assert interfaces("iron")["rmw_dds_common/msg/Gid"].fields[0].length == 16
    assert lengths("nav2_msgs/action/FollowPath_Goal") == [3, 4, 4, 4, 5, 5]
    assert lengths("nav2_msgs/action/FollowPath_Result") == [1, 2, 3, 3, 3, 3]
    assert lengths("nav2_msgs/action/FollowPath_Feedback") == [2, 2, 2, 2, 1, 1]
    last = [interfaces(d)["nav2_msgs/action/FollowPath_Result"].fields[-1].name for d in STORES]
    assert last == ["result", "error_code", *["error_msg"] * 4]


def lengths(name):
    return [len(interfaces(each)[name].fields) for each in STORES]


GOAL = "nav2_msgs/action/FollowPath_SendGoal_Request"
RESULT = "nav2_msgs/action/FollowPath_GetResult_Response"


@pytest.mark.parametrize(
    ("hashes", "expected"),
    [
        ([], None),
        ([("nav_msgs/msg/Odometry", "")], "humble"),
        ([("nav_msgs/msg/Odometry", type_hash("nav_msgs/msg/Odometry"))], "jazzy"),
        ([("some_msgs/msg/Other", "RIHS01_00")], "jazzy"),
        *(
            ([(GOAL, type_hash(GOAL, each)), (RESULT, type_hash(RESULT, each))], each)
            for each in ("iron", "jazzy", "lyrical")
        ),
    ],
)
def test_the_distribution_is_that_of_the_announced_hashes(hashes, expected):
    assert distribution_of(hashes) == expected


def test_a_hash_tells_the_distributions_that_have_it():
    assert distributions_with(RESULT, type_hash(RESULT, "kilted"))[:2] == ("jazzy", "kilted")
    assert distributions_with(RESULT, type_hash(RESULT, "iron")) == ("iron",)
    assert distributions_with(RESULT, "RIHS01_00") == ()
    assert distributions_with("some_msgs/msg/Other", "RIHS01_00") == ()
