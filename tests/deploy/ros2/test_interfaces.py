"""Definitions of interfaces and their hashes: those of rosbags."""

import pytest
from rosbags.typesys import get_types_from_msg, get_typestore

from omnidrive.deploy.ros2 import definition_text, interfaces, type_hash
from tests.deploy.ros2.peer_types import STORES, typestore


@pytest.mark.parametrize("distribution", STORES)
def test_hashes_are_those_of_rosbags(distribution):
    store = typestore(distribution)
    for name in interfaces(distribution):
        assert type_hash(name, distribution) == store.hash_rihs01(name)


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
    names = [
        [f.name for f in interfaces(d)["nav2_msgs/action/FollowPath_Goal"].fields] for d in STORES
    ]
    assert [len(each) for each in names] == [3, 3, 4, 4]
