"""Another node, in a process of its own, that shares no code with the package.

It is made of the types and the encoder of cyclonedds, written by hand, and of rosbags. It echoes
each Twist on /cmd_vel as an Odometry on /odom, and prints what it sees of the others as JSON when a
line arrives. Arguments: domain, humble or jazzy.
"""

import json
import sys
import threading
from dataclasses import dataclass

from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsParticipant,
    BuiltinTopicDcpsPublication,
)
from cyclonedds.core import Policy, Qos, ReadCondition, WaitSet
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, bounded_str, float64, int32, sequence, uint8, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

DOMAIN, DISTRIBUTION = int(sys.argv[1]), sys.argv[2]
GID = 24 if DISTRIBUTION == "humble" else 16
CONFIGURATION = """<CycloneDDS><Domain><General>
<Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>
<Peers><Peer Address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>"""
FOREVER = 2**63 - 1


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs.msg.dds_.Vector3_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Point(IdlStruct, typename="geometry_msgs.msg.dds_.Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs.msg.dds_.Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Pose(IdlStruct, typename="geometry_msgs.msg.dds_.Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class Twist(IdlStruct, typename="geometry_msgs.msg.dds_.Twist_"):
    linear: Vector3
    angular: Vector3


@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs.msg.dds_.PoseWithCovariance_"):
    pose: Pose
    covariance: array[float64, 36]


@dataclass
class TwistWithCovariance(IdlStruct, typename="geometry_msgs.msg.dds_.TwistWithCovariance_"):
    twist: Twist
    covariance: array[float64, 36]


@dataclass
class Time(IdlStruct, typename="builtin_interfaces.msg.dds_.Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs.msg.dds_.Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Odometry(IdlStruct, typename="nav_msgs.msg.dds_.Odometry_"):
    header: Header
    child_frame_id: str
    pose: PoseWithCovariance
    twist: TwistWithCovariance


@dataclass
class Gid(IdlStruct, typename="rmw_dds_common.msg.dds_.Gid_"):
    data: array[uint8, GID]


@dataclass
class NodeEntitiesInfo(IdlStruct, typename="rmw_dds_common.msg.dds_.NodeEntitiesInfo_"):
    node_namespace: bounded_str[256]
    node_name: bounded_str[256]
    reader_gid_seq: sequence[Gid]
    writer_gid_seq: sequence[Gid]


@dataclass
class ParticipantEntitiesInfo(
    IdlStruct, typename="rmw_dds_common.msg.dds_.ParticipantEntitiesInfo_"
):
    gid: Gid
    node_entities_info_seq: sequence[NodeEntitiesInfo]


def qos(history, durability=Policy.Durability.Volatile, type_name=""):
    """QoS of an endpoint; from Iron on with the hash of its type."""
    mark = b""
    if type_name and DISTRIBUTION != "humble":
        from rosbags.typesys import Stores, get_typestore

        mark = f"typehash={get_typestore(Stores.ROS2_JAZZY).hash_rihs01(type_name)};".encode()
    return Qos(
        Policy.Reliability.Reliable(FOREVER),
        durability,
        history,
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.Userdata(mark),
    )


def gid_of(entity):
    return Gid(list(entity.get_guid().bytes.ljust(GID, b"\0")))


class Peer:
    def __init__(self):
        self.domain = Domain(DOMAIN, CONFIGURATION)
        self.participant = DomainParticipant(DOMAIN, Qos(Policy.Userdata(b"enclave=/;")))
        last, latched = Policy.History.KeepLast(10), Policy.Durability.TransientLocal
        info = Topic(self.participant, "ros_discovery_info", ParticipantEntitiesInfo)
        commands = Topic(self.participant, "rt/cmd_vel", Twist)
        odometry = Topic(self.participant, "rt/odom", Odometry)
        self.info = DataWriter(self.participant, info, qos(Policy.History.KeepLast(1), latched))
        self.infos = DataReader(self.participant, info, qos(Policy.History.KeepAll, latched))
        self.commands = DataReader(
            self.participant, commands, qos(last, type_name="geometry_msgs/msg/Twist")
        )
        self.odometry = DataWriter(
            self.participant, odometry, qos(last, type_name="nav_msgs/msg/Odometry")
        )
        node = NodeEntitiesInfo("/", "peer", [gid_of(self.commands)], [gid_of(self.odometry)])
        self.info.write(ParticipantEntitiesInfo(gid_of(self.participant), [node]))
        self.views = {
            "participants": BuiltinDataReader(self.participant, BuiltinTopicDcpsParticipant),
            "publications": BuiltinDataReader(self.participant, BuiltinTopicDcpsPublication),
        }
        self.seen, self.count = {}, 0

    def echo(self):
        """Answer each command at once, for ever."""
        waitset = WaitSet(self.participant)
        waitset.attach(ReadCondition(self.commands, 0x1 | 0x2 | 0x1C | 0x60))
        while True:
            waitset.wait(10**9)
            for twist in self.commands.take(1000):
                self.count += 1
                orientation = Quaternion(0.0, 0.0, 0.0, 1.0)
                pose = Pose(Point(float(self.count), 0.0, 0.0), orientation)
                self.odometry.write(
                    Odometry(
                        Header(Time(1, 2), "odom"),
                        "base_link",
                        PoseWithCovariance(pose, [0.0] * 36),
                        TwistWithCovariance(twist, [0.5] * 36),
                    )
                )

    def report(self):
        """Nodes by participant, and USER_DATA of participants and publications."""
        for info in self.infos.take(1000):
            self.seen[bytes(info.gid.data).hex()] = [
                [n.node_namespace, n.node_name, len(n.reader_gid_seq), len(n.writer_gid_seq)]
                for n in info.node_entities_info_seq
            ]
        found = {"nodes": self.seen, "count": self.count}
        for name, view in self.views.items():
            found[name] = {
                each.key.bytes.hex(): [
                    getattr(each, "topic_name", ""),
                    getattr(each, "type_name", ""),
                    each.qos[Policy.Userdata].data.decode() if Policy.Userdata in each.qos else "",
                ]
                for each in view.read(1000)
                if each.sample_info.valid_data
            }
        return found


if __name__ == "__main__":
    peer = Peer()
    print("ready", flush=True)
    threading.Thread(target=peer.echo, daemon=True).start()
    for _ in sys.stdin:
        print(json.dumps(peer.report()), flush=True)
